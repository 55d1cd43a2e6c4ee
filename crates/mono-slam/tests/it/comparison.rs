//! The page of two runs.

use std::fs;
use std::path::Path;

use crate::commands::{Scratch, assert_refused, code, mono_slam, stderr};

#[test]
fn two_runs_are_drawn_on_one_page() {
    let scratch = Scratch::new();
    let sequence = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/wall");
    let sequence = sequence.to_str().unwrap();
    let folders =
        ["ten", "twelve"].map(|name| scratch.path().join(name).to_str().unwrap().to_owned());
    for (folder, particles) in folders.iter().zip(["10", "12"]) {
        let output = mono_slam(&[
            "run",
            sequence,
            "--out",
            folder,
            "--particles",
            particles,
            "--quiet",
        ]);
        assert_eq!(code(&output), 0, "{}", stderr(&output));
    }
    let page_file = scratch.path().join("page.html");
    let out = page_file.to_str().unwrap();
    let output = mono_slam(&["compare", &folders[0], &folders[1], "--out", out]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let page = fs::read_to_string(&page_file).unwrap();
    for part in [
        "<h1>ten and twelve</h1>",
        "Two runs over the sequence <b>wall</b>",
        "<th>Particles</th><td>10</td><td>12</td>",
        "Filtered path: position error (RMSE)",
        "Distance to the reference",
        "Distance between the two paths",
        "Reported uncertainty of the position",
        "filter.particles = 10",
        "filter.particles = 12",
    ] {
        assert!(page.contains(part), "{part}");
    }
    assert!(
        !page.contains("NaN") && !page.contains("inf"),
        "numbers that are none"
    );
    assert!(
        !page.contains("filter.seed ="),
        "what is equal is not listed"
    );
    assert_refused(
        &mono_slam(&["compare", &folders[0], "no/such/run", "--out", out]),
        2,
        "no/such/run: no finished run: expected the folder that `mono-slam run SEQUENCE --out DIR` wrote, found nothing there",
    );
}
