//! Faults of the images.

use std::fs;

use image::{DynamicImage, GrayImage, imageops};

use super::Outcome::{Noted, Refused, Same, Stopped, Warned};
use super::{Fault, assert_outcomes, break_frame_2, crc32, row};

fn faults() -> Vec<Fault> {
    vec![
        row(
            "an image is missing",
            |input| input.remove("seq/images/000002.png"),
            Refused(&[
                "seq/times.txt: expected 4 times, one per image, found 5; an image between 000001.png and 000003.png seems to be missing",
            ]),
        ),
        row(
            "the last image is missing",
            |input| input.remove("seq/images/000004.png"),
            Refused(&["seq/times.txt: expected 4 times, one per image, found 5\n"]),
        ),
        row(
            "an image is one too many",
            |input| {
                fs::copy(
                    input.path("seq/images/000002.png"),
                    input.path("seq/images/000005.png"),
                )
                .unwrap();
            },
            Refused(&["seq/times.txt: expected 6 times, one per image, found 5"]),
        ),
        row(
            "an image is cut",
            |input| input.cut("seq/images/000002.png", 60),
            Refused(&[
                "seq/images/000002.png: expected a whole image, found unexpected end of file",
            ]),
        ),
        row(
            "the last image is cut, as by a full disk",
            |input| input.cut("seq/images/000004.png", 60),
            Warned(&["last-image-cut"]),
        ),
        row(
            "an image has zero bytes",
            |input| input.write("seq/images/000002.png", ""),
            Refused(&["seq/images/000002.png: expected a whole image, found an empty file"]),
        ),
        row(
            "all images have zero bytes",
            |input| {
                for frame in 0..5 {
                    input.write(&format!("seq/images/{frame:06}.png"), "");
                }
            },
            Refused(&["seq/images/000000.png: expected a whole image, found an empty file"]),
        ),
        row(
            "an image is text",
            |input| input.write("seq/images/000002.png", "Dear aunt,\n"),
            Refused(&[
                "seq/images/000002.png: expected a whole image, found ",
                "Invalid PNG signature\n",
            ]),
        ),
        row(
            "an image is a PNG of nothing but zeros behind its header",
            |input| {
                let mut bytes = input.bytes("seq/images/000002.png");
                let end = bytes.len() - 12;
                bytes[40..end].fill(0);
                input.write("seq/images/000002.png", bytes);
            },
            Refused(&[
                "seq/images/000002.png: expected a whole image, found ",
                "Unrecognized critical chunk\n",
            ]),
        ),
        row(
            "the middle of an image is damaged",
            break_frame_2,
            Stopped(
                2,
                &[
                    "seq/images/000002.png: expected a whole image, found ",
                    "; the same command with --resume goes on",
                ],
            ),
        ),
        row(
            "an image is a folder",
            |input| input.folder("seq/images/000002.png"),
            Refused(&["an image between 000001.png and 000003.png seems to be missing"]),
        ),
        row(
            "an image is a JPEG by its bytes",
            |input| {
                let image = image::open(input.path("seq/images/000002.png")).unwrap();
                image
                    .save_with_format(
                        input.path("seq/images/000002.png"),
                        image::ImageFormat::Jpeg,
                    )
                    .unwrap();
            },
            Warned(&[]),
        ),
        row(
            "an image has another size",
            |input| {
                input.image(2, |image| {
                    imageops::resize(&image, 160, 120, imageops::FilterType::Triangle).into()
                });
            },
            Refused(&[
                "seq/images/000002.png: expected 320x240 pixels as camera.toml says, found 160x120",
            ]),
        ),
        row(
            "all images have another size",
            |input| {
                input.images(|image| {
                    imageops::resize(&image, 160, 120, imageops::FilterType::Triangle).into()
                });
            },
            Refused(&[
                "seq/images/000000.png: expected 320x240 pixels as camera.toml says, found 160x120",
            ]),
        ),
        row(
            "an image is turned by a quarter",
            |input| input.image(2, |image| imageops::rotate90(&image).into()),
            Refused(&[
                "seq/images/000002.png: expected 320x240 pixels as camera.toml says, found 240x320",
            ]),
        ),
        row(
            "the images have 16 bits",
            |input| input.images(|image| DynamicImage::ImageLuma8(image).into_luma16().into()),
            Same,
        ),
        row(
            "the images have 16 bits of which 12 are used",
            |input| {
                input.images(|image| {
                    let mut wide = DynamicImage::ImageLuma8(image).into_luma16();
                    for pixel in wide.pixels_mut() {
                        pixel.0[0] >>= 4;
                    }
                    wide.into()
                });
            },
            Warned(&["grey-levels-stretched"]),
        ),
        row(
            "the images are grey in colour",
            |input| input.images(|image| DynamicImage::ImageLuma8(image).into_rgb8().into()),
            Same,
        ),
        row(
            "one image is in colour",
            |input| {
                input.image(2, |image| {
                    DynamicImage::ImageLuma8(image).into_rgba8().into()
                });
            },
            Same,
        ),
        row(
            "an image is black",
            |input| {
                input.image(2, |image| {
                    GrayImage::new(image.width(), image.height()).into()
                });
            },
            Noted("lost"),
        ),
        row(
            "all images are black",
            |input| input.images(|image| GrayImage::new(image.width(), image.height()).into()),
            Warned(&["images-without-contrast", "few-keypoints"]),
        ),
        row(
            "all images are white",
            |input| {
                input.images(|image| {
                    GrayImage::from_pixel(image.width(), image.height(), image::Luma([255])).into()
                });
            },
            Warned(&["images-without-contrast", "few-keypoints"]),
        ),
        row(
            "all images are the first",
            |input| {
                for frame in 1..5 {
                    fs::copy(
                        input.path("seq/images/000000.png"),
                        input.path(&format!("seq/images/{frame:06}.png")),
                    )
                    .unwrap();
                }
            },
            Warned(&["images-repeated"]),
        ),
        row(
            "the images are mirrored",
            |input| {
                input.images(|mut image| {
                    imageops::flip_horizontal_in_place(&mut image);
                    image.into()
                });
            },
            Warned(&["driving-direction"]),
        ),
        row(
            "the folder of images is empty",
            |input| {
                for frame in 0..5 {
                    input.remove(&format!("seq/images/{frame:06}.png"));
                }
            },
            Refused(&[
                "seq/images: expected at least one image (.png, ",
                ", found an empty folder",
            ]),
        ),
        row(
            "the folder of images is missing",
            |input| fs::remove_dir_all(input.path("seq/images")).unwrap(),
            Refused(&[
                "seq/images: not found; it holds the images, one file per frame",
                "`ffmpeg -i VIDEO seq/images/%06d.png` takes a video apart",
            ]),
        ),
        row(
            "the folder of images is a file",
            |input| {
                fs::remove_dir_all(input.path("seq/images")).unwrap();
                input.write("seq/images", "x");
            },
            Refused(&["seq/images: expected a folder of images, found a file"]),
        ),
        row(
            "an image is huge by its header",
            |input| {
                let mut bytes = input.bytes("seq/images/000002.png");
                bytes[16..24].fill(0x7f);
                let sum = crc32(&bytes[12..29]);
                bytes[29..33].copy_from_slice(&sum.to_be_bytes());
                input.write("seq/images/000002.png", bytes);
            },
            Refused(&[
                "seq/images/000002.png: expected a whole image, found more pixels than a file of its length can hold",
            ]),
        ),
    ]
}

#[test]
fn faults_of_the_images_end_as_they_should() {
    assert_outcomes(&faults());
}
