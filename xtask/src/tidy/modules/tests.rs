//! Small trees with and without cycles.

use super::parse::File;
use super::{of_crate, resolve};

/// The files of a crate: module path (`""` for the root) and code.
fn files(list: &[(&str, &str)]) -> Vec<File> {
    list.iter()
        .map(|(module, code)| {
            let path: Vec<String> = module
                .split("::")
                .filter(|part| !part.is_empty())
                .map(String::from)
                .collect();
            let name = if module.is_empty() { "lib" } else { module };
            File::parse(name, &path, code).unwrap()
        })
        .collect()
}

/// The uses of a crate as `from>to`.
fn edges(list: &[(&str, &str)]) -> Vec<String> {
    let files = files(list);
    resolve::edges(&files)
        .iter()
        .map(|edge| format!("{}>{}", files[edge.from].name, files[edge.to].name))
        .collect()
}

fn cycles(list: &[(&str, &str)]) -> usize {
    of_crate(&files(list)).len()
}

#[test]
fn uses_in_every_form_are_seen() {
    for code in [
        "use super::b::B;",
        "use crate::b::B;",
        "use super::{b::{self, B as Other}, c};",
        "use crate::b::*;",
        "fn f() -> usize { super::b::count() }",
        "fn f() { g(|x| [crate::b::COUNT; 3]) }",
        "fn f() { assert!(super::b::holds(), \"text\"); }",
        "use super::b; fn f(b: b::B) {}",
        "impl<T: super::b::Trait> Trait for T {}",
        "mod inner { use super::super::b::B; }",
        "fn f() { use crate::b::B; }",
        "pub(in crate::a) use super::b::B;",
    ] {
        let tree = [
            ("", "mod a; mod b; mod c;"),
            ("a", code),
            (
                "b",
                "pub struct B; pub fn count() {} pub fn holds() {} pub const COUNT: u8 = 0; pub trait Trait {}",
            ),
            ("c", ""),
        ];
        assert!(
            edges(&tree).contains(&"a>b".into()),
            "{code}: {:?}",
            edges(&tree)
        );
    }
}

#[test]
fn what_is_no_use_is_not_seen() {
    for code in [
        "// use super::b::B;\n/// See [`super::b::B`].\nfn f() { let text = \"super::b::B\"; }",
        "#[cfg(test)]\nmod tests { use super::super::b::B; }",
        "#[cfg(test)]\nuse super::b::{B, count};\nfn f() {}",
        "#[cfg(test)]\n#[derive(Debug)]\nfn f() { super::b::count() }",
        "#[cfg(all(test, feature = \"x\"))]\nmod tests { use crate::b::B; }",
        "use b::B;",
        "use other::b::B; fn f() { other::b::count() }",
    ] {
        let tree = [
            ("", "mod a; mod b;"),
            ("a", code),
            ("b", "pub struct B; pub fn count() {}"),
        ];
        assert_eq!(edges(&tree), Vec::<String>::new(), "{code}");
    }
    // What follows a test-only import still counts.
    let tree = [
        ("", "mod a; mod b;"),
        (
            "a",
            "#[cfg(test)]\nuse super::b::{B, count};\nuse super::b::B;",
        ),
        ("b", "pub struct B; pub fn count() {}"),
    ];
    assert_eq!(edges(&tree), ["a>b"]);
}

#[test]
fn paths_lead_through_parents_and_re_exports_to_the_definition() {
    let tree = [
        ("", "mod a; mod b; pub use a::A; pub use b::inner::*;"),
        ("a", "pub struct A; fn f() { crate::thing() }"),
        ("b", "pub(crate) mod inner; use crate::A;"),
        ("b::inner", "pub fn thing() {} use crate::b;"),
    ];
    // inner uses the module b itself; a reaches inner through the star of the root.
    assert_eq!(
        edges(&tree),
        ["lib>a", "lib>b::inner", "a>b::inner", "b>a", "b::inner>b"]
    );
}

#[test]
fn siblings_and_parents_that_only_declare_make_no_cycle() {
    assert_eq!(
        cycles(&[
            ("", "mod a; mod b; pub use a::A; pub use b::B;"),
            ("a", "pub struct A;"),
            ("b", "use super::a::A; pub struct B(A);"),
        ]),
        0
    );
    // The parent declares its child, which takes a constant of the parent.
    assert_eq!(
        cycles(&[
            ("", "mod a; const SIZE: usize = 3;"),
            ("a", "use super::SIZE;")
        ]),
        0
    );
}

#[test]
fn cycles_are_reported_once_with_their_paths() {
    // Two siblings.
    let found = of_crate(&files(&[
        ("", "mod a; mod b;"),
        ("a", "use super::b::B; pub struct A;"),
        ("b", "use crate::a::A; pub struct B;"),
    ]));
    assert_eq!(
        found,
        ["cycle between files: a uses b (super::b::B), b uses a (crate::a::A)"]
    );
    // A parent that re-exports a child, and the child takes a type of the parent.
    assert_eq!(
        cycles(&[
            ("", "mod a; pub use a::A; pub struct Error;"),
            ("a", "use crate::Error; pub struct A;"),
        ]),
        1
    );
    // Three files in a ring, and two rings apart.
    assert_eq!(
        cycles(&[
            ("", "mod a; mod b; mod c; mod d; mod e;"),
            ("a", "use super::b::B; pub struct A;"),
            ("b", "use super::c::C; pub struct B;"),
            ("c", "use super::a::A; pub struct C;"),
            ("d", "use super::e::E; pub struct D;"),
            ("e", "use super::d::D; pub struct E;"),
        ]),
        2
    );
}

#[test]
fn a_circle_of_re_exports_ends() {
    assert_eq!(
        cycles(&[
            ("", "mod a; mod b;"),
            ("a", "pub use super::b::*;"),
            ("b", "pub use super::a::*; fn f() { super::a::missing() }"),
        ]),
        1
    );
}
