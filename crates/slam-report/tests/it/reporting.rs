//! The page stands alone, is well formed, hides nothing dangerous and stays small.

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use nalgebra::{Matrix3, Vector3};
use serde_json::Value;
use slam_io::{DrawnKeypoint, FrameSnapshot, GreyImage, RunRecord, read_run, write_run};
use slam_pipeline::{KeypointFate, MapLandmark, Tracking};
use slam_report::render_run_html;

use crate::run::{FRAMES, small_run};

/// Elements that HTML does not close.
const VOID: [&str; 3] = ["meta", "input", "!DOCTYPE"];

/// Checks that every element is closed in order; attribute values must not hold `<` or `>`.
fn assert_well_formed(page: &str) {
    let mut open: Vec<&str> = Vec::new();
    let mut rest = page;
    while let Some(start) = rest.find('<') {
        let end = start + rest[start..].find('>').unwrap();
        let tag = &rest[start + 1..end];
        assert!(!tag.contains('<'), "{tag}");
        assert_eq!(tag.matches('"').count() % 2, 0, "{tag}");
        rest = &rest[end + 1..];
        let name = tag
            .trim_start_matches('/')
            .split([' ', '\n', '/'])
            .next()
            .unwrap();
        if tag.starts_with('/') {
            assert_eq!(open.pop(), Some(name));
        } else if name == "style" || name == "script" {
            rest = &rest[rest.find(&format!("</{name}>")).unwrap()..];
            open.push(name);
        } else if !tag.ends_with('/') && !VOID.contains(&name) {
            open.push(name);
        }
    }
    assert!(open.is_empty(), "left open: {open:?}");
}

fn assert_stands_alone(page: &str) {
    for foreign in [
        "<link",
        "<iframe",
        "@import",
        "javascript:",
        " src=",
        " onload=",
    ] {
        assert!(!page.contains(foreign), "{foreign}");
    }
    let without_namespaces = page.replace("http://www.w3.org/2000/svg", "");
    assert!(!without_namespaces.contains("http"), "an address");
    let own = |starts: &[&str], kind: &str| {
        let mut tails = page.split(kind).skip(1);
        tails.all(|tail| starts.iter().any(|start| tail.starts_with(start)))
    };
    assert!(
        own(&["#clip-", "#ring-"], "url("),
        "url() of something else than a clip path or a ring"
    );
    assert!(
        own(
            &[" type=\"application/json\" id=\"run-data\">", ">\n"],
            "<script"
        ),
        "a script from elsewhere"
    );
    assert!(
        own(&["data:image/jpeg;base64,"], "href=\""),
        "href of something else than an inline picture"
    );
}

#[test]
fn the_page_is_well_formed_and_stands_alone() {
    let page = render_run_html(&small_run());
    assert!(page.starts_with("<!DOCTYPE html>"));
    assert_well_formed(&page);
    assert_stands_alone(&page);
    for part in [
        "Bird’s-eye view",
        "Error against the reference",
        "±3σ of the filter",
        "distinct ancestors",
        "normalised innovation squared",
        "Time per frame",
        "What the camera saw",
        "0.03333 ± 0.00100 (before: 0 ± 0.002)",
        "dead reckoning",
        "prefers-color-scheme: dark",
    ] {
        assert!(page.contains(part), "{part}");
    }
}

#[test]
fn text_from_the_input_is_escaped() {
    let mut run = small_run();
    run.method = "<b>novel</b>".into();
    let page = render_run_html(&run);
    assert_well_formed(&page);
    assert_stands_alone(&page);
    assert!(page.contains("<h1>small &lt;run&gt; &amp; &quot;test&quot;</h1>"));
    assert!(page.contains("# &lt;script&gt;alert(1)&lt;/script&gt;"));
    assert!(page.contains("too few matches, &quot;odometry&quot; only"));
    assert!(page.contains("&lt;b&gt;novel&lt;/b&gt;"));
}

#[test]
fn without_a_reference_there_are_no_errors() {
    let mut run = small_run();
    run.reference = None;
    let page = render_run_html(&run);
    assert_well_formed(&page);
    assert!(!page.contains("Error against the reference"));
    assert!(page.contains("no reference to compare with"));
    // A reference of another time is as good as none.
    run.reference = Some(vec![(1e6, run.frames[0].report.estimate.pose)]);
    assert!(!render_run_html(&run).contains("Error against the reference"));
}

#[test]
fn odd_runs_have_a_page_too() {
    let damages: [fn(&mut RunRecord); 7] = [
        |run| run.frames.clear(),
        |run| run.frames.truncate(1),
        |run| run.landmarks.clear(),
        |run| run.snapshots.clear(),
        |run| run.dead_reckoning.clear(),
        |run| {
            for frame in &mut run.frames {
                frame.report.keyframe = false;
            }
        },
        |run| run.particles = 0,
    ];
    for damage in damages {
        let mut run = small_run();
        damage(&mut run);
        assert_well_formed(&render_run_html(&run));
    }
}

#[test]
fn values_that_are_not_finite_are_left_out() {
    let mut run = small_run();
    run.frames[3].report.estimate.pose.x = f64::NAN;
    run.frames[4].report.estimate.covariance *= f64::NAN;
    run.frames[5].report.nis = Some(f64::INFINITY);
    run.frames[6].report.n_eff = f64::NAN;
    run.frames[7].times.features_ms = f64::NAN;
    run.dead_reckoning[2].y = f64::NEG_INFINITY;
    run.landmarks[1].position.x = f64::NAN;
    run.landmarks[2].covariance *= f64::NAN;
    run.snapshots[0].keypoints[0].x = f32::NAN;
    run.snapshots[0].keypoints[1].predicted = Some([f32::INFINITY, 0.0]);
    let page = render_run_html(&run);
    assert_well_formed(&page);
    for attribute in [
        " d=\"",
        " x=\"",
        " y=\"",
        " width=\"",
        " height=\"",
        " points=\"",
    ] {
        for tail in page.split(attribute).skip(1) {
            let value = tail.split('"').next().unwrap();
            assert!(
                !value.contains("NaN") && !value.contains("inf"),
                "{attribute}{value}"
            );
        }
    }
}

#[test]
fn a_frame_without_a_picture_is_left_out_of_the_strip() {
    let mut run = small_run();
    run.snapshots[0].jpeg.clear();
    assert!(!render_run_html(&run).contains("What the camera saw"));
}

#[test]
fn a_page_of_any_length_stays_below_a_megabyte() {
    for frames in [240, 357, 6000] {
        let run = long_run(frames);
        let page = render_run_html(&run);
        assert_well_formed(&page);
        assert_stands_alone(&page);
        assert!(
            page.len() < 1_000_000,
            "{frames} frames: {} bytes",
            page.len()
        );
        let shown = data(&page)["pictures"].as_array().unwrap().len();
        assert!(shown >= 60, "{frames} frames: {shown} pictures");
        assert_eq!(page.matches("<image href=\"data:image/jpeg").count(), 8);
    }
}

/// A run with a rich map, textured images and many keypoints.
fn long_run(length: usize) -> RunRecord {
    let mut run = small_run();
    let frames = run.frames.clone();
    run.frames = (0..length)
        .map(|index| {
            let mut frame = frames[index % FRAMES].clone();
            frame.index = index;
            frame.time_s = 0.1 * index as f64;
            frame.report.estimate.pose.x = 0.05 * index as f64;
            frame.report.estimate.pose.y = (0.01 * index as f64).sin();
            frame
        })
        .collect();
    run.dead_reckoning = run
        .frames
        .iter()
        .map(|frame| frame.report.estimate.pose)
        .collect();
    run.reference = Some(
        run.frames
            .iter()
            .map(|frame| (frame.time_s, frame.report.estimate.pose))
            .collect(),
    );
    run.landmarks = (0..12_000_u32)
        .map(|id| MapLandmark {
            id,
            position: Vector3::new(f64::from(id) * 0.01, f64::from(id % 97) * 0.1, 0.0),
            covariance: Matrix3::identity() * 1e-4 * f64::from(1 + id % 50),
            observations: 3,
            descriptor: None,
        })
        .collect();
    // Noise is the worst that JPEG can meet.
    let mut state = 1_u32;
    let mut noise = move || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        state >> 16
    };
    let image = GreyImage {
        width: 320,
        height: 240,
        pixels: (0..320 * 240).map(|_| (noise() >> 8) as u8).collect(),
    };
    let keypoints: Vec<DrawnKeypoint> = (0..600)
        .map(|k| DrawnKeypoint {
            x: (noise() % 3200) as f32 / 10.0,
            y: (noise() % 2400) as f32 / 10.0,
            sigma: 1.0 + (k % 5) as f32,
            fate: [KeypointFate::Matched, KeypointFate::Unused][usize::from(k % 6 == 0)],
            predicted: Some([(noise() % 320) as f32, (noise() % 240) as f32]),
        })
        .collect();
    let snapshot = FrameSnapshot::of_image(0, length, &image).with_keypoints(&keypoints);
    run.snapshots = (0..length)
        .filter(|&index| FrameSnapshot::is_kept(index, length))
        .map(|index| FrameSnapshot {
            index,
            ..snapshot.clone()
        })
        .collect();
    run
}

/// The data that the script of the page reads.
fn data(page: &str) -> Value {
    let (_, tail) = page.split_once("id=\"run-data\">").unwrap();
    serde_json::from_str(tail.split_once("</script>").unwrap().0).unwrap()
}

#[test]
fn what_is_drawn_is_what_the_record_says() {
    let mut run = small_run();
    run.frames[3].report.tracking = Tracking::Lost;
    run.frames[4].report.tracking = Tracking::Lost;
    run.frames[5].report.tracking = Tracking::Relocalised;
    run.frames[8].report.revisit = true;
    run.frames[8].report.notes = vec!["</script><b>".into()];
    let page = render_run_html(&run);
    assert_well_formed(&page);
    assert_stands_alone(&page);
    let data = data(&page);
    let rows = &data["frames"];
    for (row, frame) in run.frames.iter().enumerate() {
        assert_eq!(rows["index"][row], frame.index);
        assert_eq!(rows["keypoints"][row], frame.keypoints);
        assert_eq!(rows["matches"][row], frame.report.matches);
        assert_eq!(rows["outliers"][row], frame.report.outliers);
        assert_eq!(rows["fresh"][row], frame.report.new_landmarks);
        assert_eq!(rows["landmarks"][row], frame.report.landmarks);
    }
    assert_eq!(rows["state"], "tttllrtttttt");
    assert_eq!(rows["revisit"], "000000001000");
    assert_eq!(data["total"], FRAMES);
    assert_eq!(data["notes"][1], "</script><b>");
    assert_eq!(data["noted"]["8"][0], 1);
    // The picture of frame 4 with one keypoint matched and one that started a landmark.
    let [row, lines, header, body, keypoints] = &data["pictures"][0].as_array().unwrap()[..] else {
        panic!("five entries");
    };
    assert_eq!((row.as_u64(), lines.as_u64()), (Some(4), Some(128)));
    let bytes = |text: &Value| STANDARD.decode(text.as_str().unwrap()).unwrap();
    let header = &data["headers"][header.as_u64().unwrap() as usize];
    assert_eq!([bytes(header), bytes(body)].concat(), run.snapshots[0].jpeg);
    // Counts of unused and new; the new one lies in row 88 of its 128 (y = 5 of 8 pixels), column 152.
    let cell = 88 * 256 + 152;
    let mut expected = vec![0, 0, 1, 0];
    expected.extend(std::iter::repeat_n(255, cell / 255));
    expected.push((cell % 255) as u8);
    let keypoints = bytes(keypoints);
    assert_eq!(keypoints[..expected.len()], expected);
    for said in [">lost</span>", ">found again</span>", ">revisit</span>"] {
        // On the view from above and on each of eight charts.
        assert_eq!(page.matches(said).count(), 9, "{said}");
        assert!(!render_run_html(&small_run()).contains(said));
    }
}

#[test]
fn a_run_without_frames_has_no_script() {
    let mut run = small_run();
    run.frames.clear();
    assert!(!render_run_html(&run).contains("<script"));
    // Words alone fill the page: what needs them is left out, the page is there.
    let mut run = small_run();
    run.configuration = "x".repeat(1_000_000);
    let page = render_run_html(&run);
    assert!(!page.contains("<script") && page.contains("What the camera saw"));
}

#[test]
fn a_run_that_was_read_back_gives_the_same_page() {
    let folder = std::env::temp_dir().join(format!("mono-slam-page-{}", std::process::id()));
    let run = small_run();
    write_run(&run, &folder, &[]).unwrap();
    let back = read_run(&folder).unwrap();
    // Leaving a folder behind is no reason to fail a test.
    drop(std::fs::remove_dir_all(&folder));
    assert_eq!(render_run_html(&back), render_run_html(&run));
}

#[test]
fn warnings_stand_above_the_figures_and_are_escaped() {
    let page = render_run_html(&small_run());
    let banner = page
        .find("The odometry ends 2 s &lt;before&gt; the images.")
        .unwrap();
    assert!(banner < page.find("class=\"cards\"").unwrap());
    assert!(page.contains("<code>odometry-ends-early</code>"));
    let mut run = small_run();
    run.warnings.clear();
    assert!(!render_run_html(&run).contains("class=\"warnings\""));
}

/// Without a scale there are no metres to compare: the error is that after alignment with scale, the reference is drawn
/// in the unit of the run, and no chart shows differences of positions.
#[test]
fn a_run_without_scale_is_compared_up_to_its_scale() {
    let metric = render_run_html(&small_run());
    let mut run = small_run();
    run.scale = slam_io::RunScale::Arbitrary;
    run.dead_reckoning.clear();
    for frame in &mut run.frames {
        let pose = &mut frame.report.estimate.pose;
        (pose.x, pose.y) = (7.0 * pose.x, 7.0 * pose.y);
    }
    let page = render_run_html(&run);
    assert_well_formed(&page);
    assert!(metric.contains("Error against the reference") && metric.contains("x (m)"));
    assert!(!page.contains("Error against the reference") && !page.contains("x (m)"));
    for said in [
        "after alignment with scale",
        "Sim(2)",
        "x (units)",
        "no scale",
    ] {
        assert!(page.contains(said) && !metric.contains(said), "{said}");
    }
    let figures = slam_io::run_figures(&run);
    let filtered = &figures.errors["filtered"];
    assert_eq!(filtered.keys().copied().collect::<Vec<_>>(), ["sim2"]);
    assert!(filtered["sim2"].position_m.rmse < 0.01, "{filtered:?}");
    assert!(
        !figures.errors.contains_key("dead_reckoning")
            || figures.errors["dead_reckoning"].is_empty()
    );
}
