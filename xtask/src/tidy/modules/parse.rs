//! A source file as the check sees it: modules with their definitions, imports and paths.
//!
//! The file is read as a tree of tokens; comments and the text of strings are gone then. Items behind an attribute
//! `#[cfg(test)]` are skipped.

use anyhow::anyhow;
use proc_macro2::{Delimiter, TokenStream, TokenTree};
use std::collections::{BTreeMap, BTreeSet};

/// The name of a module: its path from the root of the crate; empty for the root.
pub(super) type ModulePath = Vec<String>;

/// Keywords after which the name of an item follows.
const DEFINING: [&str; 9] = [
    "struct",
    "enum",
    "union",
    "trait",
    "type",
    "const",
    "static",
    "fn",
    "macro_rules",
];

/// One source file.
#[derive(Debug)]
pub(super) struct File {
    /// Its path, for messages.
    pub(super) name: String,
    /// The module it holds and the inline modules within.
    pub(super) modules: BTreeMap<ModulePath, Module>,
    /// Children that are files of their own.
    pub(super) file_modules: Vec<ModulePath>,
}

/// One module.
#[derive(Debug, Default)]
pub(super) struct Module {
    /// Names of the items defined in it.
    pub(super) items: BTreeSet<String>,
    /// Names of its child modules.
    pub(super) children: BTreeSet<String>,
    /// Imported names with the paths they stand for, as written.
    pub(super) imports: BTreeMap<String, Vec<String>>,
    /// Paths imported with a star, as written.
    pub(super) globs: Vec<Vec<String>>,
    /// All paths of `use` declarations and of expressions and types, as written.
    pub(super) paths: BTreeSet<Vec<String>>,
}

impl File {
    /// Reads the code of the module `module`.
    ///
    /// # Errors
    /// The code has no balanced brackets or another lexical fault.
    pub(super) fn parse(name: &str, module: &[String], code: &str) -> anyhow::Result<Self> {
        let tokens: TokenStream = code
            .parse()
            .map_err(|error| anyhow!("{name} is no Rust: {error}"))?;
        let mut file = Self {
            name: name.to_owned(),
            modules: BTreeMap::new(),
            file_modules: Vec::new(),
        };
        file.module(&module.to_vec(), tokens);
        Ok(file)
    }

    /// Reads the body of one module.
    fn module(&mut self, path: &ModulePath, tokens: TokenStream) {
        self.entry(path);
        self.tokens(path, tokens, true);
    }

    /// Reads tokens of the module `path`; only at its top level are names definitions.
    fn tokens(&mut self, path: &ModulePath, tokens: TokenStream, top: bool) {
        let tokens: Vec<TokenTree> = tokens.into_iter().collect();
        let mut at = 0;
        while at < tokens.len() {
            at = self.step(path, &tokens, at, top);
        }
    }

    /// Reads what begins at a token and returns the place after it.
    fn step(&mut self, path: &ModulePath, tokens: &[TokenTree], at: usize, top: bool) -> usize {
        match &tokens[at] {
            TokenTree::Punct(mark) if mark.as_char() == '#' => {
                if tests_only(tokens.get(at + 1)) {
                    return end_of_item(tokens, at + 2);
                }
                // Other attributes hold nothing that is a path of ours.
                let attribute = matches!(tokens.get(at + 1), Some(TokenTree::Group(_)));
                at + 1 + usize::from(attribute)
            }
            TokenTree::Ident(word) if word == "use" => {
                let end = position(tokens, at, ';');
                let mut leaves = Vec::new();
                use_tree(&tokens[at + 1..end], &[], &mut leaves);
                self.imports(path, leaves);
                end + 1
            }
            TokenTree::Ident(word) if word == "mod" && top => {
                match (tokens.get(at + 1), tokens.get(at + 2)) {
                    (Some(TokenTree::Ident(name)), Some(TokenTree::Group(body))) => {
                        let inner = self.child(path, &name.to_string());
                        self.module(&inner, body.stream());
                        at + 3
                    }
                    (Some(TokenTree::Ident(name)), _) => {
                        let inner = self.child(path, &name.to_string());
                        self.file_modules.push(inner);
                        at + 2
                    }
                    _ => at + 1,
                }
            }
            // The visibility's own path, as in `pub(in super::inner)`.
            TokenTree::Ident(word) if word == "pub" => {
                let scope = matches!(tokens.get(at + 1),
                    Some(TokenTree::Group(group)) if group.delimiter() == Delimiter::Parenthesis);
                at + 1 + usize::from(scope)
            }
            TokenTree::Ident(word) if top && DEFINING.contains(&word.to_string().as_str()) => {
                let name = tokens[at + 1..].iter().find_map(|token| match token {
                    TokenTree::Ident(name) => Some(name.to_string()),
                    _ => None,
                });
                // `const fn` and `unsafe` come to their own keyword next.
                if let Some(name) = name.filter(|name| !DEFINING.contains(&name.as_str())) {
                    self.entry(path).items.insert(name);
                }
                at + 1
            }
            TokenTree::Ident(_) => {
                let (segments, end) = path_at(tokens, at);
                if segments.len() > 1 {
                    self.entry(path).paths.insert(segments);
                }
                end
            }
            TokenTree::Group(group) => {
                self.tokens(path, group.stream(), false);
                at + 1
            }
            _ => at + 1,
        }
    }

    fn entry(&mut self, path: &ModulePath) -> &mut Module {
        self.modules.entry(path.clone()).or_default()
    }

    fn child(&mut self, path: &ModulePath, name: &str) -> ModulePath {
        self.entry(path).children.insert(name.to_owned());
        let mut inner = path.clone();
        inner.push(name.to_owned());
        inner
    }

    fn imports(&mut self, path: &ModulePath, leaves: Vec<(String, Vec<String>)>) {
        let module = self.entry(path);
        for (name, target) in leaves {
            if name == "*" {
                module.globs.push(target.clone());
            } else {
                module.imports.insert(name, target.clone());
            }
            module.paths.insert(target);
        }
    }
}

/// Whether a bracket after `#` says that an item exists in tests only.
fn tests_only(bracket: Option<&TokenTree>) -> bool {
    let Some(TokenTree::Group(group)) = bracket else {
        return false;
    };
    let text = group.stream().to_string().replace(' ', "");
    text.starts_with("cfg(test)") || text.starts_with("cfg(all(test")
}

/// The place after the item that begins at `at`: its semicolon or its body in braces.
fn end_of_item(tokens: &[TokenTree], mut at: usize) -> usize {
    let mut imports = false;
    while let Some(token) = tokens.get(at) {
        at += 1;
        match token {
            TokenTree::Ident(word) if word == "use" || word == "const" || word == "static" => {
                imports = true;
            }
            TokenTree::Ident(word) if word == "fn" => imports = false,
            TokenTree::Punct(mark) if mark.as_char() == ';' => break,
            TokenTree::Group(group) if group.delimiter() == Delimiter::Brace && !imports => break,
            _ => {}
        }
    }
    at
}

/// The first place of a mark from `at` on, or the end.
fn position(tokens: &[TokenTree], at: usize, mark: char) -> usize {
    let is =
        |token: &TokenTree| matches!(token, TokenTree::Punct(punct) if punct.as_char() == mark);
    tokens[at..]
        .iter()
        .position(is)
        .map_or(tokens.len(), |offset| at + offset)
}

/// Whether `::` stands at a place.
fn colons(tokens: &[TokenTree], at: usize) -> bool {
    let colon = |token: Option<&TokenTree>| matches!(token, Some(TokenTree::Punct(mark)) if mark.as_char() == ':');
    colon(tokens.get(at)) && colon(tokens.get(at + 1))
}

/// The path of words joined by `::` that begins at a word, and the place after it.
fn path_at(tokens: &[TokenTree], mut at: usize) -> (Vec<String>, usize) {
    let mut segments = Vec::new();
    while let Some(TokenTree::Ident(word)) = tokens.get(at) {
        segments.push(word.to_string());
        at += 1;
        if !colons(tokens, at) {
            break;
        }
        at += 2;
    }
    (segments, at)
}

/// The leaves of a `use` tree: the name each gives (`*` for all) and its path.
fn use_tree(tokens: &[TokenTree], prefix: &[String], leaves: &mut Vec<(String, Vec<String>)>) {
    // A leading `::` names an external crate and is kept by no rule here.
    let start = if colons(tokens, 0) { 2 } else { 0 };
    let (segments, end) = path_at(tokens, start);
    let mut path = prefix.to_vec();
    path.extend(segments);
    match tokens.get(end) {
        Some(TokenTree::Group(group)) => {
            let inner: Vec<TokenTree> = group.stream().into_iter().collect();
            let comma = |token: &TokenTree| matches!(token, TokenTree::Punct(mark) if mark.as_char() == ',');
            for branch in inner.split(comma).filter(|branch| !branch.is_empty()) {
                use_tree(branch, &path, leaves);
            }
        }
        Some(TokenTree::Punct(mark)) if mark.as_char() == '*' => leaves.push(("*".into(), path)),
        rest => {
            // `self` in braces is the module itself; `as` gives another name.
            if path.len() > 1 && path.last().is_some_and(|last| last == "self") {
                path.pop();
            }
            let renamed = matches!(rest, Some(TokenTree::Ident(word)) if word == "as");
            let name = match tokens.get(end + 1) {
                Some(TokenTree::Ident(name)) if renamed => name.to_string(),
                _ => path.last().cloned().unwrap_or_default(),
            };
            leaves.push((name, path));
        }
    }
}
