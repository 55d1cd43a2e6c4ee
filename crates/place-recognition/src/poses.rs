//! Poses from which the candidates could have been seen: sequential RANSAC with P3P, region by region.
//!
//! Problem: of some hundred candidates of keypoint and landmark most are wrong, and two equal posters make two right
//! answers. Find every pose that enough candidates agree on.
//!
//! Steps:
//! 1. The candidates vote for a region of the map ([`crate::regions`]); regions with fewer different keypoints than a pose
//!    needs are passed over.
//! 2. In the region samples of three, better matches first (PROSAC), give poses by P3P, which planes do not disturb. A
//!    pose is scored with the projected uncertainty of the landmarks ([`crate::projection`]); a new best is refitted.
//! 3. The pose is refined on all remaining candidates that agree with it, the region's or not, until the set settles. Each
//!    keypoint and each landmark counts once, with the candidate of the smallest error.
//! 4. It is accepted with enough inliers, spread over the image, and more than chance gives; a second finding of an
//!    accepted pose is dropped. Then all candidates that agree with it are taken out, and the search goes on. Other
//!    candidates of their keypoints stay, so that a keypoint may support two hypotheses through different landmarks.
//!
//! Chance: a wrong candidate agrees with a wrong pose if its pixel happens to lie in the ellipse of its landmark, of area
//! pi T sqrt(det S), in an image of that many square pixels. The sum over all candidates in view is the number expected.
//!
//! Degenerate: fewer matches than a pose needs, or unusable numbers, give no hypothesis, not an error.

use mono_geometry::pnp::p3p;
use mono_geometry::ransac::{Options as RansacOptions, Prosac, Scorer, Solver, ransac};
use mono_geometry::{Pinhole, Se3};
use nalgebra::Matrix6;
use std::collections::BTreeSet;

use crate::error::{PlaceError, in_range};
use crate::point_match::PointMatch;
use crate::projection::{residual, score, square};
use crate::refine::{Refined, refine};
use crate::regions::Regions;
use crate::spread::occupied_cells;

/// How long to search, and when to believe a pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PoseOptions {
    /// Most hypotheses returned.
    pub max_hypotheses: usize,
    /// Smallest number of inliers, at least 4.
    pub min_inliers: usize,
    /// Smallest number of cells, of 8 x 6 over the image, that the inliers occupy; a blob smaller than a cell has 4 at most.
    pub min_cells: usize,
    /// Largest score of an inlier, in variances: a chi-square quantile of two degrees of freedom.
    pub threshold: f64,
    /// Radius of a region, as a share of the median depth of the landmarks.
    pub reach: f64,
    /// Most regions searched.
    pub max_regions: usize,
    /// Most samples drawn in a region.
    pub max_trials: usize,
    /// Probability of having drawn a sample of right matches before a region is given up, where the samples suffice.
    pub confidence: f64,
    /// Seed of the samples.
    pub seed: u64,
}

impl Default for PoseOptions {
    /// 4 hypotheses of 12 inliers in 5 cells or more, 99 % of the right matches (9.21), regions of one median depth, 8
    /// regions, 3000 samples in each, confidence 0.999, seed 0.
    fn default() -> Self {
        Self {
            max_hypotheses: 4,
            min_inliers: 12,
            min_cells: 5,
            threshold: 9.21,
            reach: 1.0,
            max_regions: 8,
            max_trials: 3000,
            confidence: 0.999,
            seed: 0,
        }
    }
}

impl PoseOptions {
    fn check(&self) -> Result<(), PlaceError> {
        in_range(
            "min_inliers",
            self.min_inliers as f64,
            4.0..=f64::MAX,
            "at least 4",
        )?;
        in_range(
            "threshold",
            self.threshold,
            f64::MIN_POSITIVE..=1e6,
            "above 0, at most 1e6",
        )?;
        in_range("reach", self.reach, 0.0..=f64::MAX, "at least 0, finite")?;
        in_range("confidence", self.confidence, 0.0..=1.0, "0 to 1")
    }
}

/// A pose from which the image may have been taken.
#[derive(Debug, Clone, PartialEq)]
pub struct PlaceHypothesis {
    /// The pose, metres.
    pub world_from_camera: Se3,
    /// Covariance of delta = (rho, omega) in `world_from_camera * exp(delta)`, camera axes (as of
    /// [`mono_geometry::pnp::PoseEstimate`]); m^2, m rad, rad^2. Errors of pixels and landmarks taken as independent.
    pub covariance: Matrix6<f64>,
    /// Positions of the inliers among the matches given, ascending; every keypoint and every landmark at most once.
    pub inliers: Vec<usize>,
    /// Sum of e^T S^-1 e over the inliers.
    pub chi_square: f64,
    /// Cells that the inliers occupy, of 8 x 6 over the image.
    pub cells: usize,
    /// Number of candidates that a wrong pose would be expected to agree with by chance.
    pub by_chance: f64,
    /// Samples drawn until it was found, those of regions without a pose included.
    pub trials: usize,
}

impl PlaceHypothesis {
    /// 2 n - 6 for n inliers.
    #[must_use]
    pub fn degrees_of_freedom(&self) -> usize {
        (2 * self.inliers.len()).saturating_sub(6)
    }
}

/// The poses that the matches agree on, most inliers first; empty where there is none.
///
/// Unusable matches (numbers that are not finite, a sigma of zero) are left out. Deterministic by the seed. Time: a few
/// milliseconds for some hundred matches; at most `max_regions * max_trials` samples.
///
/// # Errors
/// [`PlaceError::Option`].
///
/// ```
/// use mono_geometry::{NoiseShape, Pinhole};
/// use nalgebra::{Matrix3, Vector3};
/// use place_recognition::{CandidateOptions, PlaceIndex, PointMatch, PoseOptions, poses};
///
/// // Forty landmarks, each with a descriptor of its own.
/// let point = |id: u32| {
///     let k = f64::from(id);
///     Vector3::new((k * 1.7).sin() * 2.0, (k * 2.9).sin() * 1.5, 5.0 + (k * 0.7).cos())
/// };
/// let descriptor = |id: u32| std::array::from_fn(|i| ((id as usize * 37 + 1) * (i + 3) * 71 % 251) as u8);
/// let mut index = PlaceIndex::new();
/// for id in 0..40 {
///     index.insert(id, &descriptor(id))?;
/// }
///
/// // A camera at the origin sees all of them.
/// let pinhole = Pinhole { width: 640, height: 480, fx: 400.0, fy: 400.0, cx: 319.5, cy: 239.5 };
/// let pixels: Vec<_> = (0..40).map(|id| pinhole.project(&point(id)).expect("in front")).collect();
/// let descriptors: Vec<_> = (0..40).map(descriptor).collect();
///
/// let candidates = index.candidates(&descriptors, &CandidateOptions::default())?;
/// let matches: Vec<PointMatch> = candidates
///     .iter()
///     .map(|c| PointMatch {
///         keypoint: c.keypoint,
///         landmark: c.landmark,
///         point_in_world: point(c.landmark),
///         point_covariance: Matrix3::identity() * 1e-4,
///         seen_from: Vector3::zeros(),
///         pixel_ideal: pixels[c.keypoint],
///         sigma_px: 0.5,
///         shape: NoiseShape::ROUND,
///         quality: c.quality,
///     })
///     .collect();
/// let places = poses(&pinhole, &matches, &PoseOptions::default())?;
/// assert_eq!(places.len(), 1);
/// assert!(places[0].world_from_camera.translation.norm() < 0.01);
/// # Ok::<(), place_recognition::PlaceError>(())
/// ```
pub fn poses(
    pinhole: &Pinhole,
    matches: &[PointMatch],
    options: &PoseOptions,
) -> Result<Vec<PlaceHypothesis>, PlaceError> {
    poses_where(pinhole, matches, options, &|_| true)
}

/// As [`poses`], of poses `world_from_camera` that `plausible` takes only.
///
/// A camera fixed on a robot has a known height and tilt: a test of these costs nothing, drops most poses of wrong samples
/// before they are scored, and leaves fewer places to confuse. It is asked about rough poses of three points, so it should
/// allow for some tenths of a radian.
///
/// # Errors
/// [`PlaceError::Option`].
pub fn poses_where(
    pinhole: &Pinhole,
    matches: &[PointMatch],
    options: &PoseOptions,
    plausible: &dyn Fn(&Se3) -> bool,
) -> Result<Vec<PlaceHypothesis>, PlaceError> {
    options.check()?;
    let mut remaining: Vec<usize> = (0..matches.len())
        .filter(|i| matches[*i].is_usable())
        .collect();
    let usable: Vec<PointMatch> = remaining.iter().map(|i| matches[*i]).collect();
    let original = std::mem::replace(&mut remaining, (0..usable.len()).collect());
    let search = Search {
        pinhole,
        matches: &usable,
        options,
        plausible,
    };
    let mut found: Vec<PlaceHypothesis> = Vec::new();
    let mut trials = 0;
    let mut regions = Regions::new(&usable, options.reach);
    for number in 0..options.max_regions as u64 {
        if found.len() >= options.max_hypotheses {
            break;
        }
        let Some(mut region) = regions.next(&usable, &remaining, options.min_inliers) else {
            break;
        };
        // A region may hold two equal posters: it is searched until it has no pose left.
        let mut attempts = 0;
        while found.len() < options.max_hypotheses && attempts < ATTEMPTS {
            attempts += 1;
            let seed = options
                .seed
                .wrapping_add(number + options.max_regions as u64 * attempts);
            let (pose, drawn) = search.best_pose(&region, seed);
            trials += drawn;
            let Some(settled) = pose.and_then(|pose| search.settle(pose, &remaining)) else {
                continue;
            };
            let agreeing: BTreeSet<usize> = settled.agreeing.iter().copied().collect();
            match search.judge(&settled, trials) {
                Ok(hypothesis) => {
                    remaining.retain(|index| !agreeing.contains(index));
                    region.retain(|index| !agreeing.contains(index));
                    if !found.iter().any(|other| search.same(other, &hypothesis)) {
                        found.push(hypothesis);
                    }
                    attempts = 0;
                }
                // They would hide another pose of this region, but may belong to one of the next.
                Err(Refusal::Blob) => region.retain(|index| !agreeing.contains(index)),
                // A bad sample of a right pose may do that: other samples are drawn.
                Err(Refusal::Few) => {}
            }
            let keypoints: BTreeSet<usize> = region.iter().map(|i| usable[*i].keypoint).collect();
            if keypoints.len() < options.min_inliers {
                break;
            }
        }
    }
    for hypothesis in &mut found {
        for index in &mut hypothesis.inliers {
            *index = original[*index];
        }
    }
    found.sort_by_key(|hypothesis| std::cmp::Reverse(hypothesis.inliers.len()));
    Ok(found)
}

/// Everything that stays the same from region to region.
struct Search<'a> {
    pinhole: &'a Pinhole,
    matches: &'a [PointMatch],
    options: &'a PoseOptions,
    plausible: &'a dyn Fn(&Se3) -> bool,
}

/// A pose on a set that no longer changes.
struct Settled {
    refined: Refined,
    /// All that agree with it.
    agreeing: Vec<usize>,
    /// Those of them that count: one a keypoint, one a landmark.
    inliers: Vec<usize>,
}

/// Why a pose is no hypothesis.
enum Refusal {
    /// Fewer inliers than required.
    Few,
    /// Inliers enough, but in few cells, or of a pose that is not plausible.
    Blob,
}

/// Searches of a region without a pose.
const ATTEMPTS: u64 = 2;
/// Samples drawn at least: one that is right but narrow finds a part of the inliers only.
const MIN_TRIALS: usize = 60;
/// Rounds at the beginning of refinement in which the threshold is four times as large, so that a rough pose finds all.
const WIDE_ROUNDS: usize = 2;
/// Rounds in which pose and inliers follow one another; a cycle is cut there.
const ROUNDS: usize = 8;
/// Poses that differ by less than this share of the median depth, and by less than this angle (rad), are one.
const SAME_POSE: f64 = 0.05;

impl Search<'_> {
    /// The pose of lowest cost in a region, and the samples drawn.
    fn best_pose(&self, region: &[usize], seed: u64) -> (Option<Se3>, usize) {
        let data: Vec<PointMatch> = region.iter().map(|index| self.matches[*index]).collect();
        // A depth known to a tenth halves the worth of a sample.
        let worth = |m: &PointMatch| m.quality / (1.0 + 10.0 * m.relative_depth_sigma());
        let mut sampler = Prosac::new(&data.iter().map(worth).collect::<Vec<f64>>());
        sampler.growth_trials = self.options.max_trials.max(1) as f64;
        let report = ransac(
            &PoseSolver(self),
            &PoseScorer(self),
            &mut sampler,
            &data,
            &RansacOptions {
                confidence: self.options.confidence,
                min_trials: MIN_TRIALS,
                max_trials: self.options.max_trials,
                local_refits: 4,
                seed,
            },
        );
        // A pose always has its own sample.
        let pose = report.best.filter(|best| best.inliers.len() > 3);
        (pose.map(|best| best.model.world_from_camera), report.trials)
    }

    /// Refines a pose on all `remaining` matches that agree with it, until the set no longer changes.
    fn settle(&self, start: Se3, remaining: &[usize]) -> Option<Settled> {
        let mut pose = start;
        let mut last: Option<(Refined, Vec<usize>)> = None;
        for round in 0..ROUNDS {
            let threshold = if round < WIDE_ROUNDS { 4.0 } else { 1.0 } * self.options.threshold;
            let (agreeing, inliers) = self.agreeing(&pose, remaining, threshold);
            if inliers.len() < 4 {
                return None;
            }
            if let Some((refined, before)) = &last
                && round > WIDE_ROUNDS
                && *before == inliers
            {
                return Some(Settled {
                    refined: *refined,
                    agreeing,
                    inliers,
                });
            }
            let refined = refine(self.pinhole, &pose, self.matches, &inliers, 20)?;
            pose = refined.world_from_camera;
            last = Some((refined, inliers));
        }
        let (refined, inliers) = last?;
        let threshold = self.options.threshold;
        let (agreeing, _) = self.agreeing(&refined.world_from_camera, remaining, threshold);
        Some(Settled {
            refined,
            agreeing,
            inliers,
        })
    }

    /// All matches within the threshold, and those of smallest error of each keypoint and each landmark; both ascending.
    fn agreeing(
        &self,
        world_from_camera: &Se3,
        among: &[usize],
        threshold: f64,
    ) -> (Vec<usize>, Vec<usize>) {
        let camera_from_world = world_from_camera.inverse();
        let mut scored: Vec<(f64, usize)> = among
            .iter()
            .map(|index| {
                let m = &self.matches[*index];
                (
                    square(self.pinhole, &camera_from_world, m, threshold),
                    *index,
                )
            })
            .filter(|(square, _)| *square <= threshold)
            .collect();
        let agreeing = scored.iter().map(|(_, index)| *index).collect();
        scored.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (mut keypoints, mut landmarks) = (BTreeSet::new(), BTreeSet::new());
        let mut inliers: Vec<usize> = Vec::new();
        for (_, index) in scored {
            let m = &self.matches[index];
            if !keypoints.contains(&m.keypoint) && !landmarks.contains(&m.landmark) {
                keypoints.insert(m.keypoint);
                landmarks.insert(m.landmark);
                inliers.push(index);
            }
        }
        inliers.sort_unstable();
        (agreeing, inliers)
    }

    /// The hypothesis of a pose, if it has inliers enough and they are spread.
    fn judge(&self, settled: &Settled, trials: usize) -> Result<PlaceHypothesis, Refusal> {
        let pose = settled.refined.world_from_camera;
        let by_chance = self.by_chance(&pose);
        let pixels = settled
            .inliers
            .iter()
            .map(|i| &self.matches[*i].pixel_ideal);
        let cells = occupied_cells(pixels, self.pinhole.width, self.pinhole.height);
        // The three of the sample agree with any pose, and chance may give some times what is expected of it.
        let required = (self.options.min_inliers as f64).max(3.0 + 3.0 * by_chance);
        if (settled.inliers.len() as f64) < required {
            return Err(Refusal::Few);
        }
        if cells < self.options.min_cells || !(self.plausible)(&pose) {
            return Err(Refusal::Blob);
        }
        Ok(PlaceHypothesis {
            world_from_camera: pose,
            covariance: settled.refined.covariance,
            inliers: settled.inliers.clone(),
            chi_square: settled.refined.chi_square,
            cells,
            by_chance,
            trials,
        })
    }

    /// Number of candidates in view that would agree with this pose if their pixels were anywhere in the image.
    fn by_chance(&self, world_from_camera: &Se3) -> f64 {
        let camera_from_world = world_from_camera.inverse();
        let (width, height) = (self.pinhole.width as f64, self.pinhole.height as f64);
        let ellipse = std::f64::consts::PI * self.options.threshold;
        let share = |m: &PointMatch| {
            let r = residual(self.pinhole, &camera_from_world, m, f64::INFINITY)?;
            let at = r.projected;
            let inside =
                (-0.5..=width - 0.5).contains(&at.x) && (-0.5..=height - 0.5).contains(&at.y);
            let noise = m.shape.covariance(m.sigma_px).determinant();
            let area = (r.covariance.determinant() * noise).sqrt() * ellipse;
            inside.then(|| (area / (width * height).max(1.0)).min(1.0))
        };
        self.matches.iter().filter_map(share).sum()
    }

    /// Whether two poses are one place found twice.
    fn same(&self, a: &PlaceHypothesis, b: &PlaceHypothesis) -> bool {
        let apart = a.world_from_camera.inverse().compose(&b.world_from_camera);
        let depths = a
            .inliers
            .iter()
            .map(|i| (self.matches[*i].point_in_world - a.world_from_camera.translation).norm());
        let mut depths: Vec<f64> = depths.collect();
        depths.sort_unstable_by(f64::total_cmp);
        let depth = depths.get(depths.len() / 2).copied().unwrap_or(0.0);
        apart.translation.norm() < SAME_POSE * depth && apart.rotation.angle() < SAME_POSE
    }
}

/// A pose with its inverse, which scoring needs.
#[derive(Clone, Copy)]
struct PosePair {
    world_from_camera: Se3,
    camera_from_world: Se3,
}

impl PosePair {
    fn new(world_from_camera: Se3) -> Self {
        Self {
            world_from_camera,
            camera_from_world: world_from_camera.inverse(),
        }
    }
}

/// P3P as the minimal solver, a few weighted Gauss-Newton steps as the refit.
struct PoseSolver<'a>(&'a Search<'a>);

impl Solver for PoseSolver<'_> {
    type Datum = PointMatch;
    type Model = PosePair;

    fn sample_size(&self) -> usize {
        3
    }

    fn fit(&self, data: &[PointMatch], sample: &[usize], models: &mut Vec<PosePair>) {
        let [i, j, k] = *sample else { return };
        let chosen = [&data[i], &data[j], &data[k]];
        let twice =
            |a: &PointMatch, b: &PointMatch| a.keypoint == b.keypoint || a.landmark == b.landmark;
        if twice(chosen[0], chosen[1]) || twice(chosen[0], chosen[2]) || twice(chosen[1], chosen[2])
        {
            return;
        }
        let bearings = chosen.map(|m| self.0.pinhole.bearing(&m.pixel_ideal));
        let solutions = p3p(&bearings, &chosen.map(|m| m.point_in_world));
        let plausible = solutions
            .as_slice()
            .iter()
            .filter(|p| (self.0.plausible)(p));
        models.extend(plausible.map(|pose| PosePair::new(*pose)));
    }

    fn refit(&self, data: &[PointMatch], inliers: &[usize], model: &PosePair) -> Option<PosePair> {
        if inliers.len() < 4 {
            return None;
        }
        refine(self.0.pinhole, &model.world_from_camera, data, inliers, 4)
            .map(|refined| PosePair::new(refined.world_from_camera))
    }
}

/// The score of a match, truncated.
struct PoseScorer<'a>(&'a Search<'a>);

impl Scorer<PointMatch, PosePair> for PoseScorer<'_> {
    fn squared_residual(&self, model: &PosePair, datum: &PointMatch) -> f64 {
        score(
            self.0.pinhole,
            &model.camera_from_world,
            datum,
            self.0.options.threshold,
        )
    }

    fn threshold(&self) -> f64 {
        self.0.options.threshold
    }
}
