//! Images of a sequence: found, ordered, whole; missing pieces are named.

use std::fs;
use std::path::Path;

use crate::common::sequence::{CAMERA, fault, good, names_of, with};
use image::{GrayImage, Luma, Rgb, RgbImage};
use slam_io::{OpenOptions, Sequence, SequenceFormat, Survey};

#[test]
fn colour_becomes_luma() {
    let folder = good();
    let green = RgbImage::from_pixel(8, 6, Rgb([0, 255, 0]));
    green.save(folder.path().join("images/000000.png")).unwrap();
    let grey = Sequence::open(folder.path())
        .unwrap()
        .load_image(0)
        .unwrap();
    assert!((170..=190).contains(&grey.pixels[0]), "{}", grey.pixels[0]);
}

#[test]
fn wrong_images_are_named() {
    let message = fault(with("images/000001.PNG", "hello"));
    assert!(
        message.starts_with("SEQ/images/000001.PNG: expected a whole image, found "),
        "{message}"
    );
    let message = fault(|root| {
        GrayImage::new(6, 8)
            .save(root.join("images/000000.png"))
            .unwrap();
    });
    assert_eq!(
        message,
        "SEQ/images/000000.png: expected 8x6 pixels as camera.toml says, found 6x8"
    );
}

/// Takes bytes off the end of a file.
fn cut(path: &Path, bytes: usize) {
    let contents = fs::read(path).unwrap();
    fs::write(path, &contents[..contents.len() - bytes]).unwrap();
}

#[test]
fn regress_a_cut_image_is_found_before_the_run() {
    // It was found when it was decoded, after the frames before it had been worked on for nothing.
    let message = fault(|root| cut(&root.join("images/000001.PNG"), 20));
    assert!(
        message.starts_with("SEQ/images/000001.PNG: expected a whole image, found "),
        "{message}"
    );
    let message = fault(with("images/000002.jpg", ""));
    assert_eq!(
        message,
        "SEQ/images/000002.jpg: expected a whole image, found an empty file"
    );
}

#[test]
fn regress_the_frames_before_a_cut_last_image_are_kept() {
    let folder = good();
    fs::remove_file(folder.path().join("images/000003.jpeg")).unwrap();
    let last = folder.path().join("images/000003.png");
    GrayImage::from_pixel(8, 6, Luma([120]))
        .save(&last)
        .unwrap();
    cut(&last, 20);
    let sequence = Sequence::open(folder.path()).unwrap();
    assert_eq!((sequence.images.len(), sequence.times_s.len()), (3, 3));
    assert_eq!(
        names_of(&sequence.warnings),
        ["last-image-cut", "images-without-contrast"]
    );
    let message = &sequence.warnings[0].message;
    assert!(
        message.contains("000003.png") && message.contains("the 3 before it are used"),
        "{message}"
    );
}

#[test]
fn missing_parts_are_named() {
    let none = Sequence::open(Path::new("no/such/folder"))
        .unwrap_err()
        .to_string();
    assert_eq!(
        none,
        "no/such/folder: expected a sequence folder, found nothing"
    );
    for (name, holds) in [
        ("times.txt", "the time of every image in seconds"),
        ("camera.toml", "the calibration of the camera"),
        ("odometry.csv", "the speeds of the robot"),
        ("images", "the images, one file per frame"),
    ] {
        let message = fault(|root| {
            let path = root.join(name);
            if path.is_dir() {
                fs::remove_dir_all(path).unwrap();
            } else {
                fs::remove_file(path).unwrap();
            }
        });
        assert!(
            message.starts_with(&format!("SEQ/{name}: not found; it holds {holds}")),
            "{message}"
        );
    }
    let message = fault(|root| {
        fs::remove_dir_all(root.join("images")).unwrap();
        fs::create_dir(root.join("images")).unwrap();
    });
    assert_eq!(
        message,
        "SEQ/images: expected at least one image (.png, .jpg, .jpeg, .pgm, .ppm, .pnm, .bmp, .tif, .tiff, .webp), \
         found an empty folder"
    );
}

/// Numbered pictures that differ, under the names.
fn with_images(root: &Path, names: &[&str]) {
    let folder = root.join("images");
    fs::remove_dir_all(&folder).unwrap();
    fs::create_dir(&folder).unwrap();
    for (index, name) in names.iter().enumerate() {
        GrayImage::from_fn(8, 6, |x, y| Luma([(32 * x + y + 3 * index as u32) as u8]))
            .save(folder.join(name))
            .unwrap();
    }
}

fn names_in(sequence: &Sequence) -> Vec<String> {
    (0..sequence.images.len())
        .map(|index| sequence.images.name(index))
        .collect()
}

#[test]
fn regress_images_are_taken_in_counting_order() {
    // 10.png came before 2.png: the wrong times for most frames, and not a word.
    let folder = good();
    with_images(folder.path(), &["2.png", "10.png", "1.png", "9.png"]);
    let sequence = Sequence::open(folder.path()).unwrap();
    assert_eq!(names_in(&sequence), ["1.png", "2.png", "9.png", "10.png"]);
}

#[test]
fn regress_folders_and_junk_are_no_images() {
    let folder = good();
    fs::create_dir(folder.path().join("images/old.png")).unwrap();
    for junk in ["._000000.png", ".DS_Store", "Thumbs.db", "desktop.ini"] {
        fs::write(folder.path().join("images").join(junk), "junk").unwrap();
    }
    assert_eq!(Sequence::open(folder.path()).unwrap().images.len(), 4);
}

#[test]
fn regress_two_files_of_one_frame_are_named() {
    let message = fault(|root| {
        with_images(root, &["0.png", "0.jpg", "1.png", "1.jpg"]);
    });
    assert_eq!(
        message,
        "SEQ/images: expected one file per frame, found 0.jpg beside 0.png (2 such pairs): keep one of the two kinds"
    );
}

#[test]
fn regress_all_common_formats_are_read() {
    let folder = good();
    let names = ["0.pgm", "1.bmp", "2.tiff", "3.webp"];
    with_images(folder.path(), &names);
    let sequence = Sequence::open(folder.path()).unwrap();
    for (index, name) in names.iter().enumerate() {
        let grey = sequence.load_image(index).unwrap();
        assert_eq!(grey.pixels[9], 33 + 3 * index as u8, "{name}");
    }
}

#[test]
fn regress_a_folder_of_the_wrong_kind_is_named_with_its_contents() {
    let message = fault(|root| {
        fs::remove_dir_all(root.join("images")).unwrap();
        fs::create_dir(root.join("images")).unwrap();
        for index in 0..3 {
            fs::write(root.join(format!("images/{index}.raw")), "x").unwrap();
        }
        fs::write(root.join("images/notes.txt"), "x").unwrap();
    });
    assert!(
        message.ends_with("found 3 .raw files and 1 .txt file"),
        "{message}"
    );
}

#[test]
fn regress_lists_of_times_and_names_are_read() {
    // rgb.txt of TUM RGB-D and data.csv of EuRoC, put as times.txt; the first image is not listed.
    for list in [
        "# timestamp filename\n0.5 rgb/000001.PNG\n1.0 rgb/000002.jpg\n1.5 rgb/000003.jpeg\n",
        "#timestamp [s],filename\n0.5,000001.PNG\n1.0,000002.jpg\n1.5,000003.jpeg\n",
        "000001.PNG 0.5\n000002.jpg 1.0\n000003.jpeg 1.5\n",
    ] {
        let folder = good();
        fs::write(folder.path().join("times.txt"), list).unwrap();
        let sequence = Sequence::open(folder.path()).unwrap();
        assert_eq!(sequence.times_s, [0.5, 1.0, 1.5], "{list}");
        assert_eq!(
            names_in(&sequence),
            ["000001.PNG", "000002.jpg", "000003.jpeg"]
        );
        assert!(names_of(&sequence.warnings).contains(&"images-not-listed"));
    }
    assert_eq!(
        fault(with("times.txt", "0 a.png\n0.5 000001.PNG\n1.0 b.png\n")),
        "SEQ/times.txt: expected 3 images that are on disk, found 2 of them missing, the first is a.png"
    );
    assert_eq!(
        fault(with("times.txt", "0 000000.png\n0.5\n")),
        "SEQ/times.txt, line 2: expected a time and the name of its image, as in the lines before, found \"0.5\""
    );
}

#[test]
fn regress_times_since_1970_in_another_unit_are_converted() {
    let folder = good();
    fs::write(
        folder.path().join("times.txt"),
        "1403636579763555584\n1403636580263555584\n1403636580763555584\n1403636581263555584\n",
    )
    .unwrap();
    fs::write(
        folder.path().join("odometry.csv"),
        "t_s,v_mps,omega_radps\n1403636579700000000,0,0\n1403636580700000000,0,0\n1403636581700000000,0,0\n",
    )
    .unwrap();
    let sequence = Sequence::open(folder.path()).unwrap();
    assert!((sequence.times_s[0] - 1_403_636_579.763_555_6).abs() < 1e-6);
    assert!((sequence.times_s[3] - sequence.times_s[0] - 1.5).abs() < 1e-6);
    let warning = &sequence.warnings[0];
    assert_eq!(warning.name, "times-not-in-seconds");
    assert!(
        warning.message.contains("holds nanoseconds since 1970"),
        "{warning}"
    );
    assert!((sequence.odometry[1].t_s - 1_403_636_580.7).abs() < 1e-6);
    let columns = &sequence.warnings[2];
    assert_eq!(columns.name, "odometry-columns");
    assert!(
        columns
            .message
            .ends_with("the times are nanoseconds since 1970."),
        "{columns}"
    );
    // Counted from zero nothing is certain.
    let message = fault(with("times.txt", "0\n500000000\n1000000000\n1500000000\n"));
    assert_eq!(
        message,
        "SEQ/times.txt: expected times in seconds, found frames that are 500000000 apart: these look like nanoseconds, \
         divide them by 1e9"
    );
}

#[test]
fn names_that_are_stamps_stand_in_for_times() {
    let folder = good();
    with_images(
        folder.path(),
        &["0.00.png", "0.25.png", "0.50.png", "1.00.png"],
    );
    fs::remove_file(folder.path().join("times.txt")).unwrap();
    let sequence = Sequence::open(folder.path()).unwrap();
    assert_eq!(sequence.times_s, [0.0, 0.25, 0.5, 1.0]);
    assert!(names_of(&sequence.warnings).contains(&"times-from-names"));
}

#[test]
fn regress_paths_of_a_newcomer_get_a_sentence() {
    let folder = good();
    let root = folder.path();
    let said = |path: &Path| {
        let message = Sequence::open(path).unwrap_err().to_string();
        message.replace(&root.display().to_string(), "SEQ")
    };
    let images = root.join("images");
    assert_eq!(
        said(&images),
        "SEQ/images: expected a sequence folder, found the folder of images of one: give SEQ"
    );
    assert_eq!(
        said(&images.join("000000.png")),
        "SEQ/images/000000.png: expected a sequence folder, found one image: give the folder"
    );
    for (name, found) in [
        ("video.mp4", "found a video: make a folder SEQ"),
        ("drive.tar.gz", "found an archive: unpack it"),
        ("notes.txt", "found a file"),
    ] {
        fs::write(root.join(name), "x").unwrap();
        let message = said(&root.join(name));
        assert!(message.contains(found), "{message}");
    }
    let empty = root.join("empty");
    fs::create_dir(&empty).unwrap();
    let message = said(&empty);
    assert!(
        message.starts_with("SEQ/empty: expected a sequence (a folder with images/, times.txt")
            && message.ends_with("found an empty folder"),
        "{message}"
    );
}

#[test]
fn a_folder_of_images_is_a_sequence_that_lacks_the_rest() {
    let folder = good();
    let plain = folder.path().join("plain");
    fs::rename(folder.path().join("images"), &plain).unwrap();
    let survey = Survey::of(&plain, &OpenOptions::default()).unwrap();
    assert_eq!(survey.format, SequenceFormat::Images);
    assert_eq!(survey.images.as_ref().unwrap().len(), 4);
    let faults: Vec<String> = survey.faults().iter().map(ToString::to_string).collect();
    assert_eq!(faults.len(), 3, "{faults:?}");
    assert!(
        faults[0].contains("plain/times.txt") && faults[0].contains("--fps 10"),
        "{faults:?}"
    );
    // With the three files beside the images nothing is missing.
    for name in ["times.txt", "camera.toml", "odometry.csv"] {
        fs::copy(folder.path().join(name), plain.join(name)).unwrap();
    }
    assert_eq!(Sequence::open(&plain).unwrap().images.len(), 4);
}

#[test]
fn every_missing_piece_is_found_at_once() {
    let folder = good();
    for name in ["times.txt", "camera.toml", "odometry.csv"] {
        fs::remove_file(folder.path().join(name)).unwrap();
    }
    let survey = Survey::of(folder.path(), &OpenOptions::default()).unwrap();
    let faults: Vec<String> = survey.faults().iter().map(ToString::to_string).collect();
    let named = ["times.txt", "camera.toml", "odometry.csv"];
    assert_eq!(faults.len(), 3, "{faults:?}");
    for (fault, name) in faults.iter().zip(named) {
        assert!(fault.contains(&format!("{name}: not found")), "{fault}");
    }
}

#[test]
fn a_named_calibration_replaces_the_sequence_s_own() {
    let folder = good();
    let other = folder.path().join("other.toml");
    fs::write(&other, CAMERA.replace("fx = 10.0", "fx = 12.0")).unwrap();
    let options = OpenOptions {
        camera: Some(other),
        ..OpenOptions::default()
    };
    let sequence = Sequence::open_with(folder.path(), &options).unwrap();
    assert_eq!(sequence.camera.fx, 12.0);
    let (name, bytes) = sequence.input_files().unwrap().remove(0);
    assert_eq!(name, "camera.toml");
    assert!(String::from_utf8(bytes).unwrap().contains("fx = 12.0"));
}
