//! Grey pictures as PNG, alone and inside text.

use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};

use super::{OutputError, base64};
use crate::record::FrameSnapshot;

/// PNG of a snapshot's pixels.
pub(super) fn png(snapshot: &FrameSnapshot) -> Result<Vec<u8>, OutputError> {
    let mut bytes = Vec::new();
    PngEncoder::new_with_quality(&mut bytes, CompressionType::Best, FilterType::Adaptive)
        .write_image(
            &snapshot.pixels,
            u32::try_from(snapshot.width).map_err(OutputError::encoding)?,
            u32::try_from(snapshot.height).map_err(OutputError::encoding)?,
            ExtendedColorType::L8,
        )
        .map_err(OutputError::encoding)?;
    Ok(bytes)
}

/// A snapshot as the address of an inline picture; `None` when its pixels do not fit its size.
pub(crate) fn png_data_uri(snapshot: &FrameSnapshot) -> Option<String> {
    if snapshot.width == 0
        || snapshot.pixels.len() != snapshot.width.checked_mul(snapshot.height)?
    {
        return None;
    }
    png(snapshot)
        .ok()
        .map(|bytes| format!("data:image/png;base64,{}", base64::encode(&bytes)))
}
