//! A small good sequence, and the sentence about it after some damage.

use std::fs;
use std::path::Path;

use image::{GrayImage, Luma};
use slam_io::{Sequence, Warning};

use super::ScratchFolder;

pub(crate) const CAMERA: &str =
    "width = 8\nheight = 6\nmodel = \"pinhole\"\nfx = 10.0\nfy = 11\ncx = 3.5\ncy = 2.5\n";

/// Four frames at 0, 0.5, 1, 1.5 s and odometry at 0, 0.4, 1.2 s.
pub(crate) fn write_good(root: &Path) {
    fs::create_dir_all(root.join("images")).unwrap();
    for (index, name) in ["000000.png", "000001.PNG", "000002.jpg", "000003.jpeg"]
        .iter()
        .enumerate()
    {
        let picture = GrayImage::from_pixel(8, 6, Luma([40 * index as u8]));
        let path = root.join("images").join(name);
        let format = if index < 2 {
            image::ImageFormat::Png
        } else {
            image::ImageFormat::Jpeg
        };
        picture.save_with_format(path, format).unwrap();
    }
    fs::write(root.join("images/notes.txt"), "not an image").unwrap();
    fs::write(root.join("times.txt"), "0.0\n0.5\n1.0\n1.5\n").unwrap();
    fs::write(root.join("camera.toml"), CAMERA).unwrap();
    fs::write(
        root.join("odometry.csv"),
        "t_s,v_mps,omega_radps\n0,1.0,0.1\n0.4,2.0,0.2\n1.2,3.0,-0.3\n",
    )
    .unwrap();
}

pub(crate) fn good() -> ScratchFolder {
    let folder = ScratchFolder::new();
    write_good(folder.path());
    folder
}

/// Message of the error after `damage` was done to a good folder.
pub(crate) fn fault(damage: impl FnOnce(&Path)) -> String {
    let folder = good();
    damage(folder.path());
    let message = Sequence::open(folder.path()).unwrap_err().to_string();
    let root = folder.path().to_string_lossy().into_owned();
    assert!(message.contains(&root), "{message} names the file");
    assert!(!message.contains('\n'), "{message:?} is one line");
    message.replace(&root, "SEQ")
}

pub(crate) fn names_of(warnings: &[Warning]) -> Vec<&str> {
    warnings
        .iter()
        .map(|warning| warning.name.as_str())
        .collect()
}

pub(crate) fn with(name: &'static str, text: &'static str) -> impl FnOnce(&Path) {
    move |root| fs::write(root.join(name), text).unwrap()
}

pub(crate) fn with_camera(extra: &'static str) -> impl FnOnce(&Path) {
    move |root| fs::write(root.join("camera.toml"), format!("{CAMERA}{extra}")).unwrap()
}
