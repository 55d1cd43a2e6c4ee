//! The grey image that the detector is given and the `f32` planes on which it works.
//!
//! [`GrayImage`] borrows pixels with any row stride. [`Plane`] owns one level of the pyramid in `f32`, rows
//! contiguous, grey values scaled to `[0, 1]` as in Lowe 2004, section 4.
//!
//! Everywhere in the crate the pixel `(0, 0)` is the *centre* of the top-left pixel, x to the right, y downwards.

use crate::constants::{MAX_IMAGE_SIDE, MIN_IMAGE_SIDE};
use crate::error::SiftError;
use crate::pixel::Pixel;
use crate::simd::LANES;

/// A borrowed image of grey values (`u8` unless said otherwise, see [`Pixel`]), with any distance between its rows.
///
/// Sides are 16 to 32 767 pixels long. The constructor checks this once, so that no later stage can read outside.
///
/// ```
/// use vision_sift::GrayImage;
///
/// // A region of a larger picture, without a copy: its rows are 640 pixels apart.
/// let picture = vec![0_u8; 640 * 480];
/// let (left, top) = (100, 50);
/// let region = GrayImage::with_stride(320, 240, 640, &picture[top * 640 + left..])?;
/// assert_eq!((region.width(), region.height()), (320, 240));
///
/// let message = GrayImage::new(640, 480, &picture[1..]).expect_err("a pixel short").to_string();
/// assert!(message.contains("307199"), "{message}");
/// # Ok::<(), vision_sift::SiftError>(())
/// ```
#[derive(Debug, Clone, Copy)]
pub struct GrayImage<'a, P = u8> {
    width: usize,
    height: usize,
    stride: usize,
    data: &'a [P],
}

impl<'a, P: Pixel> GrayImage<'a, P> {
    /// An image whose rows follow one another without gaps.
    ///
    /// # Errors
    /// [`SiftError::ImageTooSmall`], [`SiftError::ImageTooLarge`], [`SiftError::BufferTooShort`]. A longer buffer is
    /// accepted, the rest is ignored. [`SiftError::PixelNotFinite`] for NaN or infinity among floats.
    pub fn new(width: usize, height: usize, data: &'a [P]) -> Result<Self, SiftError> {
        Self::with_stride(width, height, width, data)
    }

    /// An image whose row `y` begins at pixel `y * stride` of the buffer; the last row may end at its last pixel.
    ///
    /// # Errors
    /// As [`GrayImage::new`], and [`SiftError::StrideTooSmall`].
    pub fn with_stride(
        width: usize,
        height: usize,
        stride: usize,
        data: &'a [P],
    ) -> Result<Self, SiftError> {
        if width < MIN_IMAGE_SIDE || height < MIN_IMAGE_SIDE {
            return Err(SiftError::ImageTooSmall {
                width,
                height,
                minimum: MIN_IMAGE_SIDE,
            });
        }
        if width > MAX_IMAGE_SIDE || height > MAX_IMAGE_SIDE {
            return Err(SiftError::ImageTooLarge {
                width,
                height,
                maximum: MAX_IMAGE_SIDE,
            });
        }
        if stride < width {
            return Err(SiftError::StrideTooSmall { stride, width });
        }
        let required = stride.saturating_mul(height - 1).saturating_add(width);
        if data.len() < required {
            return Err(SiftError::BufferTooShort {
                length: data.len(),
                required,
            });
        }
        let image = Self {
            width,
            height,
            stride,
            data,
        };
        for y in 0..height {
            if let Some(x) = P::not_finite(image.row(y)) {
                return Err(SiftError::PixelNotFinite {
                    x,
                    y,
                    value: image.row(y)[x].raw(),
                });
            }
        }
        Ok(image)
    }

    /// The width in pixels.
    pub fn width(&self) -> usize {
        self.width
    }

    /// The height in pixels.
    pub fn height(&self) -> usize {
        self.height
    }

    /// The pixels of row `y`.
    ///
    /// # Panics
    /// If `y` is not less than the height.
    pub fn row(&self, y: usize) -> &'a [P] {
        let start = y * self.stride;
        &self.data[start..start + self.width]
    }
}

#[cfg(feature = "image")]
impl<'a, P: Pixel + image::Primitive> TryFrom<&'a image::ImageBuffer<image::Luma<P>, Vec<P>>>
    for GrayImage<'a, P>
where
    image::Luma<P>: image::Pixel<Subpixel = P>,
{
    type Error = SiftError;

    fn try_from(
        picture: &'a image::ImageBuffer<image::Luma<P>, Vec<P>>,
    ) -> Result<Self, SiftError> {
        Self::new(
            picture.width() as usize,
            picture.height() as usize,
            picture.as_raw(),
        )
    }
}

/// The size of a cache line, bytes. Rows begin on a line, so that no vector of a row straddles two.
const LINE_BYTES: usize = 64;

/// The number of samples after the last row, so that a vector can be read from any sample of it.
const TAIL: usize = 2 * LANES;

/// One level of the pyramid in `f32`. Each row is followed by padding up to a multiple of [`LANES`] samples, whose values
/// are finite but carry no meaning.
#[derive(Debug, Clone, Default)]
pub(crate) struct Plane {
    width: usize,
    height: usize,
    stride: usize,
    /// The sample with which the first row begins, on a cache line where the allocation allows it.
    start: usize,
    data: Vec<f32>,
}

impl Plane {
    /// Takes a new size; the contents are then unspecified. Allocates only to grow.
    pub(crate) fn resize(&mut self, width: usize, height: usize) {
        let spare = LINE_BYTES / size_of::<f32>();
        self.width = width;
        self.height = height;
        self.stride = width.next_multiple_of(LANES);
        self.data.resize(self.stride * height + spare + TAIL, 0.0);
        let start = self.data.as_ptr().align_offset(LINE_BYTES);
        self.start = if start < spare { start } else { 0 };
    }

    pub(crate) fn width(&self) -> usize {
        self.width
    }

    pub(crate) fn height(&self) -> usize {
        self.height
    }

    /// The number of samples from row to row, padding included.
    pub(crate) fn stride(&self) -> usize {
        self.stride
    }

    pub(crate) fn row(&self, y: usize) -> &[f32] {
        &self.padded_row(y)[..self.width]
    }

    /// Row `y` with its padding.
    #[inline(always)]
    pub(crate) fn padded_row(&self, y: usize) -> &[f32] {
        &self.data[self.start + y * self.stride..][..self.stride]
    }

    #[cfg(test)]
    pub(crate) fn row_mut(&mut self, y: usize) -> &mut [f32] {
        &mut self.data[self.start + y * self.stride..][..self.width]
    }

    /// All rows with their padding: `stride * height` samples.
    pub(crate) fn samples(&self) -> &[f32] {
        &self.data[self.start..][..self.stride * self.height]
    }

    /// All rows with their padding: `stride * height` samples.
    pub(crate) fn samples_mut(&mut self) -> &mut [f32] {
        &mut self.data[self.start..][..self.stride * self.height]
    }

    /// All samples from `(x, y)` on: the row, its padding and the rows below. There are at least [`LANES`] of them from any
    /// sample of the plane, and from the one after the end of a row.
    #[inline(always)]
    pub(crate) fn from(&self, x: usize, y: usize) -> &[f32] {
        &self.data[self.start + y * self.stride + x..]
    }

    #[inline]
    pub(crate) fn at(&self, x: usize, y: usize) -> f32 {
        self.data[self.start + y * self.stride + x]
    }

    /// The memory held on the heap, bytes.
    pub(crate) fn memory_usage(&self) -> usize {
        self.data.capacity() * size_of::<f32>()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_checked_with_their_numbers() {
        let data = [0_u8; 400];
        assert_eq!(
            GrayImage::new(15, 20, &data).unwrap_err().to_string(),
            "image is 15x20 pixels, at least 16x16 needed"
        );
        assert_eq!(
            GrayImage::new(20, 21, &data).unwrap_err(),
            SiftError::BufferTooShort {
                length: 400,
                required: 420
            }
        );
        assert_eq!(
            GrayImage::with_stride(20, 20, 19, &data).unwrap_err(),
            SiftError::StrideTooSmall {
                stride: 19,
                width: 20
            }
        );
        assert!(matches!(
            GrayImage::new(usize::MAX, 20, &data),
            Err(SiftError::ImageTooLarge { .. })
        ));
        assert!(matches!(
            GrayImage::with_stride(20, 20, usize::MAX, &data),
            Err(SiftError::BufferTooShort { .. })
        ));
        assert!(GrayImage::<u8>::new(0, 0, &[]).is_err());
    }

    #[test]
    fn the_last_row_may_end_at_its_last_pixel() {
        let data: Vec<u8> = (0..16 * 20 - 4).map(|i| (i % 256) as u8).collect();
        let view = GrayImage::with_stride(16, 16, 20, &data).unwrap();
        assert_eq!(view.row(15), &data[300..316]);
    }

    #[cfg(feature = "image")]
    #[test]
    fn pictures_of_the_image_crate_are_borrowed() {
        let picture =
            image::GrayImage::from_fn(20, 17, |x, y| image::Luma([(x * 3 + y * 7) as u8]));
        let view = GrayImage::try_from(&picture).unwrap();
        assert_eq!((view.width(), view.height(), view.row(4)[5]), (20, 17, 43));
        assert!(GrayImage::try_from(&image::GrayImage::new(9, 20)).is_err());
    }
}
