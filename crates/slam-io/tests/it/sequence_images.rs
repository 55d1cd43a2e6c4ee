//! Images of a sequence: found, ordered, whole; missing pieces are named.

use std::fs;
use std::path::Path;

use crate::common::sequence::{fault, good, names_of, with};
use image::{GrayImage, Luma, Rgb, RgbImage};
use slam_io::Sequence;

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
