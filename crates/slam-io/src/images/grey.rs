//! Image files: their headers, their pixels in grey.

use std::fs;
use std::io::Cursor;
use std::path::Path;

use camera_calibration::GreyView;
use image::{DynamicImage, ImageReader, ImageResult, Limits};

use crate::error::SequenceError;

/// Most bytes of pixels that a byte of a file unpacks to: the bound of deflate, behind PNG and TIFF.
const MOST_BYTES_PER_BYTE: u64 = 1032;
/// Bytes that any file may unpack to: solid images of other formats, and what a decoder needs for itself.
const ALWAYS_BYTES: u64 = 32 << 20;
/// Bytes beyond which no image is decoded.
const MOST_BYTES: u64 = 512 << 20;

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

/// Decodes an image in memory.
pub(crate) fn decoded_in_memory(bytes: &[u8]) -> ImageResult<DynamicImage> {
    let mut reader = ImageReader::new(Cursor::new(bytes)).with_guessed_format()?;
    reader.limits(limits(bytes.len() as u64));
    reader.decode()
}

/// Memory that the decoder of a file of so many bytes may ask for: a header alone must not cost gigabytes.
fn limits(length: u64) -> Limits {
    let mut limits = Limits::default();
    let packed = length.saturating_mul(MOST_BYTES_PER_BYTE);
    limits.max_alloc = Some(packed.saturating_add(ALWAYS_BYTES).min(MOST_BYTES));
    limits
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
    let length = fs::metadata(path)?.len();
    let mut reader = ImageReader::open(path)?.with_guessed_format()?;
    reader.limits(limits(length));
    Ok(reader)
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

/// The words of a decoder as a clause: one line, no control characters, no insides of its types, no full stop.
fn fault_of_decoder(error: &image::ImageError) -> String {
    if matches!(error, image::ImageError::Limits(_)) {
        return "more pixels than a file of its length can hold".into();
    }
    let text = error.to_string();
    let told = text.split(": ChunkType {").next().unwrap_or_default();
    let told: String = told
        .chars()
        .map(|sign| if sign.is_control() { ' ' } else { sign })
        .collect();
    told.trim_end_matches(['.', ' ']).to_owned()
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
                fault_of_decoder(&other)
            },
        },
    })
}
