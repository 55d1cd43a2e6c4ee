//! Image files of every format that is read.

use std::io::Cursor;

use image::{GrayImage, ImageFormat, Luma};
use slam_io::read_grey;

use super::mutations::Memory;
use super::{attack_file, unsealed};

/// The bound of deflate, twice for a decoder's own copy; of what any file may unpack to the same and half of it, for the rows that the
/// decoder of TIFF keeps between.
const IMAGE: Memory = Memory {
    per_byte: 2 * 1032,
    always: 100 << 20,
};

#[test]
fn images_of_any_bytes() {
    let picture = GrayImage::from_fn(24, 16, |x, y| Luma([(x * 9 + y * 7 + x * y) as u8]));
    let genuine: Vec<Vec<u8>> = [
        ImageFormat::Png,
        ImageFormat::Jpeg,
        ImageFormat::Bmp,
        ImageFormat::Pnm,
        ImageFormat::Tiff,
        ImageFormat::WebP,
    ]
    .into_iter()
    .map(|format| {
        let mut bytes = Cursor::new(Vec::new());
        let written = image::DynamicImage::ImageLuma8(picture.clone());
        let written = match format {
            ImageFormat::WebP => image::DynamicImage::ImageRgb8(written.into_rgb8()),
            _ => written,
        };
        written.write_to(&mut bytes, format).unwrap();
        bytes.into_inner()
    })
    .collect();
    attack_file("image", &genuine, IMAGE, unsealed, |path| {
        drop(read_grey(path));
    });
}

/// A header alone, of 65,535 columns and rows: the decoder asked for half a gigabyte.
#[test]
fn regress_a_header_alone_cost_half_a_gigabyte() {
    for (name, header) in [
        ("pgm", &b"P5 20000 20000 255\nabc"[..]),
        ("ppm", b"P6 12000 12000 255\nabc"),
    ] {
        let folder = crate::common::ScratchFolder::new();
        let path = folder.path().join(name);
        std::fs::write(&path, header).unwrap();
        let info = allocation_counter::measure(|| {
            let told = read_grey(&path).unwrap_err().to_string();
            assert!(
                told.ends_with("found more pixels than a file of its length can hold"),
                "{told}"
            );
        });
        assert!(info.bytes_max < 40 << 20, "{name}: {}", info.bytes_max);
    }
}
