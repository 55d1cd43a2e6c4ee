//! Whether two images show the same place, without a map and without a calibrated camera.
//!
//! Steps: mutual matches that pass the ratio test; matches that say the same twice (a keypoint with several orientations)
//! count once; RANSAC for a fundamental matrix with samples of eight, better ratios first; its inliers.
//!
//! Rule: the images show the same place when the inliers are at least [`SamePlaceOptions::min_inliers`], occupy at least
//! [`SamePlaceOptions::min_cells`] cells of 8 x 6 in either image, and beyond the eight of the sample are at least three times those that chance
//! gives.
//! Chance: any eight matches have a matrix, and a further wrong one agrees if it lies in a band of +-1.96 sqrt 2 sigma
//! around its line, a share of the height of the image.
//!
//! Degenerate: of a plane, or of two images from one point, the matrix is not unique; all right matches agree with any of
//! the right ones, so that the count is as good. Places that look alike (doors of one kind, a repeated poster) are the same
//! place for this test where their geometry agrees.

use feature_kdtree::{Descriptor, Match, match_mutual};
use mono_geometry::epipolar::{Correspondence, EightPoint, SampsonScorer};
use mono_geometry::ransac::{Options as RansacOptions, Prosac, ransac};
use nalgebra::{Matrix3, Vector2};

use crate::error::{PlaceError, in_range};
use crate::spread::occupied_cells;

/// The keypoints of an image.
#[derive(Debug, Clone, Copy)]
pub struct View<'a> {
    /// Positions, pixels; ideal ones where the lens is known.
    pub pixels: &'a [Vector2<f64>],
    /// Descriptor of each.
    pub descriptors: &'a [Descriptor],
    /// Image width, pixels.
    pub width: usize,
    /// Image height, pixels.
    pub height: usize,
}

/// How to match, and what to ask for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SamePlaceOptions {
    /// Ratio of the distances to the nearest and the second nearest descriptor, 0 to 1.
    pub ratio: f64,
    /// Standard deviation of a coordinate, pixels; lenses that are not undistorted want more.
    pub sigma_px: f64,
    /// Smallest number of inliers.
    pub min_inliers: usize,
    /// Smallest number of cells of 8 x 6 that the inliers occupy in either image.
    pub min_cells: usize,
    /// Most samples drawn.
    pub max_trials: usize,
    /// Seed of the samples.
    pub seed: u64,
}

impl Default for SamePlaceOptions {
    /// Ratio 0.8, sigma 1 pixel, 17 inliers in 6 cells, 2000 samples, seed 0.
    fn default() -> Self {
        Self {
            ratio: 0.8,
            sigma_px: 1.0,
            min_inliers: 17,
            min_cells: 6,
            max_trials: 2000,
            seed: 0,
        }
    }
}

/// How much speaks for one place.
#[derive(Debug, Clone, PartialEq)]
pub struct Evidence {
    /// Mutual matches that pass the ratio test, each pair of positions once.
    pub matches: usize,
    /// Those that agree with one fundamental matrix: positions of the keypoints in the first and in the second image.
    pub inliers: Vec<(usize, usize)>,
    /// F of `p2^T F p1 = 0`; `None` without one.
    pub fundamental: Option<Matrix3<f64>>,
    /// Cells that the inliers occupy, the smaller number of the two images.
    pub cells: usize,
    /// Inliers expected of wrong matches.
    pub by_chance: f64,
    /// Whether the rule of the module is met.
    pub same_place: bool,
}

/// Positions closer than this in both images are one match, pixels.
const SAME_POSITION_PX: f64 = 1.5;
/// Half width of the band around an epipolar line, in standard deviations: 95 % of the right matches.
const BAND: f64 = 1.96;

/// The evidence that two images show one place. O(n1 n2) for the matches; O(trials x matches).
///
/// Keypoints with coordinates that are not finite are left out.
///
/// # Errors
/// [`PlaceError`]: an option out of range, as many descriptors as pixels missing, more keypoints than can be numbered.
pub fn same_place(
    first: &View<'_>,
    second: &View<'_>,
    options: &SamePlaceOptions,
) -> Result<Evidence, PlaceError> {
    in_range("ratio", options.ratio, 0.0..=1.0, "0 to 1")?;
    in_range(
        "sigma_px",
        options.sigma_px,
        1e-6..=1e6,
        "1e-6 to 1e6 pixels",
    )?;
    for view in [first, second] {
        if view.pixels.len() != view.descriptors.len() {
            return Err(PlaceError::Lengths {
                pixels: view.pixels.len(),
                descriptors: view.descriptors.len(),
            });
        }
    }
    let mut matches = match_mutual(first.descriptors, second.descriptors, options.ratio as f32)?;
    matches.sort_by(|a, b| a.ratio.total_cmp(&b.ratio));
    let mut kept: Vec<(usize, usize)> = Vec::new();
    let mut data: Vec<Correspondence> = Vec::new();
    let mut qualities: Vec<f64> = Vec::new();
    for Match {
        query, id, ratio, ..
    } in matches
    {
        let (i, j) = (query as usize, id as usize);
        let pair = Correspondence {
            first: first.pixels[i],
            second: second.pixels[j],
        };
        let finite = pair.first.iter().chain(&pair.second).all(|v| v.is_finite());
        let near = |a: &Vector2<f64>, b: &Vector2<f64>| (a - b).norm() < SAME_POSITION_PX;
        let again = |other: &Correspondence| {
            near(&other.first, &pair.first) && near(&other.second, &pair.second)
        };
        if finite && !data.iter().any(again) {
            kept.push((i, j));
            data.push(pair);
            qualities.push(-f64::from(ratio));
        }
    }
    let height = first.height.min(second.height).max(1) as f64;
    let share = (2.0 * BAND * std::f64::consts::SQRT_2 * options.sigma_px / height).min(1.0);
    let count = data.len();
    let mut evidence = Evidence {
        matches: count,
        inliers: Vec::new(),
        fundamental: None,
        cells: 0,
        by_chance: count.min(8) as f64 + share * count.saturating_sub(8) as f64,
        same_place: false,
    };
    // Fewer than nine matches are no evidence: any eight have a matrix.
    if count < options.min_inliers.max(9) {
        return Ok(evidence);
    }
    let mut sampler = Prosac::new(&qualities);
    sampler.growth_trials = options.max_trials.max(1) as f64;
    let report = ransac(
        &EightPoint,
        &SampsonScorer::pixels(options.sigma_px),
        &mut sampler,
        &data,
        &RansacOptions {
            max_trials: options.max_trials,
            seed: options.seed,
            local_refits: 4,
            min_trials: 60,
            ..RansacOptions::default()
        },
    );
    if let Some(best) = report.best {
        let cells = |pixel: fn(&Correspondence) -> &Vector2<f64>, view: &View<'_>| {
            let pixels = best.inliers.iter().map(|i| pixel(&data[*i]));
            occupied_cells(pixels, view.width, view.height)
        };
        evidence.cells = cells(|c| &c.first, first).min(cells(|c| &c.second, second));
        evidence.fundamental = Some(best.model);
        evidence.inliers = best.inliers.iter().map(|i| kept[*i]).collect();
        evidence.inliers.sort_unstable();
        let inliers = evidence.inliers.len();
        evidence.same_place = inliers >= options.min_inliers
            && evidence.cells >= options.min_cells
            && inliers as f64 >= 8.0 + 3.0 * (evidence.by_chance - 8.0);
    }
    Ok(evidence)
}
