//! Parameters of the detector: their defaults, their ranges, and the scales that follow from them.
//!
//! Source: D. G. Lowe, "Distinctive Image Features from Scale-Invariant Keypoints", IJCV 60(2), 2004, called *Lowe*
//! below.

use crate::conventions::Conventions;
use crate::error::SiftError;

/// The scaling of the 128 values of a descriptor before they become bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[non_exhaustive]
pub enum Normalisation {
    /// Unit length, cut at 0.2, unit length again (Lowe, section 6.1), as OpenCV.
    Lowe,
    /// RootSIFT (Arandjelovic, Zisserman, CVPR 2012): cut at 0.2 of the length, unit *sum*, square root. The length is
    /// again 1, and the Euclidean distance of two descriptors is the Hellinger distance of the histograms, which large
    /// values dominate less. Default: of the matches 0.011 more are right within 1 px, 0.016 within 3 px.
    #[default]
    Root,
}

/// The features that are kept where there are more than `max_features`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[non_exhaustive]
pub enum Selection {
    /// Those with the strongest response, wherever they are.
    #[default]
    Strongest,
    /// Those that are strong where they are: the image is divided into cells, one for every four features wanted, and the
    /// cells take turns, each giving its strongest feature that is left. Features then cover the image where one textured
    /// corner would take them all.
    Spread,
}

/// The parameters of a [`Detector`](crate::Detector), which checks their ranges when it is made.
///
/// Start from [`SiftParams::default`] and change the fields that matter.
#[derive(Debug, Clone, PartialEq)]
pub struct SiftParams {
    /// Keep only this many features, those with the strongest response (or as `selection` says); equal responses: the finer octave, then the
    /// finer level, then the upper row, then the left column. `None` keeps all. At least 1.
    pub max_features: Option<usize>,
    /// Which features these are. Default: the strongest.
    pub selection: Selection,
    /// Double the image before the first octave (Lowe, section 3.3: about four times the keypoints). Default true.
    pub double_image: bool,
    /// Sampled scales per octave, `s` in Lowe, section 3.1. In `[1, 8]`, default 3 (Lowe, Fig. 3).
    pub scales_per_octave: usize,
    /// Contrast threshold in OpenCV's convention: a keypoint is kept when `|D| >= contrast_threshold /
    /// scales_per_octave`, grey values in `[0, 1]`, so that more levels per octave (each a smaller difference) do not
    /// lose keypoints. In `[0.0001, 1]`. Lowe, section 4, keeps `|D| >= 0.03`, which is 0.09 here; OpenCV's default is
    /// 0.04, which is the default here too: some 380 to 660 features in an indoor picture of 320x240.
    pub contrast_threshold: f32,
    /// Largest ratio of principal curvatures, `r` in Lowe, section 4.1: larger means an edge. In `[1, 1000]`, default 10.
    pub edge_ratio: f32,
    /// Scale of the first level of an octave, octave pixels. In `[1.2, 4]`, default 1.6 (Lowe, section 3.3).
    pub base_sigma: f32,
    /// Blur the camera has already put on the image, input pixels. In `[0, 0.55]`, default 0.3: the aperture of a square
    /// pixel, `1 / sqrt(12) = 0.29`. Lowe, section 3.3, and OpenCV assume 0.5 and so blur less; then the finest level
    /// keeps more of the noise and fewer of its extrema return in a second picture (repeatability 0.035 lower). With 0
    /// it is 0.02 higher again, but noisy large pictures give fewer keypoints than OpenCV finds in them.
    pub camera_sigma: f32,
    /// The scaling of the descriptors. Two descriptors can be compared only when both have the same.
    pub normalisation: Normalisation,
    /// The choices that the paper leaves open: those of this crate (default) or of OpenCV, see [`SiftParams::opencv`].
    pub conventions: Conventions,
}

impl Default for SiftParams {
    fn default() -> Self {
        Self {
            max_features: None,
            selection: Selection::Strongest,
            double_image: true,
            scales_per_octave: 3,
            contrast_threshold: 0.04,
            edge_ratio: 10.0,
            base_sigma: 1.6,
            camera_sigma: 0.3,
            normalisation: Normalisation::Root,
            conventions: Conventions::default(),
        }
    }
}

impl SiftParams {
    /// The parameters that give the keypoints and descriptors of OpenCV's `SIFT_create()`, for comparisons and for matching
    /// against descriptors made there.
    ///
    /// Positions are a quarter pixel too large, as they are there.
    /// `SiftParams { conventions: Conventions::opencv_precise(), ..SiftParams::opencv() }` corresponds to OpenCV's
    /// `enable_precise_upscale` and has exact positions.
    #[must_use]
    pub fn opencv() -> Self {
        Self {
            max_features: None,
            selection: Selection::Strongest,
            double_image: true,
            scales_per_octave: 3,
            contrast_threshold: 0.04,
            edge_ratio: 10.0,
            base_sigma: 1.6,
            camera_sigma: 0.5,
            normalisation: Normalisation::Lowe,
            conventions: Conventions::opencv(),
        }
    }

    /// Checks the range of every field.
    ///
    /// # Errors
    /// [`SiftError::ParameterOutOfRange`] for the first field that lies outside.
    pub fn check(&self) -> Result<(), SiftError> {
        if let Some(n) = self.max_features {
            in_range("max_features", n as f64, 1.0, f64::MAX)?;
        }
        in_range("scales_per_octave", self.scales_per_octave as f64, 1.0, 8.0)?;
        in_range(
            "contrast_threshold",
            f64::from(self.contrast_threshold),
            f64::from(1e-4_f32),
            1.0,
        )?;
        in_range("edge_ratio", f64::from(self.edge_ratio), 1.0, 1000.0)?;
        in_range(
            "base_sigma",
            f64::from(self.base_sigma),
            f64::from(1.2_f32),
            4.0,
        )?;
        in_range(
            "camera_sigma",
            f64::from(self.camera_sigma),
            0.0,
            f64::from(0.55_f32),
        )
    }

    /// The smallest `|D|` of a keypoint, for grey values in `[0, 1]`.
    pub(crate) fn min_contrast(&self) -> f32 {
        self.contrast_threshold / self.scales_per_octave as f32
    }

    /// The scale of a level of an octave, which may be fractional, in octave pixels: `sigma_0 2^(level / s)`.
    pub(crate) fn level_sigma(&self, level: f32) -> f32 {
        self.base_sigma * (level / self.scales_per_octave as f32).exp2()
    }

    /// The number of input pixels per pixel of octave `octave`.
    pub(crate) fn octave_step(&self, octave: usize) -> f32 {
        let first = if self.double_image { 0.5 } else { 1.0 };
        first * (1_u64 << octave) as f32
    }
}

fn in_range(name: &'static str, value: f64, minimum: f64, maximum: f64) -> Result<(), SiftError> {
    // Written so that NaN fails.
    if value >= minimum && value <= maximum {
        Ok(())
    } else {
        Err(SiftError::ParameterOutOfRange {
            name,
            value,
            minimum,
            maximum,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_field_is_checked() {
        type Spoil = fn(&mut SiftParams);
        assert_eq!(SiftParams::default().check(), Ok(()));
        let bad: [(&str, Spoil); 9] = [
            ("max_features", |p| p.max_features = Some(0)),
            ("scales_per_octave", |p| p.scales_per_octave = 0),
            ("scales_per_octave", |p| p.scales_per_octave = 9),
            ("contrast_threshold", |p| p.contrast_threshold = 0.0),
            ("contrast_threshold", |p| p.contrast_threshold = f32::NAN),
            ("edge_ratio", |p| p.edge_ratio = 0.5),
            ("base_sigma", |p| p.base_sigma = 1.0),
            ("base_sigma", |p| p.base_sigma = f32::INFINITY),
            ("camera_sigma", |p| p.camera_sigma = -0.1),
        ];
        for (expected, spoil) in bad {
            let mut params = SiftParams::default();
            spoil(&mut params);
            match params.check() {
                Err(SiftError::ParameterOutOfRange { name, .. }) => assert_eq!(name, expected),
                other => panic!("{expected}: {other:?}"),
            }
        }
    }

    #[test]
    fn an_octave_doubles_the_scale() {
        let p = SiftParams::default();
        assert!((p.level_sigma(3.0) - 2.0 * p.base_sigma).abs() < 1e-6);
        assert_eq!(p.octave_step(0), 0.5);
        assert_eq!(p.octave_step(3), 4.0);
        assert_eq!(
            SiftParams {
                double_image: false,
                ..p
            }
            .octave_step(1),
            2.0
        );
    }
}
