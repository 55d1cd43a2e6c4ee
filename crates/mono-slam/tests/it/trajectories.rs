//! Trajectories as other tools and tired people write them, compared by `mono-slam eval`.

use crate::commands::{Scratch, assert_refused, code, mono_slam, stderr, stdout};

/// An arc of 20 poses at 10 Hz from `start_s`, moved along y, one line a pose.
fn arc(start_s: f64, offset_y: f64, line: impl Fn(f64, [f64; 3], [f64; 4]) -> String) -> String {
    (0..20)
        .map(|k| {
            let turn = 0.1 * f64::from(k);
            let (half_sin, half_cos) = (0.5 * turn).sin_cos();
            line(
                start_s + turn,
                [turn.sin(), 1.0 - turn.cos() + offset_y, 0.0],
                [0.0, 0.0, half_sin, half_cos],
            )
        })
        .collect()
}

fn tum(t: f64, [x, y, z]: [f64; 3], [qx, qy, qz, qw]: [f64; 4]) -> String {
    format!("{t} {x} {y} {z} {qx} {qy} {qz} {qw}\n")
}

/// Root mean square position and rotation error as printed; `None` where it is left out.
fn errors(arguments: &[&str]) -> (f64, Option<f64>, String) {
    let mut all = vec!["eval"];
    all.extend(arguments);
    all.push("--json");
    let output = mono_slam(&all);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let value: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    (
        value["ate"]["translation_m"]["rmse"].as_f64().unwrap(),
        value["ate"]["rotation_rad"]["rmse"].as_f64(),
        stderr(&output),
    )
}

#[test]
fn regress_times_that_do_not_meet_are_explained() {
    let scratch = Scratch::new();
    let reference = scratch.file("reference.tum", &arc(100.0, 0.0, tum));
    let nanoseconds = scratch.file(
        "ns.tum",
        &arc(100.0, 0.0, |t, p, q| tum((t * 1e9).round(), p, q)),
    );
    assert_refused(
        &mono_slam(&["eval", &nanoseconds, &reference]),
        2,
        "(20 poses from 100 to 101.9 s); the times of the estimate look like nanoseconds",
    );
    let later = scratch.file("later.tum", &arc(500.0, 0.0, tum));
    assert_refused(
        &mono_slam(&["eval", &later, &reference]),
        2,
        "the two do not overlap in time and have 398.100 s between them: another clock?; see --time-offset",
    );
    let (rmse, _, _) = errors(&[&later, &reference, "--time-offset", "-400"]);
    assert!(rmse < 1e-9, "{rmse}");
    // Thirty milliseconds beside: the message names the option, and the option helps.
    let beside = scratch.file("beside.tum", &arc(100.03, 0.0, tum));
    assert_refused(
        &mono_slam(&["eval", &beside, &reference]),
        2,
        "the nearest two are 0.030 s apart; see --time-offset and --max-time-difference",
    );
    let (rmse, _, _) = errors(&[&beside, &reference, "--max-time-difference", "0.05"]);
    assert!(rmse < 1e-9, "{rmse}");
}

#[test]
fn regress_stamps_since_1970_in_nanoseconds_are_seconds_with_a_note() {
    let scratch = Scratch::new();
    let start = 1_400_000_000.0;
    let reference = scratch.file("reference.tum", &arc(start, 0.0, tum));
    let estimate = scratch.file(
        "ns.tum",
        &arc(start, 0.01, |t, p, q| tum((t * 1e9).round(), p, q)),
    );
    let (rmse, _, notes) = errors(&[&estimate, &reference]);
    assert!((rmse - 0.01).abs() < 1e-9, "{rmse}");
    assert!(notes.contains("are taken for nanoseconds"), "{notes}");
}

#[test]
fn regress_a_scalar_first_quaternion_was_read_as_x_first() {
    let scratch = Scratch::new();
    let estimate = scratch.file("estimate.tum", &arc(1_400_000_000.0, 0.02, tum));
    let mocap = |t: f64, [x, y, z]: [f64; 3], [qx, qy, qz, qw]: [f64; 4]| {
        format!("{},{x},{y},{z},{qw},{qx},{qy},{qz}\n", (t * 1e9).round())
    };
    let header = "#timestamp [ns], p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], q_RS_y [], q_RS_z []";
    let table = scratch.file(
        "mocap.csv",
        &format!("{header}\n{}", arc(1_400_000_000.0, 0.0, mocap)),
    );
    let (position, rotation, _) = errors(&[&estimate, &table]);
    assert!((position - 0.02).abs() < 1e-6, "{position}");
    assert!(rotation.unwrap() < 1e-6, "{rotation:?}");
    // EuRoC's seventeen columns likewise.
    let wide = format!(
        "{header}, v_RS_R_x [m s^-1], v_RS_R_y [m s^-1]\n{}",
        arc(1_400_000_000.0, 0.0, |t, p, q| format!(
            "{},0,0\n",
            mocap(t, p, q).trim()
        ))
    );
    let wide = scratch.file("state.csv", &wide);
    assert!(errors(&[&estimate, &wide]).1.unwrap() < 1e-6);
    // This program's own table of a reference.
    let planar = arc(1_400_000_000.0, 0.0, |t, [x, y, _], [_, _, z, w]| {
        format!("0,{t},{x},{y},{}\n", 2.0 * z.atan2(w))
    });
    let planar = scratch.file(
        "planar.csv",
        &format!("frame,t_s,x_m,y_m,phi_rad\n{planar}"),
    );
    assert!(errors(&[&estimate, &planar]).1.unwrap() < 1e-6);
}

#[test]
fn regress_rows_that_evo_takes_are_taken() {
    let scratch = Scratch::new();
    let estimate = scratch.file("estimate.tum", &arc(0.0, 0.02, tum));
    // A stamp twice, a hole of NaN, quaternions of another length, positions alone, zeros in place of a rotation.
    let good = arc(0.0, 0.0, tum);
    let first = good.lines().next().unwrap();
    let twice = scratch.file("twice.tum", &format!("{first}\n{good}"));
    let (rmse, _, notes) = errors(&[&estimate, &twice]);
    assert!(
        (rmse - 0.02).abs() < 1e-9 && notes.contains("1 poses repeat the time"),
        "{notes}"
    );
    let hole = scratch.file(
        "hole.tum",
        &format!("{good}2.0 NaN NaN NaN NaN NaN NaN NaN\n"),
    );
    let (rmse, _, notes) = errors(&[&estimate, &hole]);
    assert!(
        (rmse - 0.02).abs() < 1e-9 && notes.contains("1 lines with NaN are left out"),
        "{notes}"
    );
    let long = scratch.file(
        "long.tum",
        &arc(0.0, 0.0, |t, p, q| tum(t, p, q.map(|v| 1.1 * v))),
    );
    let (_, rotation, notes) = errors(&[&estimate, &long]);
    assert!(
        rotation.unwrap() < 1e-7 && notes.contains("length 1.1000 to 1.1000 are normalised"),
        "{notes}"
    );
    for (name, text) in [
        ("zero.tum", arc(0.0, 0.0, |t, p, _| tum(t, p, [0.0; 4]))),
        (
            "places.txt",
            arc(0.0, 0.0, |t, [x, y, z], _| format!("{t} {x} {y} {z}\n")),
        ),
    ] {
        let places = scratch.file(name, &text);
        let (rmse, rotation, notes) = errors(&[&estimate, &places]);
        assert!((rmse - 0.02).abs() < 1e-9 && rotation.is_none(), "{name}");
        assert!(notes.contains("rotations are not"), "{notes}");
        let text = stdout(&mono_slam(&["eval", &estimate, &places]));
        assert!(
            text.contains("ATE position") && !text.contains("rotation"),
            "{text}"
        );
    }
    let back = scratch.file("back.tum", &format!("{good}{first}\n"));
    assert_refused(
        &mono_slam(&["eval", &estimate, &back]),
        2,
        "back.tum, line 21: expected a time of 1.9",
    );
    let kitti = scratch.file("kitti.txt", "1 0 0 0 0 1 0 0 0 0 1 0\n");
    assert_refused(
        &mono_slam(&["eval", &kitti, &estimate]),
        2,
        "the pose of KITTI, which has no time",
    );
}

#[test]
fn regress_a_relative_error_that_cannot_be_had_is_left_out() {
    let scratch = Scratch::new();
    let estimate = scratch.file("estimate.tum", &arc(0.0, 0.02, tum));
    let sparse: String = arc(0.004, 0.0, tum)
        .lines()
        .step_by(19)
        .map(|line| format!("{line}\n"))
        .collect();
    let apart = arc(0.05, 0.0, tum);
    let reference = scratch.file(
        "reference.tum",
        &format!("{}\n{apart}", sparse.lines().next().unwrap()),
    );
    let output = mono_slam(&["eval", &estimate, &reference]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    assert!(
        stdout(&output).starts_with("1 matched poses of 20 (reference 21)"),
        "{}",
        stdout(&output)
    );
    let notes = stderr(&output);
    assert!(
        notes.contains("only 1 of 20 poses have one within 0.01 s")
            && notes.contains("no relative error"),
        "{notes}"
    );
}

#[test]
fn several_estimates_stand_in_one_table() {
    let scratch = Scratch::new();
    let reference = scratch.file("reference.tum", &arc(0.0, 0.0, tum));
    let files = [0.01, 0.02, 0.03].map(|y| scratch.file(&format!("{y}.tum"), &arc(0.0, y, tum)));
    let output = mono_slam(&["eval", &files[0], &files[1], &files[2], &reference]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let text = stdout(&output);
    assert_eq!(text.lines().count(), 6, "{text}");
    for (line, rmse) in text.lines().skip(3).zip(["0.01000", "0.02000", "0.03000"]) {
        assert!(line.contains("20 of 20") && line.contains(rmse), "{line}");
    }
    let json = stdout(&mono_slam(&[
        "eval", &files[0], &files[1], &reference, "--json",
    ]));
    let value: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert_eq!(value["estimates"].as_array().unwrap().len(), 2);
    let output = mono_slam(&[
        "eval",
        &files[0],
        &files[2],
        &reference,
        "--max-ate",
        "0.02",
    ]);
    assert_eq!(code(&output), 3);
}
