//! The committed fixtures are, byte for byte, what this tree renders and what the filter makes of it.
//!
//! `cargo xtask fixtures` writes them through the programs; this test takes the libraries, in the profile of the tests.

use mono_slam::run::run_sequence;
use slam_io::{Sequence, write_run};
use slam_pipeline::config::Config;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use wall_scenes::{BoardSetSpec, Scene, SceneSpec, write_board_set};

/// A folder that goes away.
struct Scratch(PathBuf);

impl Scratch {
    fn new(name: &str) -> Scratch {
        Scratch(std::env::temp_dir().join(format!("fresh-{name}-{}", std::process::id())))
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        // Leaving a folder behind is no reason to fail a test.
        drop(fs::remove_dir_all(&self.0));
    }
}

/// The bytes of every file below a folder, by path.
fn files(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let (mut found, mut open) = (BTreeMap::new(), vec![folder.to_path_buf()]);
    while let Some(inner) = open.pop() {
        for entry in fs::read_dir(&inner).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                open.push(path);
            } else {
                let name = path.strip_prefix(folder).unwrap().to_path_buf();
                found.insert(name, fs::read(&path).unwrap());
            }
        }
    }
    found
}

/// Compares fresh files with the committed ones; the manifest is the business of `cargo xtask tidy`.
fn assert_committed(name: &str, fresh: &BTreeMap<PathBuf, Vec<u8>>) {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures");
    let mut committed = files(&root.join(name));
    committed.remove(Path::new("manifest.txt")).unwrap();
    let names = |files: &BTreeMap<PathBuf, Vec<u8>>| files.keys().cloned().collect::<Vec<_>>();
    assert_eq!(names(fresh), names(&committed), "fixtures/{name}");
    for (file, bytes) in fresh {
        assert!(
            committed[file] == *bytes,
            "fixtures/{name}/{} is not what this tree makes: run `cargo xtask fixtures`",
            file.display()
        );
    }
}

#[test]
fn the_wall_and_its_golden_results_are_what_this_tree_makes() {
    let scratch = Scratch::new("wall");
    let spec = SceneSpec {
        frames: 20,
        ..SceneSpec::wall(2006)
    };
    Scene::new(spec).unwrap().write(&scratch.0).unwrap();
    let config = Config::default().check().unwrap();
    let sequence = Sequence::open(&scratch.0).unwrap();
    let record = run_sequence(&sequence, &config, &|| 0.0, &mut |_| {}).unwrap();
    let results = Scratch::new("wall-run");
    write_run(&record, &results.0, &[]).unwrap();
    let mut fresh = files(&scratch.0);
    for name in ["trajectory.tum", "covariance.csv"] {
        let bytes = fs::read(results.0.join(name)).unwrap();
        fresh.insert(Path::new("golden").join(name), bytes);
    }
    assert_committed("wall", &fresh);
}

#[test]
fn the_board_is_what_this_tree_makes() {
    let scratch = Scratch::new("board");
    write_board_set(&BoardSetSpec::small(8, 2000), &scratch.0).unwrap();
    assert_committed("board", &files(&scratch.0));
}
