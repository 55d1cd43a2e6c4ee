//! Grey levels: one mapping to eight bits for all images of a sequence.
//!
//! Cameras with 12 or 14 bits, and thermal cameras above all, fill a small part of the 65536 levels of their files; the
//! upper eight bits alone would be an even grey. Where the levels in use span less than a quarter of the range they are
//! stretched, `round(255 (v - low) / (high - low))`, clipped. `low` and `high` are medians over some frames of the
//! sequence of the 0.1 and 99.9 percent quantiles: a hot pixel or a black frame does not move them. The mapping is the
//! same for all frames, because a brightness that jumps from frame to frame would look like a change of the scene.
//!
//! A range of only a few levels is noise, and stretching it would make a scene of it: it stays as it is.

use image::DynamicImage;

use super::grey::{GreyImage, luma};
use crate::warning::Warning;

/// Share of the pixels below the low and above the high level.
const TAIL_SHARE: f64 = 1e-3;
/// Levels are stretched where they span less than this share of the range.
const STRETCHED_SHARE: f64 = 0.25;
/// Fewer levels than these are noise.
const FEWEST_LEVELS: u32 = 16;

/// How the values of a sequence's images become eight bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Levels {
    /// Largest value of the files' type, 255 or 65535.
    pub(super) top: u32,
    /// Lower and upper level in use.
    pub(super) used: Option<(u32, u32)>,
}

impl Levels {
    /// From some frames of the sequence.
    pub(super) fn of(frames: &[DynamicImage]) -> Self {
        let top = if frames.iter().any(is_deep) {
            65_535
        } else {
            255
        };
        let ranges: Vec<(u32, u32)> = frames.iter().map(|frame| range_of(frame, top)).collect();
        let median = |pick: fn(&(u32, u32)) -> u32| {
            let mut values: Vec<u32> = ranges.iter().map(pick).collect();
            values.sort_unstable();
            values.get(values.len() / 2).copied()
        };
        Self {
            top,
            used: median(|range| range.0).zip(median(|range| range.1)),
        }
    }

    /// The levels that are stretched over the whole range, if they are.
    pub(super) fn window(&self) -> Option<(u32, u32)> {
        self.used.filter(|&(low, high)| {
            let span = high.saturating_sub(low);
            span >= FEWEST_LEVELS && f64::from(span) < STRETCHED_SHARE * f64::from(self.top)
        })
    }

    /// The warning that belongs to the mapping.
    pub(super) fn warning(&self) -> Option<Warning> {
        let (low, high) = self.used?;
        let all = self.top + 1;
        if self.window().is_some() {
            return Some(Warning::new(
                "grey-levels-stretched",
                format!(
                    "The images use the levels {low} to {high} of {all}, which are stretched to the whole range, \
                     the same way in every frame."
                ),
            ));
        }
        (high.saturating_sub(low) < FEWEST_LEVELS).then(|| {
            Warning::new(
                "images-without-contrast",
                format!(
                    "The images use the levels {low} to {high} of {all}: nothing can be seen in them; is the lens \
                     covered, or the exposure wrong?"
                ),
            )
        })
    }

    /// One image in eight bits.
    pub(super) fn grey(&self, image: DynamicImage) -> GreyImage {
        let Some((low, high)) = self.window() else {
            return luma(image);
        };
        let stretched = |value: u32| {
            let share = f64::from(value.saturating_sub(low)) / f64::from(high - low);
            (255.0 * share.min(1.0)).round() as u8
        };
        let (width, height) = (image.width() as usize, image.height() as usize);
        let pixels = if self.top > 255 {
            image
                .into_luma16()
                .into_raw()
                .into_iter()
                .map(|value| stretched(u32::from(value)))
                .collect()
        } else {
            let table: Vec<u8> = (0..=255).map(stretched).collect();
            let mut pixels = image.into_luma8().into_raw();
            for value in &mut pixels {
                *value = table[usize::from(*value)];
            }
            pixels
        };
        GreyImage {
            width,
            height,
            pixels,
        }
    }
}

/// More than eight bits a value.
fn is_deep(image: &DynamicImage) -> bool {
    image.color().bytes_per_pixel() > image.color().channel_count()
}

/// The levels between which all but the tails lie.
fn range_of(image: &DynamicImage, top: u32) -> (u32, u32) {
    let mut counts = vec![0_u64; top as usize + 1];
    if top > 255 {
        for value in image.to_luma16().into_raw() {
            counts[usize::from(value)] += 1;
        }
    } else {
        for value in image.to_luma8().into_raw() {
            counts[usize::from(value)] += 1;
        }
    }
    let total: u64 = counts.iter().sum();
    let tail = (total as f64 * TAIL_SHARE) as u64;
    let first_beyond = |counts: &mut dyn Iterator<Item = (usize, &u64)>| {
        let mut seen = 0;
        for (level, count) in counts {
            seen += count;
            if seen > tail {
                return level as u32;
            }
        }
        0
    };
    (
        first_beyond(&mut counts.iter().enumerate()),
        first_beyond(&mut counts.iter().enumerate().rev()),
    )
}

#[cfg(test)]
mod tests {
    use image::{GrayImage, ImageBuffer, Luma};

    use super::*;

    /// 64 x 64 values from `low` to `high`, and one hot pixel.
    fn deep(low: u16, high: u16) -> DynamicImage {
        let mut image = ImageBuffer::from_fn(64, 64, |x, y| {
            Luma([low + ((u32::from(high - low) * (x + 64 * y)) / 4095) as u16])
        });
        image.put_pixel(0, 63, Luma([65_535]));
        DynamicImage::ImageLuma16(image)
    }

    #[test]
    fn regress_sixteen_bits_of_low_range_are_stretched() {
        // The upper eight bits of 7000 to 8500 are 27 to 33: no keypoint was found in them.
        let frames = [deep(7000, 8500), deep(0, 0), deep(7000, 8500)];
        let levels = Levels::of(&frames);
        let (low, high) = levels.window().unwrap();
        assert!(
            low.abs_diff(7000) < 10 && high.abs_diff(8500) < 10,
            "{low} {high}"
        );
        let warning = levels.warning().unwrap();
        assert_eq!(warning.name, "grey-levels-stretched");
        assert!(warning.message.contains("of 65536"), "{warning}");
        let grey = levels.grey(deep(7000, 8500));
        let (least, most) = (grey.pixels.iter().min(), grey.pixels.iter().max());
        assert_eq!((least, most), (Some(&0), Some(&255)));
        // The same level has the same grey in a frame of another range.
        let other = levels.grey(deep(7750, 7750));
        assert!(other.pixels[0].abs_diff(127) <= 2, "{}", other.pixels[0]);
    }

    #[test]
    fn the_full_range_stays_as_it_is() {
        let frame = deep(0, 65_535);
        let levels = Levels::of(std::slice::from_ref(&frame));
        assert_eq!((levels.window(), levels.warning()), (None, None));
        assert_eq!(levels.grey(frame.clone()), luma(frame));
    }

    #[test]
    fn noise_is_not_stretched() {
        let dark = DynamicImage::ImageLuma8(GrayImage::from_fn(64, 64, |x, y| {
            Luma([((x * 7 + y * 3) % 9) as u8])
        }));
        let levels = Levels::of(&[dark]);
        assert_eq!(levels.window(), None);
        assert_eq!(levels.warning().unwrap().name, "images-without-contrast");
    }

    #[test]
    fn eight_bits_of_low_range_are_stretched() {
        let frame = || {
            DynamicImage::ImageLuma8(GrayImage::from_fn(64, 64, |x, _| Luma([100 + x as u8 / 2])))
        };
        let levels = Levels::of(&[frame()]);
        assert_eq!(levels.window(), Some((100, 131)));
        let grey = levels.grey(frame());
        assert_eq!((grey.pixels[0], grey.pixels[63]), (0, 255));
    }
}
