//! A small study gives the committed bytes, whole or in shards.

use std::fs;
use std::path::{Path, PathBuf};
use synth_eval::{Options, Outcome, merge, run};

/// The command that writes the committed file anew when a change of the filter is meant.
const AGAIN: &str = "cargo xtask synth-eval --scene wall --sequence fixtures/wall --seeds 2 --frames 6 \
    --method dead-reckoning --method exact:10 --no-batch --out out/golden, \
    then copy out/golden/results.jsonl to crates/synth-eval/tests/golden/results.jsonl";

fn here() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

/// A folder that is removed at the end.
struct Scratch(PathBuf);

impl Scratch {
    fn new(name: &str) -> Self {
        let folder = std::env::temp_dir().join(format!("synth-eval-{name}-{}", std::process::id()));
        fs::create_dir_all(&folder).expect("a temporary folder");
        Self(folder)
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.join(name)
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        // Leaving a folder behind is no reason to fail a test.
        drop(fs::remove_dir_all(&self.0));
    }
}

fn small_study(out: &Path, shard: (u32, u32)) -> Outcome {
    let options = Options {
        scenes: vec!["wall".into()],
        sequences: vec![here().join("../../fixtures/wall")],
        frames: Some(6),
        seeds: Some((1, 2)),
        methods: vec!["dead-reckoning".into(), "exact:10".into()],
        shard: Some(shard),
        out: out.to_path_buf(),
        ..Options::default()
    };
    run(&options, &|_| {}).expect("a small study runs")
}

#[test]
fn the_shards_of_a_small_study_merge_to_the_committed_bytes() {
    let scratch = Scratch::new("golden");
    let shards: Vec<PathBuf> = (1..=2)
        .map(|shard| {
            let out = scratch.path(&format!("shard{shard}"));
            small_study(&out, (shard, 2));
            out.join("results.jsonl")
        })
        .collect();
    // The order of the files does not matter.
    let files = [shards[1].clone(), shards[0].clone()];
    let golden = here().join("tests/golden/results.jsonl");
    let out = scratch.path("whole");
    let outcome = merge(&files, Some(&golden), &out).unwrap();
    let found = fs::read_to_string(out.join("results.jsonl")).unwrap();
    let expected = fs::read_to_string(&golden).unwrap();
    assert!(
        found == expected,
        "other results than the committed ones; if that is meant: {AGAIN}\n{found}\n{expected}"
    );
    // Against itself nothing is worse, and two seeds are not judged.
    assert_eq!(outcome.worse, 0);
    assert!(outcome.text.contains("Too few pairs"), "{}", outcome.text);
    let times = fs::read_to_string(scratch.path("shard1/times.jsonl")).unwrap();
    assert!(times.contains("frame_ms") && !found.contains("_ms\""));
}

#[test]
fn a_study_that_got_worse_says_so() {
    let scratch = Scratch::new("worse");
    let golden = fs::read_to_string(here().join("tests/golden/results.jsonl")).unwrap();
    let line = golden
        .lines()
        .find(|line| line.contains("exact 10"))
        .unwrap();
    let mut value: serde_json::Value = serde_json::from_str(line).unwrap();
    let mut write = |name: &str, position_rmse_m: f64| {
        let mut text = String::new();
        for seed in 1..=5 {
            value["seed"] = seed.into();
            value["position_rmse_m"] = (position_rmse_m + 0.001 * f64::from(seed)).into();
            text += &format!("{value}\n");
        }
        fs::write(scratch.path(name), text).unwrap();
        scratch.path(name)
    };
    let (old, new) = (write("old.jsonl", 0.010), write("new.jsonl", 0.012));
    let forward = merge(std::slice::from_ref(&new), Some(&old), &scratch.path("a")).unwrap();
    assert_eq!(forward.worse, 1, "{}", forward.text);
    assert!(
        forward
            .text
            .contains("change +2.00 [+2.00, +2.00] over 5 pairs")
    );
    assert_eq!(
        merge(&[old], Some(&new), &scratch.path("b")).unwrap().worse,
        0
    );
    let message = merge(&[scratch.path("none")], None, &scratch.path("c")).unwrap_err();
    assert!(message.to_string().contains("none"));
}
