//! Bytes into every reader of this crate: no panic, and memory in proportion to the file.
//!
//! `MONO_SLAM_CASES` says how many cases a reader gets; CONTRIBUTING.md has the command.

mod images;
mod mutations;
mod results;
mod sequences;
mod texts;

use std::fs;
use std::path::Path;

use crate::common::ScratchFolder;
use mutations::{Memory, attack};

/// A text: trees of TOML and YAML take some hundred bytes a node, and a node may be two bytes.
const TEXT: Memory = Memory {
    per_byte: 400,
    always: 1 << 20,
};

/// Attacks a reader of one file.
fn attack_file(
    parser: &str,
    genuine: &[Vec<u8>],
    memory: Memory,
    seal: impl Fn(&mut [u8]),
    read: impl Fn(&Path),
) {
    let folder = ScratchFolder::new();
    let path = folder.path().join("file.any");
    attack(parser, genuine, memory, seal, |bytes| {
        fs::write(&path, bytes).unwrap();
        read(&path);
    });
}

fn unsealed(_: &mut [u8]) {}
