//! Results read back bit for bit, damage is noticed, and equal runs give equal bytes.

use std::fs;
use std::path::Path;

use crate::common::ScratchFolder;
use crate::common::run::{FRAMES, small_run};
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use slam_io::{
    FrameSnapshot, GreyImage, RunRecord, read_map, read_run, read_tum, run_figures, write_run,
};
use trajectory_eval::{Alignment, absolute_error, spatial};

const FILES: [&str; 9] = [
    "covariance.csv",
    "frames.csv",
    "map.ply",
    "map.slam",
    "report_data.json",
    "summary.json",
    "tracks.csv",
    "trajectory.tum",
    "trajectory_smoothed.tum",
];

/// The name of a broken value, and how to break it.
type Damage = (&'static str, fn(&mut RunRecord));

fn names(dir: &Path) -> Vec<String> {
    let mut names: Vec<String> = fs::read_dir(dir)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

#[test]
fn every_file_is_there_and_nothing_else() {
    let folder = ScratchFolder::new();
    let out = folder.path().join("deep/out");
    write_run(&small_run(), &out, &[]).unwrap();
    assert_eq!(names(&out), FILES);
    // A second run into the same folder replaces the files.
    let before = fs::read(out.join("trajectory.tum")).unwrap();
    let mut other = small_run();
    other.frames[3].report.estimate.pose.x += 1e-9;
    write_run(&other, &out, &[]).unwrap();
    assert_eq!(names(&out), FILES);
    assert_ne!(fs::read(out.join("trajectory.tum")).unwrap(), before);
}

#[test]
fn a_page_appears_with_the_results_or_not_at_all() {
    let folder = ScratchFolder::new();
    let page = ("report.html", b"<p>all is well</p>".to_vec());
    write_run(&small_run(), folder.path(), std::slice::from_ref(&page)).unwrap();
    assert_eq!(names(folder.path()).len(), FILES.len() + 1);
    assert_eq!(fs::read(folder.path().join("report.html")).unwrap(), page.1);
    let empty = ScratchFolder::new();
    let nowhere = ("no/folder.html", Vec::new());
    assert!(write_run(&small_run(), empty.path(), &[nowhere]).is_err());
    assert!(names(empty.path()).is_empty(), "nothing is left behind");
}

#[test]
fn equal_results_give_equal_bytes_whatever_the_clock_said() {
    let folder = ScratchFolder::new();
    let mut slow = small_run();
    slow.wall_s *= 10.0;
    for frame in &mut slow.frames {
        frame.times.total_ms *= 10.0;
    }
    write_run(&small_run(), &folder.path().join("a"), &[]).unwrap();
    write_run(&slow, &folder.path().join("b"), &[]).unwrap();
    for name in [
        "trajectory.tum",
        "trajectory_smoothed.tum",
        "covariance.csv",
        "map.slam",
        "map.ply",
    ] {
        let read = |side: &str| fs::read(folder.path().join(side).join(name)).unwrap();
        assert_eq!(read("a"), read("b"), "{name}");
    }
}

#[test]
fn trajectories_read_back_exactly() {
    let folder = ScratchFolder::new();
    let run = small_run();
    write_run(&run, folder.path(), &[]).unwrap();
    let poses = read_tum(&folder.path().join("trajectory.tum")).unwrap();
    assert_eq!(poses.len(), FRAMES);
    for (pose, frame) in poses.iter().zip(&run.frames) {
        assert_eq!(pose.t_s, frame.time_s);
        let position = pose.world_from_frame.translation.vector;
        assert_eq!(
            (position.x, position.y, position.z),
            (
                frame.report.estimate.pose.x,
                frame.report.estimate.pose.y,
                0.0
            )
        );
        let heading = pose.world_from_frame.rotation.euler_angles().2;
        assert!((heading - frame.report.estimate.pose.phi).abs() < 1e-15);
    }
    let smoothed = read_tum(&folder.path().join("trajectory_smoothed.tum")).unwrap();
    assert_eq!(
        smoothed[7].world_from_frame.translation.x,
        run.smoothed[7].1.x
    );
}

#[test]
fn covariances_read_back_exactly() {
    let folder = ScratchFolder::new();
    let run = small_run();
    write_run(&run, folder.path(), &[]).unwrap();
    let text = fs::read_to_string(folder.path().join("covariance.csv")).unwrap();
    let mut lines = text.lines();
    assert_eq!(lines.next(), Some("frame,t_s,xx,xy,xphi,yy,yphi,phiphi"));
    for (line, frame) in lines.zip(&run.frames) {
        let values: Vec<f64> = line.split(',').map(|cell| cell.parse().unwrap()).collect();
        let c = &frame.report.estimate.covariance;
        let expected = [
            c[(0, 0)],
            c[(0, 1)],
            c[(0, 2)],
            c[(1, 1)],
            c[(1, 2)],
            c[(2, 2)],
        ];
        assert_eq!(values[0], frame.index as f64);
        assert_eq!(values[2..], expected);
    }
}

#[test]
fn frames_csv_has_one_row_a_frame_and_empty_cells_for_none() {
    let folder = ScratchFolder::new();
    write_run(&small_run(), folder.path(), &[]).unwrap();
    let mut reader = csv::Reader::from_path(folder.path().join("frames.csv")).unwrap();
    let header = reader.headers().unwrap().clone();
    let column = |name: &str| header.iter().position(|known| known == name).unwrap();
    let rows: Vec<_> = reader.records().map(Result::unwrap).collect();
    assert_eq!(rows.len(), FRAMES);
    assert_eq!(&rows[0][column("nis")], "");
    assert_eq!(&rows[1][column("nis")], "0.92");
    assert_eq!(&rows[2][column("resampled")], "1");
    assert_eq!(
        &rows[5][column("notes")],
        "too few matches, \"odometry\" only"
    );
    assert_eq!(&rows[5][column("features_ms")], "20");
}

#[test]
fn ply_says_how_many_points_follow() {
    let folder = ScratchFolder::new();
    write_run(&small_run(), folder.path(), &[]).unwrap();
    let text = fs::read_to_string(folder.path().join("map.ply")).unwrap();
    let (header, body) = text.split_once("end_header\n").unwrap();
    assert!(header.starts_with("ply\nformat ascii 1.0\n"));
    assert!(header.contains("element vertex 5\n"));
    let properties = header
        .lines()
        .filter(|line| line.starts_with("property"))
        .count();
    assert_eq!(body.lines().count(), 5);
    assert!(
        body.lines()
            .all(|line| line.split(' ').count() == properties)
    );
}

#[test]
fn the_map_reads_back_bit_for_bit() {
    let folder = ScratchFolder::new();
    let run = small_run();
    write_run(&run, folder.path(), &[]).unwrap();
    assert_eq!(
        read_map(&folder.path().join("map.slam")).unwrap(),
        run.landmarks
    );
    let missing = read_map(Path::new("no/map.slam")).unwrap_err().to_string();
    assert!(
        missing.starts_with("no/map.slam: cannot be read: "),
        "{missing}"
    );
}

#[test]
fn a_run_reads_back() {
    let folder = ScratchFolder::new();
    let run = small_run();
    write_run(&run, folder.path(), &[]).unwrap();
    let back = read_run(folder.path()).unwrap();
    assert_eq!(back.landmarks, run.landmarks);
    assert_eq!(back.snapshots, run.snapshots);
    assert_eq!(back.configuration, run.configuration);
    assert_eq!(back.frames.len(), run.frames.len());
    assert_eq!(back.frames[5].report.notes, run.frames[5].report.notes);
    assert!(
        (back.frames[5].report.estimate.pose.x - run.frames[5].report.estimate.pose.x).abs()
            < 1e-15
    );
}

/// Earlier versions kept eight large pictures as PNG, with the keypoints in full.
#[test]
fn pictures_of_earlier_versions_are_read() {
    let folder = ScratchFolder::new();
    let mut run = small_run();
    run.snapshots.clear();
    write_run(&run, folder.path(), &[]).unwrap();
    let path = folder.path().join("report_data.json");
    let image = GreyImage {
        width: 16,
        height: 8,
        pixels: (0..128).collect(),
    };
    let png = STANDARD.encode(image.png().unwrap());
    let earlier = format!(
        "\"snapshots\":[{{\"index\":4,\"png_base64\":\"{png}\",\"keypoints\":[{{\"x\":3.5,\"y\":2.3,\"sigma\":1.6,\
         \"fate\":\"Matched\",\"predicted\":[4.0,2.0]}},{{\"x\":9.0,\"y\":5.0,\"sigma\":2.0,\"fate\":\"New\",\"predicted\":null}}]}}]"
    );
    let text = fs::read_to_string(&path).unwrap();
    assert!(text.contains("\"pictures\":[]"));
    fs::write(&path, text.replace("\"pictures\":[]", &earlier)).unwrap();
    assert_eq!(
        read_run(folder.path()).unwrap().snapshots,
        small_run().snapshots
    );
}

/// Whatever a run is long, its pictures are bounded in number and in size, and small runs have all of them.
#[test]
fn pictures_of_a_run_are_bounded() {
    let image = GreyImage {
        width: 640,
        height: 480,
        pixels: (0..640 * 480_usize)
            .map(|k| (((k % 640) / 16 * 7 + k / 640 / 16 * 13) % 251) as u8)
            .collect(),
    };
    let mut sizes = Vec::new();
    for frames in [1, 20, 240, 241, 10_000] {
        let kept = (0..frames)
            .filter(|&k| FrameSnapshot::is_kept(k, frames))
            .count();
        assert!(
            kept == frames || (frames > 240 && (120..=240).contains(&kept)),
            "{kept}"
        );
        let snapshot = FrameSnapshot::of_image(0, frames, &image);
        assert!(kept * snapshot.jpeg.len() < 320_000, "{frames}");
        sizes.push(snapshot.jpeg.len());
    }
    assert!(sizes[0] > 4 * sizes[2], "{sizes:?}");
}

#[test]
fn damaged_report_data_is_an_error() {
    let folder = ScratchFolder::new();
    write_run(&small_run(), folder.path(), &[]).unwrap();
    let path = folder.path().join("report_data.json");
    let text = fs::read_to_string(&path).unwrap();
    let fault = |text: &str| {
        fs::write(&path, text).unwrap();
        read_run(folder.path()).unwrap_err().to_string()
    };
    assert!(fault(&text[..text.len() / 2]).contains("expected the data of a finished run"));
    let newer = text.replace("\"format_version\":1", "\"format_version\":2");
    assert!(fault(&newer).contains("expected format version 1, found 2"));
    let foreign = text.replace("\"jpeg_base64\":\"", "\"jpeg_base64\":\"??");
    assert!(fault(&foreign).contains("expected a picture of frame 4"));
}

#[test]
fn a_result_that_is_not_finite_is_refused_before_anything_is_written() {
    let folder = ScratchFolder::new();
    let out = folder.path().join("out");
    let damages: [Damage; 5] = [
        ("time or pose of frame 3", |run| {
            run.frames[3].report.estimate.pose.phi = f64::NAN;
        }),
        ("covariance of frame 2", |run| {
            run.frames[2].report.estimate.covariance[(1, 2)] = f64::INFINITY;
        }),
        ("landmark 6", |run| {
            run.landmarks[2].position.z = f64::NAN;
        }),
        ("pose 4 of the smoothed path", |run| {
            run.smoothed[4].1.y = f64::NAN;
        }),
        ("pose 1 of dead reckoning", |run| {
            run.dead_reckoning[1].y = f64::NEG_INFINITY;
        }),
    ];
    for (what, damage) in damages {
        let mut run = small_run();
        damage(&mut run);
        let message = write_run(&run, &out, &[]).unwrap_err().to_string();
        assert_eq!(
            message,
            format!("results are not written: {what} is not finite")
        );
        assert!(!out.exists());
    }
}

#[test]
fn a_folder_that_cannot_be_made_is_named() {
    let folder = ScratchFolder::new();
    let file = folder.path().join("file");
    fs::write(&file, "").unwrap();
    let message = write_run(&small_run(), &file.join("out"), &[])
        .unwrap_err()
        .to_string();
    assert!(
        message.contains("file/out: cannot be created: "),
        "{message}"
    );
}

#[test]
fn the_summary_tells_the_errors_of_all_three_paths() {
    let folder = ScratchFolder::new();
    let run = small_run();
    write_run(&run, folder.path(), &[]).unwrap();
    let text = fs::read_to_string(folder.path().join("summary.json")).unwrap();
    let summary: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert_eq!(summary["seed"], 7);
    assert_eq!(summary["version"], env!("CARGO_PKG_VERSION"));
    assert_eq!(summary["configuration"], run.configuration);
    assert_eq!(
        summary["figures"]["notes"]["too few matches, \"odometry\" only"],
        1
    );
    let errors = &summary["figures"]["errors"];
    let rmse = |path: &str, alignment: &str| {
        errors[path][alignment]["position_m"]["rmse"]
            .as_f64()
            .unwrap()
    };
    // The mean of k^2 for k = 0..11 is 11 * 23 / 6.
    let mean_square: f64 = 11.0 * 23.0 / 6.0;
    assert!((rmse("filtered", "none") - 0.001 * mean_square.sqrt()).abs() < 1e-12);
    assert!((rmse("dead_reckoning", "none") - 0.01 * mean_square.sqrt()).abs() < 1e-12);
    assert!(rmse("smoothed", "none") < 1e-15);
    assert!(rmse("dead_reckoning", "se2") < rmse("dead_reckoning", "none"));
    let filtered: Vec<_> = run
        .frames
        .iter()
        .map(|frame| (frame.time_s, frame.report.estimate.pose))
        .collect();
    let reference = run.reference.unwrap();
    let aligned =
        absolute_error(&spatial(&filtered), &spatial(&reference), Alignment::Se2).unwrap();
    assert!((rmse("filtered", "se2") - aligned.translation_m.rmse).abs() < 1e-15);
}

#[test]
fn figures_of_an_empty_run_are_none_and_it_can_be_written() {
    let mut run = small_run();
    run.frames.clear();
    run.smoothed.clear();
    run.landmarks.clear();
    run.dead_reckoning.clear();
    run.snapshots.clear();
    let figures = run_figures(&run);
    assert_eq!(
        (figures.frames, figures.matches_mean, figures.n_eff_min),
        (0, None, None)
    );
    let folder = ScratchFolder::new();
    write_run(&run, folder.path(), &[]).unwrap();
    run.reference = None;
    write_run(&run, folder.path(), &[]).unwrap();
    assert_eq!(read_run(folder.path()).unwrap().reference, None);
}

/// A batch or a page that an earlier drive left beside these results would be believed.
#[test]
fn regress_files_of_an_earlier_run_stayed() {
    let folder = ScratchFolder::new();
    let page = ("report.html", b"<p>first</p>".to_vec());
    write_run(&small_run(), folder.path(), &[page]).unwrap();
    for later in [
        "batch.json",
        "covariance_batch.csv",
        "trajectory_batch.tum",
        "notes of mine.txt",
    ] {
        fs::write(folder.path().join(later), "first").unwrap();
    }
    write_run(&small_run(), folder.path(), &[]).unwrap();
    let mut expected: Vec<String> = FILES.iter().map(|name| (*name).to_owned()).collect();
    expected.push("notes of mine.txt".into());
    expected.sort();
    assert_eq!(names(folder.path()), expected);
}

#[test]
#[cfg(unix)]
fn regress_a_result_that_is_a_link_was_replaced() {
    let folder = ScratchFolder::new();
    let out = folder.path().join("out");
    fs::create_dir(&out).unwrap();
    std::os::unix::fs::symlink("../elsewhere.tum", out.join("trajectory.tum")).unwrap();
    write_run(&small_run(), &out, &[]).unwrap();
    assert!(
        fs::symlink_metadata(out.join("trajectory.tum"))
            .unwrap()
            .is_symlink()
    );
    assert_eq!(
        read_tum(&folder.path().join("elsewhere.tum"))
            .unwrap()
            .len(),
        FRAMES
    );
    // A folder under the name of a result is refused before anything is written.
    let other = folder.path().join("other");
    fs::create_dir_all(other.join("map.slam")).unwrap();
    let message = write_run(&small_run(), &other, &[])
        .unwrap_err()
        .to_string();
    assert!(
        message.contains("map.slam: results cannot go there: a folder is there"),
        "{message}"
    );
    assert_eq!(names(&other), ["map.slam"]);
}
