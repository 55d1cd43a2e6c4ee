//! From paths as written to the files that define what they name.

use super::parse::{File, Module, ModulePath};
use std::collections::BTreeMap;

/// Most re-exports that are followed for one name; more are a circle of re-exports.
const MOST_STEPS: usize = 8;

/// One file uses another.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Edge {
    /// Index of the file that uses.
    pub(super) from: usize,
    /// Index of the file that is used.
    pub(super) to: usize,
    /// The path, as written.
    pub(super) path: String,
}

/// All uses of a file by another, the first path for each pair.
pub(super) fn edges(files: &[File]) -> Vec<Edge> {
    let tree = Tree {
        files: file_of_module(files),
        modules: files.iter().flat_map(|file| &file.modules).collect(),
    };
    let mut found: BTreeMap<(usize, usize), String> = BTreeMap::new();
    for (from, file) in files.iter().enumerate() {
        for (place, module) in &file.modules {
            for path in &module.paths {
                if let Some(to) = tree.file(place, path)
                    && to != from
                {
                    found.entry((from, to)).or_insert_with(|| path.join("::"));
                }
            }
        }
    }
    found
        .into_iter()
        .map(|((from, to), path)| Edge { from, to, path })
        .collect()
}

/// The modules of a crate.
struct Tree<'a> {
    files: BTreeMap<&'a [String], usize>,
    modules: BTreeMap<&'a ModulePath, &'a Module>,
}

impl Tree<'_> {
    /// The file in which the item or module is defined that a path in the module `place` names; `None` outside the crate.
    fn file(&self, place: &ModulePath, path: &[String]) -> Option<usize> {
        let module = self.definition(place, path, MOST_STEPS)?;
        self.files.get(module.as_slice()).copied()
    }

    /// The module that defines what a path names.
    fn definition(&self, place: &ModulePath, path: &[String], steps: usize) -> Option<ModulePath> {
        let steps = steps.checked_sub(1)?;
        let (mut module, rest) = self.start(place, path, steps)?;
        let mut rest = rest.as_slice();
        while let Some((name, further)) = rest.split_first() {
            let here = self.modules.get(&module)?;
            if here.children.contains(name) {
                module.push(name.clone());
                rest = further;
                continue;
            }
            if here.items.contains(name) {
                return Some(module);
            }
            return self.imported(&module, here, rest, steps);
        }
        Some(module)
    }

    /// The module at which a path begins and the rest of it; `None` for a path into another crate.
    fn start(
        &self,
        place: &ModulePath,
        path: &[String],
        steps: usize,
    ) -> Option<(ModulePath, Vec<String>)> {
        let mut module = place.clone();
        let mut rest = path;
        match rest.first()?.as_str() {
            "crate" => {
                module.clear();
                rest = &rest[1..];
            }
            "self" => rest = &rest[1..],
            "super" => {
                while rest.first().is_some_and(|word| word == "super") {
                    module.pop()?;
                    rest = &rest[1..];
                }
            }
            first => {
                let here = self.modules.get(&module)?;
                // A name in scope: a child, or an import that is not the path itself.
                if !here.children.contains(first) {
                    let target = here.imports.get(first).filter(|target| *target != path)?;
                    let local = |word: &str| {
                        matches!(word, "crate" | "self" | "super") || here.children.contains(word)
                    };
                    if !local(target.first()?) {
                        return None;
                    }
                    let mut whole = target.clone();
                    whole.extend_from_slice(&rest[1..]);
                    return self.start(place, &whole, steps.checked_sub(1)?);
                }
            }
        }
        Some((module, rest.to_vec()))
    }

    /// Follows a name that a module imports or re-exports.
    fn imported(
        &self,
        module: &ModulePath,
        here: &Module,
        rest: &[String],
        steps: usize,
    ) -> Option<ModulePath> {
        let (name, further) = rest.split_first()?;
        if let Some(target) = here.imports.get(name) {
            let mut whole = target.clone();
            whole.extend_from_slice(further);
            return self.definition(module, &whole, steps);
        }
        here.globs.iter().find_map(|glob| {
            let mut whole = glob.clone();
            whole.extend_from_slice(rest);
            self.definition(module, &whole, steps)
        })
    }
}

/// Maps every module, inline ones included, to the index of its file.
fn file_of_module(files: &[File]) -> BTreeMap<&[String], usize> {
    files
        .iter()
        .enumerate()
        .flat_map(|(index, file)| {
            file.modules
                .keys()
                .map(move |path| (path.as_slice(), index))
        })
        .collect()
}
