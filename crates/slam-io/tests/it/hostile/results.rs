//! The program's own files: maps, checkpoints, finished runs.

use std::fs;

use slam_io::{
    Checkpoint, RunIdentity, Sequence, read_checkpoint, read_known_map, read_map, read_run,
    write_checkpoint, write_run,
};

use super::mutations::{Memory, attack};
use super::{TEXT, attack_file, unsealed};
use crate::common::ScratchFolder;
use crate::common::run::small_run;
use crate::common::sequence::good;

/// Binary files: their numbers, twice.
const BINARY: Memory = Memory {
    per_byte: 8,
    always: 1 << 20,
};

/// A checksum that fits in the last four bytes.
fn seal(bytes: &mut [u8]) {
    if let Some(content) = bytes.len().checked_sub(4) {
        let sum = crc32fast::hash(&bytes[..content]);
        bytes[content..].copy_from_slice(&sum.to_le_bytes());
    }
}

#[test]
fn maps_of_any_bytes() {
    let folder = ScratchFolder::new();
    write_run(&small_run(), folder.path(), &[]).unwrap();
    let genuine = [fs::read(folder.path().join("map.slam")).unwrap()];
    attack_file("map", &genuine, BINARY, seal, |path| {
        drop(read_map(path));
        drop(read_known_map(path));
    });
}

#[test]
fn checkpoints_of_any_bytes() {
    let folder = ScratchFolder::new();
    let path = folder.path().join("out.checkpoint");
    let sequence = good();
    let sequence = Sequence::open(sequence.path()).unwrap();
    let checkpoint = Checkpoint {
        identity: RunIdentity::of(&sequence, "[filter]\nparticles = 30\n", None),
        state: (0..200).collect(),
    };
    write_checkpoint(&path, &checkpoint).unwrap();
    let genuine = [fs::read(&path).unwrap()];
    attack_file("checkpoint", &genuine, BINARY, seal, |path| {
        if let Ok(read) = read_checkpoint(path) {
            drop(read.identity.difference(&checkpoint.identity));
            drop(checkpoint.identity.difference(&read.identity));
        }
    });
}

#[test]
fn finished_runs_of_any_bytes() {
    for name in ["report_data.json", "tracks.csv"] {
        let folder = ScratchFolder::new();
        write_run(&small_run(), folder.path(), &[]).unwrap();
        let path = folder.path().join(name);
        let genuine = [fs::read(&path).unwrap()];
        attack(name, &genuine, TEXT, unsealed, |bytes| {
            fs::write(&path, bytes).unwrap();
            drop(read_run(folder.path()));
        });
    }
}
