//! Image files: their headers, their pixels in grey.

use std::fs;
use std::path::Path;

use camera_calibration::GreyView;
use image::{DynamicImage, ImageReader, ImageResult};

use crate::error::SequenceError;

/// An 8-bit grey image, row by row from the top left.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct GreyImage {
    /// Number of columns.
    pub width: usize,
    /// Number of rows.
    pub height: usize,
    /// `width * height` values, row by row.
    pub pixels: Vec<u8>,
}

impl GreyImage {
    /// The image as the search for checkerboards takes it.
    pub fn view(&self) -> GreyView<'_> {
        GreyView {
            width: self.width,
            height: self.height,
            pixels: &self.pixels,
        }
    }
}

/// Decodes an image file of any size to grey; 16-bit values keep their upper eight bits.
///
/// # Errors
/// [`SequenceError`] when the file cannot be read or is not a complete image.
pub fn read_grey(path: &Path) -> Result<GreyImage, SequenceError> {
    Ok(luma(file_decoded(path)?))
}

/// The pixels as the file has them.
pub(crate) fn file_decoded(path: &Path) -> Result<DynamicImage, SequenceError> {
    decoded(path, open(path).and_then(ImageReader::decode))
}

/// Columns and rows, from the header alone.
pub(super) fn file_size(path: &Path) -> Result<(u32, u32), SequenceError> {
    decoded(path, open(path).and_then(ImageReader::into_dimensions))
}

/// Eight bits of grey; colour becomes luma, 16-bit values keep their upper eight bits.
pub(super) fn luma(image: DynamicImage) -> GreyImage {
    let grey = image.into_luma8();
    GreyImage {
        width: grey.width() as usize,
        height: grey.height() as usize,
        pixels: grey.into_raw(),
    }
}

/// The contents decide about the format; the name decides only where they do not tell.
fn open(path: &Path) -> ImageResult<ImageReader<std::io::BufReader<fs::File>>> {
    Ok(ImageReader::open(path)?.with_guessed_format()?)
}

/// Whether neither contents nor name are those of any image format.
fn is_no_image(error: &image::ImageError) -> bool {
    use image::error::{ImageFormatHint, UnsupportedErrorKind};
    match error {
        image::ImageError::Unsupported(error) => matches!(
            error.kind(),
            UnsupportedErrorKind::Format(
                ImageFormatHint::Unknown | ImageFormatHint::PathExtension(_)
            )
        ),
        _ => false,
    }
}

fn decoded<T>(path: &Path, result: ImageResult<T>) -> Result<T, SequenceError> {
    result.map_err(|error| match error {
        image::ImageError::IoError(source)
            if source.kind() != std::io::ErrorKind::UnexpectedEof =>
        {
            SequenceError::Read {
                path: path.to_path_buf(),
                source,
            }
        }
        other => SequenceError::File {
            path: path.to_path_buf(),
            expected: "a whole image".into(),
            found: if fs::metadata(path).is_ok_and(|file| file.len() == 0) {
                "an empty file".into()
            } else if is_no_image(&other) {
                "something that is no image".into()
            } else {
                other.to_string().lines().collect::<Vec<_>>().join(" ")
            },
        },
    })
}
