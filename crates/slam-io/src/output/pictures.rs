//! The picture of a snapshot as PNG.

use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};

use super::error::OutputError;
use crate::record::FrameSnapshot;

impl FrameSnapshot {
    /// The grey picture as the bytes of a PNG file.
    ///
    /// # Errors
    /// [`OutputError::Encoding`] when the pixels do not fill the size.
    pub fn png(&self) -> Result<Vec<u8>, OutputError> {
        if self.width == 0 || Some(self.pixels.len()) != self.width.checked_mul(self.height) {
            return Err(OutputError::encoding(format!(
                "{} pixels do not fill {}x{}",
                self.pixels.len(),
                self.width,
                self.height
            )));
        }
        let mut bytes = Vec::new();
        PngEncoder::new_with_quality(&mut bytes, CompressionType::Fast, FilterType::Adaptive)
            .write_image(
                &self.pixels,
                u32::try_from(self.width).map_err(OutputError::encoding)?,
                u32::try_from(self.height).map_err(OutputError::encoding)?,
                ExtendedColorType::L8,
            )
            .map_err(OutputError::encoding)?;
        Ok(bytes)
    }
}
