//! Names that are there pass; names that are not there are found with their line.

use super::commands::Commands;
use super::in_text;
use std::path::PathBuf;

fn commands() -> Commands {
    let mut commands = Commands::default();
    let target = |kind: &str, name: &str| (String::from(kind), String::from(name));
    commands.add(
        "ukf",
        [
            target("lib", "ukf"),
            target("example", "attitude"),
            target("bench", "steps"),
        ]
        .into_iter(),
    );
    commands
        .set_program("enum Command {\n    /// Run it\n    Run(run::Arguments),\n    Config,\n}\n");
    commands
}

fn found(text: &str) -> Vec<String> {
    let paths: Vec<PathBuf> = [
        "README.md",
        "crates/ukf",
        "crates/ukf/src",
        "crates/ukf/src/update.rs",
        "fixtures/wall",
    ]
    .map(PathBuf::from)
    .to_vec();
    in_text("a.md", text, &paths, &commands())
}

#[test]
fn what_is_there_passes() {
    for text in [
        "`crates/ukf/src/update.rs`, `ukf/src/update.rs`, `src/update.rs`, `update.rs`, `crates/ukf/`",
        "`../README.md` and `fixtures/wall`",
        "`cargo run -p ukf --example attitude -- --seed 3` and `cargo bench -p ukf --bench steps`",
        "`cargo run --release --example attitude`, `cargo test -p ukf`, `RAYON_NUM_THREADS=1 cargo bench -p ukf`",
        "`cargo xtask scene --out SEQ`, `cargo xtask --help`, `cargo fmt --check`",
        "`mono-slam run SEQ`, `mono-slam help`, `mono-slam --version`, `mono-slam SEQ`",
        // Data, placeholders and code are not judged.
        "`frames.csv`, `YYYY-MM-DD-<question>.md`, `src/*.rs`, `a.rs()`, update2.rs",
        "```rust\nmod gone; // `gone.rs`\n```",
        "```sh\ncargo test -p ukf   # all of `gone.rs`\n```",
    ] {
        assert_eq!(found(text), Vec::<String>::new(), "{text}");
    }
}

#[test]
fn what_is_not_there_is_found_with_its_line() {
    for (text, expected) in [
        ("\n`update2.rs`", "a.md:2: no file `update2.rs`"),
        ("`date.rs`", "a.md:1: no file `date.rs`"),
        (
            "`python crates/ukf/make.py all`",
            "a.md:1: no file `crates/ukf/make.py`",
        ),
        ("`fixtures/room/`", "a.md:1: no file `fixtures/room/`"),
        ("`cargo xtask paint`", "a.md:1: no task `cargo xtask paint`"),
        ("`cargo run -p kuf`", "a.md:1: no package `kuf`"),
        (
            "`cargo run -p ukf --example steps`",
            "a.md:1: no example `steps` in `ukf`",
        ),
        (
            "`cargo bench --bench attitude`",
            "a.md:1: no bench `attitude`",
        ),
        (
            "`mono-slam walk SEQ`",
            "a.md:1: no command `mono-slam walk`",
        ),
        (
            "```sh\ncargo xtask paint\n```",
            "a.md:2: no task `cargo xtask paint`",
        ),
    ] {
        assert_eq!(found(text), [expected], "{text}");
    }
}
