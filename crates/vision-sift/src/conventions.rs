//! The choices that the paper leaves open and that implementations of SIFT make differently, as named switches.
//!
//! [`Conventions::default`] holds the choices of this crate, [`Conventions::opencv`] and [`Conventions::opencv_precise`]
//! those of OpenCV 5.0.0's `SIFT_create()` on a CPU, checked against its output (`tests/it/opencv_mode.rs`).
//!
//! | switch | own | OpenCV | stage |
//! |---|---|---|---|
//! | doubling | `2w - 1` samples, exact | `2w` samples: shifted by a quarter pixel, or the last repeated | scale space |
//! | half of an odd side | rounded up | rounded down | scale space |
//! | kernel | radius `round(3 sigma)`, variance exact | radius `floor(round(8 sigma + 1) / 2)` | scale space |
//! | offset accepted | up to 0.6 | below 0.5 | refinement |
//! | fit that can move no further | kept up to an offset of 1 | rejected | refinement |
//! | gradient between two orientation bins | shared linearly | to the nearest | orientation |
//! | centre of the windows | refined position | sample the refinement settled on | orientation, descriptor |
//! | windows of the coarsest level | in the next octave, every second sample | in the point's octave | orientation, descriptor |
//! | orientation window | samples within `4.5 sigma` | that length rounded | orientation |
//! | arctangent | degree 11, error 2.5e-6 | degree 7, error 1.7e-4 | orientation, descriptor |
//!
//! Two further differences have next to no effect and no switch: OpenCV rounds the contrast threshold before the
//! refinement down to whole grey values, and takes every sample of a plateau of the difference of Gaussians for an
//! extremum. Of 75 000 keypoints on photographs (five settings) the first changes none and the second two; only drawn
//! patterns of equal squares have plateaus enough to show it.

use crate::constants::{
    ARCTANGENT, Arctangent, KERNEL_REACH_SIGMAS, MAX_LAST_OFFSET, MAX_REFINE_OFFSET,
    OPENCV_ARCTANGENT, ORIENTATION_REACH_SIGMAS, ORIENTATION_SIGMA_FACTOR,
};
use crate::points::{OffsetLimits, ScalePoint};

/// A set of the choices that the paper leaves open: those of this crate (the default) or those of OpenCV.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Conventions {
    pub(crate) doubling: Doubling,
    pub(crate) odd_sides_round_down: bool,
    pub(crate) wide_kernels: bool,
    pub(crate) offsets_below_half: bool,
    pub(crate) windows_on_sample: bool,
    pub(crate) windows_in_own_octave: bool,
    pub(crate) orientation_radius_rounds: bool,
    pub(crate) orientations_to_nearest_bin: bool,
    pub(crate) coarse_arctangent: bool,
}

/// The places of the samples of the doubled image, for rows of `w` input samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Doubling {
    /// `2w - 1` samples; sample `2x` is sample `x`.
    Exact,
    /// `2w` samples; sample `2x` is sample `x`, and the last is repeated.
    LastRepeated,
    /// `2w` samples at `x / 2 - 1/4`: the area of each pixel is cut in two. Coordinates are not corrected for the quarter.
    Area,
}

impl Default for Conventions {
    /// The choices of this crate.
    fn default() -> Self {
        Self {
            doubling: Doubling::Exact,
            odd_sides_round_down: false,
            wide_kernels: false,
            offsets_below_half: false,
            windows_on_sample: false,
            windows_in_own_octave: false,
            orientation_radius_rounds: false,
            orientations_to_nearest_bin: false,
            coarse_arctangent: false,
        }
    }
}

impl Conventions {
    /// The choices of OpenCV with `enable_precise_upscale = false`, its default. Coordinates are a quarter pixel too large,
    /// as they are there.
    #[must_use]
    pub fn opencv() -> Self {
        Self {
            doubling: Doubling::Area,
            ..Self::opencv_precise()
        }
    }

    /// The choices of OpenCV with `enable_precise_upscale = true`.
    #[must_use]
    pub fn opencv_precise() -> Self {
        Self {
            doubling: Doubling::LastRepeated,
            odd_sides_round_down: true,
            wide_kernels: true,
            offsets_below_half: true,
            windows_on_sample: true,
            windows_in_own_octave: true,
            orientation_radius_rounds: true,
            orientations_to_nearest_bin: true,
            coarse_arctangent: true,
        }
    }

    /// The length of a side in the next octave.
    pub(crate) fn halved(self, side: usize) -> usize {
        if self.odd_sides_round_down {
            side / 2
        } else {
            side.div_ceil(2)
        }
    }

    /// The radius of a Gaussian kernel, samples.
    pub(crate) fn kernel_radius(self, sigma: f32) -> usize {
        if self.wide_kernels {
            (8.0 * sigma + 1.0).round() as usize / 2
        } else {
            (KERNEL_REACH_SIGMAS * sigma).round().max(1.0) as usize
        }
    }

    /// The offsets that the refinement accepts.
    pub(crate) fn offset_limits(self) -> OffsetLimits {
        if self.offsets_below_half {
            let below_half = 0.5_f32.next_down();
            OffsetLimits {
                settled: below_half,
                last: below_half,
            }
        } else {
            OffsetLimits {
                settled: MAX_REFINE_OFFSET,
                last: MAX_LAST_OFFSET,
            }
        }
    }

    /// The centre of the orientation and descriptor windows, octave pixels.
    pub(crate) fn window_centre(self, point: &ScalePoint) -> (f32, f32) {
        if self.windows_on_sample {
            (point.sample.x as f32, point.sample.y as f32)
        } else {
            (point.x, point.y)
        }
    }

    /// The polynomial of the arctangent.
    pub(crate) fn arctangent(self) -> Arctangent {
        if self.coarse_arctangent {
            OPENCV_ARCTANGENT
        } else {
            ARCTANGENT
        }
    }

    /// Half the side of the orientation window of a point of scale `sigma`, octave pixels.
    pub(crate) fn orientation_radius(self, sigma: f32) -> f32 {
        let radius = ORIENTATION_REACH_SIGMAS * (ORIENTATION_SIGMA_FACTOR * sigma);
        if self.orientation_radius_rounds {
            radius.round()
        } else {
            radius
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::points::Sample;

    #[test]
    fn each_switch_takes_both_ways() {
        let (own, opencv) = (Conventions::default(), Conventions::opencv());
        assert_eq!([own.halved(41), own.halved(40)], [21, 20]);
        assert_eq!([opencv.halved(41), opencv.halved(40)], [20, 20]);
        // The five scales of an octave at the defaults, sigma 1.23 to 3.09; OpenCV's kernels have 11, 13, 17, 21 and 27
        // taps.
        let sigmas = [1.226_273, 1.545_008, 1.946_588, 2.452_547, 3.090_016];
        assert_eq!(sigmas.map(|s| own.kernel_radius(s)), [4, 5, 6, 7, 9]);
        assert_eq!(sigmas.map(|s| opencv.kernel_radius(s)), [5, 6, 8, 10, 13]);
        let limits = own.offset_limits();
        assert_eq!([limits.settled, limits.last], [0.6, 1.0]);
        let limits = opencv.offset_limits();
        assert!(limits.settled < 0.5 && limits.settled > 0.499_999_9);
        assert_eq!(limits.last, limits.settled);
        assert_eq!(own.arctangent(), ARCTANGENT);
        assert_eq!(opencv.arctangent(), OPENCV_ARCTANGENT);
        assert_eq!(own.orientation_radius(2.0), 9.0);
        assert!((own.orientation_radius(1.9) - 8.55).abs() < 1e-5);
        assert_eq!(opencv.orientation_radius(1.9), 9.0);
        let point = ScalePoint {
            sample: Sample {
                level: 2,
                y: 9,
                x: 7,
            },
            x: 7.25,
            y: 8.75,
            level: 2.0,
            response: 0.1,
        };
        assert_eq!(own.window_centre(&point), (7.25, 8.75));
        assert_eq!(opencv.window_centre(&point), (7.0, 9.0));
    }
}
