//! Grey images as plain values, and their PNG form.

use crate::error::SceneError;
use image::codecs::png::{FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};
use std::path::Path;

pub(crate) use image::codecs::png::CompressionType;

/// A grey image of 8 bits, row by row from the top left.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct GreyImage {
    /// Pixels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Grey levels, `width * height` of them.
    pub pixels: Vec<u8>,
}

impl GreyImage {
    /// The image as the bytes of a PNG file; `file` is only named in the error.
    pub(crate) fn to_png(
        &self,
        compression: CompressionType,
        file: &Path,
    ) -> Result<Vec<u8>, SceneError> {
        let mut bytes = Vec::new();
        let encoder = PngEncoder::new_with_quality(&mut bytes, compression, FilterType::Adaptive);
        encoder
            .write_image(
                &self.pixels,
                self.width as u32,
                self.height as u32,
                ExtendedColorType::L8,
            )
            .map_err(|source| SceneError::Image {
                file: file.to_path_buf(),
                source,
            })?;
        Ok(bytes)
    }
}
