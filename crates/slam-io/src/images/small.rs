//! An image made small for a page: reduced by averaging, as JPEG or PNG.

use image::codecs::jpeg::JpegEncoder;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, GrayImage, ImageEncoder, imageops};

use super::grey::GreyImage;

/// Bits that a pixel of a small picture needs to be recognised for what it shows.
const BITS_PER_PIXEL: f64 = 0.5;
/// Columns and rows of a small picture at most.
const LARGEST: f64 = 480.0;
/// Qualities of JPEG to choose from, best first.
const QUALITIES: [u8; 7] = [75, 60, 45, 33, 23, 15, 8];

impl GreyImage {
    /// The image with at most `widest` columns and rows, every pixel the mean of those it covers; itself when it is no
    /// larger, or when its pixels do not fill its size. O(pixels).
    #[must_use]
    pub fn reduced(&self, widest: usize) -> GreyImage {
        let share = widest.max(1) as f64 / self.width.max(self.height).max(1) as f64;
        if share >= 1.0 {
            return self.clone();
        }
        let side = |length: usize| ((length as f64 * share).round() as usize).max(1);
        let (width, height) = (side(self.width), side(self.height));
        match (self.buffer(), u32::try_from(width), u32::try_from(height)) {
            (Some(image), Ok(columns), Ok(rows)) => GreyImage {
                width,
                height,
                pixels: imageops::thumbnail(&image, columns, rows).into_raw(),
            },
            _ => self.clone(),
        }
    }

    /// The image as the bytes of a PNG file; `None` when its pixels do not fill its size.
    #[must_use]
    pub fn png(&self) -> Option<Vec<u8>> {
        let image = self.buffer()?;
        let mut bytes = Vec::new();
        PngEncoder::new_with_quality(&mut bytes, CompressionType::Fast, FilterType::Adaptive)
            .write_image(&image, image.width(), image.height(), ExtendedColorType::L8)
            .ok()?;
        Some(bytes)
    }

    /// The image as the bytes of a JPEG file whose picture, apart from its header, has about `most` bytes: as many pixels
    /// as that is enough for, in the best quality that fits. `None` when its pixels do not fill its size.
    pub(crate) fn small_jpeg(&self, most: usize) -> Option<Vec<u8>> {
        let pixels = 8.0 * most as f64 / BITS_PER_PIXEL;
        let aspect = self.width.max(self.height) as f64 / self.width.min(self.height).max(1) as f64;
        let longest = (pixels * aspect).sqrt().clamp(16.0, LARGEST);
        let small = self.reduced(longest as usize);
        let image = small.buffer()?;
        let encoded = |quality: u8| {
            let mut bytes = Vec::new();
            JpegEncoder::new_with_quality(&mut bytes, quality)
                .encode(&image, image.width(), image.height(), ExtendedColorType::L8)
                .ok()?;
            Some(bytes)
        };
        // A file shrinks with its quality, so halving finds the best that fits.
        let (mut low, mut high) = (0, QUALITIES.len() - 1);
        let mut best = None;
        while low < high {
            let middle = (low + high) / 2;
            match encoded(QUALITIES[middle]).filter(|b| b.len() <= most + JPEG_HEADER_BYTES) {
                Some(bytes) => (best, high) = (Some(bytes), middle),
                None => low = middle + 1,
            }
        }
        best.or_else(|| encoded(QUALITIES[low]))
    }

    /// The pixels as `image` takes them; `None` when they do not fill the size or there are none.
    fn buffer(&self) -> Option<GrayImage> {
        let (width, height) = (
            u32::try_from(self.width).ok()?,
            u32::try_from(self.height).ok()?,
        );
        let fits = width > 0 && self.width.checked_mul(self.height) == Some(self.pixels.len());
        if fits && height > 0 {
            GrayImage::from_raw(width, height, self.pixels.clone())
        } else {
            None
        }
    }
}

/// Length of the header of a grey JPEG file with the usual Huffman tables.
const JPEG_HEADER_BYTES: usize = 328;

#[cfg(test)]
mod tests {
    use super::*;

    fn ramp(width: usize, height: usize) -> GreyImage {
        GreyImage {
            width,
            height,
            pixels: (0..width * height)
                .map(|k| (k % width * 255 / width) as u8)
                .collect(),
        }
    }

    #[test]
    fn reduced_pixels_are_means() {
        let small = ramp(1920, 6).reduced(640);
        assert_eq!(
            (small.width, small.height, small.pixels.len()),
            (640, 2, 1280)
        );
        let mean = |k: usize| {
            let row = &ramp(1920, 6).pixels[3 * k..3 * k + 3];
            row.iter().map(|&v| f64::from(v)).sum::<f64>() / 3.0
        };
        for k in [0, 17, 320, 639] {
            assert!((f64::from(small.pixels[k]) - mean(k)).abs() <= 1.0, "{k}");
        }
        assert_eq!(ramp(40, 30).reduced(40), ramp(40, 30));
        let broken = GreyImage {
            width: 900,
            ..ramp(40, 30)
        };
        assert_eq!(broken.reduced(100), broken);
        assert_eq!((broken.png(), broken.small_jpeg(1000)), (None, None));
    }

    #[test]
    fn small_pictures_keep_their_proportions_and_their_budget() {
        // Noise is the worst that JPEG can meet.
        let mut state = 1_u32;
        let mut noise = |width: usize, height: usize| GreyImage {
            width,
            height,
            pixels: (0..width * height)
                .map(|_| {
                    state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                    (state >> 24) as u8
                })
                .collect(),
        };
        for (image, most) in [
            (noise(640, 480), 900),
            (noise(100, 400), 5000),
            (ramp(1, 1), 10),
        ] {
            let bytes = image.small_jpeg(most).unwrap();
            let back = image::load_from_memory(&bytes).unwrap().into_luma8();
            let longest = back.width().max(back.height()) as f64;
            assert!(longest <= LARGEST, "{longest}");
            let aspect = |w: f64, h: f64| (w / h).ln();
            let change = aspect(back.width().into(), back.height().into())
                - aspect(image.width as f64, image.height as f64);
            assert!(change.abs() < 0.02, "{change}");
            assert!(
                bytes.len() < JPEG_HEADER_BYTES + 2 * most.max(100),
                "{}",
                bytes.len()
            );
        }
        // Its header is as long as the budget takes it to be.
        let flat = GreyImage {
            width: 8,
            height: 8,
            pixels: vec![128; 64],
        };
        let bytes = flat.small_jpeg(1).unwrap();
        let scan = bytes
            .windows(2)
            .position(|pair| pair == [0xff, 0xda])
            .unwrap();
        assert_eq!(scan + 10, JPEG_HEADER_BYTES);
    }
}
