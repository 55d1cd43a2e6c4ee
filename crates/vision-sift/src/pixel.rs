//! The grey values that an image may have: bytes, 16 bits, floats.

use crate::error::SiftError;

/// A grey value: `u8`, `u16`, or `f32` with 0 for black and 1 for white.
///
/// The same picture gives the same keypoints up to the rounding of its grey values. Thresholds of contrast are shares of the
/// full range, so a picture that uses a small part of its 16 bits is stretched first.
pub trait Pixel: Copy + Send + Sync + sealed::Sealed {
    /// The grey value in units of its own; sums of sixteen are exact for integers.
    #[doc(hidden)]
    fn raw(self) -> f32;

    /// Brings [`Pixel::raw`] to 0 to 1.
    #[doc(hidden)]
    const SCALE: f32;

    /// The first value of a row that is no number.
    #[doc(hidden)]
    fn not_finite(row: &[Self]) -> Option<usize>;
}

mod sealed {
    /// Sums of other pixels might round.
    pub trait Sealed {}
    impl Sealed for u8 {}
    impl Sealed for u16 {}
    impl Sealed for f32 {}
}

impl Pixel for u8 {
    const SCALE: f32 = 1.0 / 255.0;

    #[inline(always)]
    fn raw(self) -> f32 {
        f32::from(self)
    }

    fn not_finite(_: &[Self]) -> Option<usize> {
        None
    }
}

impl Pixel for u16 {
    const SCALE: f32 = 1.0 / 65535.0;

    #[inline(always)]
    fn raw(self) -> f32 {
        f32::from(self)
    }

    fn not_finite(_: &[Self]) -> Option<usize> {
        None
    }
}

impl Pixel for f32 {
    const SCALE: f32 = 1.0;

    #[inline(always)]
    fn raw(self) -> f32 {
        self
    }

    fn not_finite(row: &[Self]) -> Option<usize> {
        row.iter().position(|value| !value.is_finite())
    }
}

/// The grey bytes of interleaved colours, red, green and blue: 0.299 R + 0.587 G + 0.114 B (ITU-R BT.601, as OpenCV),
/// rounded.
///
/// # Errors
/// [`SiftError::ColourCount`] when the number of bytes is no multiple of three.
///
/// ```
/// let red_and_white = [255, 0, 0, 255, 255, 255];
/// assert_eq!(vision_sift::grey_from_rgb(&red_and_white)?, [76, 255]);
/// # Ok::<(), vision_sift::SiftError>(())
/// ```
pub fn grey_from_rgb(pixels: &[u8]) -> Result<Vec<u8>, SiftError> {
    let (colours, rest) = pixels.as_chunks::<3>();
    if !rest.is_empty() {
        return Err(SiftError::ColourCount {
            length: pixels.len(),
        });
    }
    // OpenCV's weights of 15 bits, which sum to 2^15.
    let grey = |[r, g, b]: &[u8; 3]| {
        let sum = 9798 * u32::from(*r) + 19235 * u32::from(*g) + 3735 * u32::from(*b);
        ((sum + (1 << 14)) >> 15) as u8
    };
    Ok(colours.iter().map(grey).collect())
}
