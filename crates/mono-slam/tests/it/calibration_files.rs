//! Calibration of the board fixture from its files: the same on any number of threads, with a page that stands alone.

use camera_calibration::{BoardSize, CalibrateError, CalibrationRun, CalibrationSettings, Outcome};
use mono_geometry::calibration::LensModel;
use mono_slam::calibrate::calibrate_files;
use slam_io::{CalibrationRequest, camera_toml, image_files, read_calibration, read_grey};
use slam_report::render_calibration_html;
use std::path::PathBuf;

const SETTINGS: CalibrationSettings = CalibrationSettings {
    board: BoardSize {
        columns: 9,
        rows: 6,
    },
    square_m: 0.04,
    model: LensModel::RadtanK3,
};

/// A folder that goes away.
struct Scratch(PathBuf);

impl Scratch {
    fn new(name: &str) -> Scratch {
        let path =
            std::env::temp_dir().join(format!("mono-slam-board-{}-{name}", std::process::id()));
        std::fs::create_dir_all(&path).unwrap();
        Scratch(path)
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        // Leaving a folder behind is no reason to fail a test.
        drop(std::fs::remove_dir_all(&self.0));
    }
}

fn fixture() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/board")
}

fn calibrated(folder: &std::path::Path) -> CalibrationRun {
    let files = image_files(&[folder.join("images")]).unwrap();
    calibrate_files(&files, &SETTINGS, &|| {}).unwrap()
}

#[test]
fn the_fixture_is_calibrated_the_same_on_any_number_of_threads() {
    let run = calibrated(&fixture());
    assert_eq!(run.calibration.views.len(), run.images.len());
    assert!(run.calibration.rms_px < 0.1, "{}", run.calibration.rms_px);
    for threads in [1, 3] {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        assert_eq!(
            pool.install(|| calibrated(&fixture())),
            run,
            "{threads} threads"
        );
    }
    let text = camera_toml(&run).unwrap();
    let folder = Scratch::new("toml");
    let file = folder.0.join("camera.toml");
    std::fs::write(&file, &text).unwrap();
    let read = read_calibration(&file, &CalibrationRequest::default())
        .unwrap()
        .camera
        .camera_and_mount()
        .unwrap()
        .0;
    assert_eq!(read, run.calibration.camera);
    let fx = run.calibration.parameter("fx").unwrap();
    assert!(
        text.contains(&format!("fx = {}   # +- ", fx.value)),
        "{text}"
    );
    assert!(
        text.contains("from 8 of 8 images") && text.contains("model = \"radtan\""),
        "{text}"
    );
}

#[test]
fn the_page_stands_alone_and_names_every_image() {
    let run = calibrated(&fixture());
    let files = image_files(&[fixture().join("images")]).unwrap();
    let page = render_calibration_html(&run, &|image| read_grey(&files[image]).ok());
    for image in &run.images {
        assert!(page.contains(&image.name));
    }
    assert!(page.contains("data:image/png;base64,") && page.contains("fits worst"));
    // Pictures as text may hold any letters.
    let mut parts = page.split("base64,");
    let mut words = parts
        .next()
        .unwrap()
        .replace("http://www.w3.org/2000/svg", "");
    for part in parts {
        words.push_str(&part[part.find('"').unwrap()..].replace("http://www.w3.org/2000/svg", ""));
    }
    for foreign in ["http://", "https://", "<script", "NaN", "inf "] {
        assert!(!words.contains(foreign), "{foreign}");
    }
    let without = render_calibration_html(&run, &|_| None);
    assert!(!without.contains("data:image") && without.ends_with("</html>\n"));
}

#[test]
fn images_that_do_not_serve_are_named_with_the_reason() {
    let folder = Scratch::new("mixed");
    let mut files = image_files(&[fixture().join("images")]).unwrap();
    let broken = folder.0.join("broken.png");
    std::fs::write(&broken, b"no image").unwrap();
    let other = folder.0.join("other.png");
    image::GrayImage::from_pixel(100, 90, image::Luma([50]))
        .save(&other)
        .unwrap();
    let blank = folder.0.join("blank.png");
    image::GrayImage::from_pixel(320, 240, image::Luma([50]))
        .save(&blank)
        .unwrap();
    files.extend([broken, other, blank, folder.0.join("missing.png")]);
    let run = calibrate_files(&files, &SETTINGS, &|| {}).unwrap();
    assert_eq!(run.calibration.views.len(), 8);
    let reasons: Vec<String> = run
        .images
        .iter()
        .filter_map(|image| image.reason())
        .collect();
    assert!(reasons[0].contains("expected a whole image"), "{reasons:?}");
    assert_eq!(run.images[9].outcome, Outcome::OtherSize(100, 90));
    assert_eq!(reasons[2], "no corner of a checkerboard");
    assert!(reasons[3].contains("cannot be read"), "{reasons:?}");

    let few = [files[0].clone(), files[1].clone(), files[10].clone()];
    let error = calibrate_files(&few, &SETTINGS, &|| {}).unwrap_err();
    assert!(matches!(
        error,
        CalibrateError::TooFewBoards {
            found: 2,
            images: 3,
            ..
        }
    ));
    assert_eq!(
        error.to_string(),
        "2 boards in 3 images, required: at least 3 (blank.png: no corner of a checkerboard)"
    );
}
