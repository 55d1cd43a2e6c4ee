//! The stages in order: pyramid, extrema, refinement, orientation, descriptor.
//!
//! [`Detector`] is immutable and may be shared between threads; [`Workspace`] holds all working memory and belongs to one
//! caller at a time.
//!
//! Features come octave by octave from fine to coarse, within an octave by level, row and column of the sample, then by
//! orientation. The order and every value are the same on any number of threads.

use simd_level::SimdLevel;

use crate::constants::{DESCRIPTOR_LENGTH, PREFILTER_SHARE};
use crate::descriptor::{self, Frame, Style, describe};
use crate::error::SiftError;
use crate::extrema;
use crate::features::{Features, Keypoint};
use crate::gradient::prefetch_window;
use crate::image::{GrayImage, Plane};
use crate::kernel::Kernels;
use crate::orientation::{self, OrientationWindow, Orientations, orientations};
use crate::params::{Selection, SiftParams};
use crate::pixel::Pixel;
use crate::refine::{Acceptance, refine};
use crate::scale_space::ScaleSpace;
use crate::strongest::{Grid, keep_spread, keep_strongest};
use crate::threads::{for_each_indexed, for_each_with_scratch};
use crate::workspace::{OctavePoint, OrientedPoint, RowBlock, Workspace};

/// Rows that one parallel task of the extremum search takes.
const BLOCK_ROWS: usize = 32;

/// A stage of a detection, as [`Detector::detect_observed`] reports it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Stage {
    /// Doubling and the Gaussian pyramid.
    ScaleSpace,
    /// Differences of Gaussians, their extrema and the refinement of these.
    Extrema,
    /// Orientations of the points.
    Orientations,
    /// Descriptors of the oriented points.
    Descriptors,
}

impl Stage {
    /// All stages in the order in which they run.
    pub const ALL: [Self; 4] = [
        Self::ScaleSpace,
        Self::Extrema,
        Self::Orientations,
        Self::Descriptors,
    ];
}

/// Finds keypoints and describes them, by parameters that were checked when it was made.
///
/// ```
/// use vision_sift::{Detector, Features, GrayImage, SiftParams, Workspace};
///
/// let detector = Detector::new(SiftParams { max_features: Some(300), ..SiftParams::default() })?;
/// let (mut workspace, mut features) = (Workspace::new(), Features::default());
/// let pixels = vec![128_u8; 320 * 240];
/// detector.detect(&GrayImage::new(320, 240, &pixels)?, &mut workspace, &mut features)?;
/// assert!(features.keypoints.is_empty()); // a blank image
/// # Ok::<(), vision_sift::SiftError>(())
/// ```
#[derive(Debug, Clone)]
pub struct Detector {
    params: SiftParams,
    kernels: Kernels,
    simd: SimdLevel,
}

/// A level of the pyramid, and the centre and scale of a window in its pixels.
struct WindowPlace<'a> {
    plane: &'a Plane,
    x: f32,
    y: f32,
    sigma: f32,
}

impl Detector {
    /// A detector with these parameters.
    ///
    /// # Errors
    /// [`SiftError::ParameterOutOfRange`] for the first parameter outside its range.
    pub fn new(params: SiftParams) -> Result<Self, SiftError> {
        params.check()?;
        let kernels = Kernels::new(&params);
        Ok(Self {
            params,
            kernels,
            simd: SimdLevel::best(),
        })
    }

    /// The same detector on other vector instructions, for tests and measurements. The features are equal bit for bit.
    #[must_use]
    pub fn with_simd(mut self, simd: SimdLevel) -> Self {
        self.simd = simd;
        self
    }

    /// Finds the keypoints of `image` and describes them; `features` is cleared and refilled.
    ///
    /// An image without keypoints (blank, black, saturated) gives empty features. With the feature `parallel` the work
    /// runs on the current rayon pool. Time grows with the pixels and with the features found.
    ///
    /// # Errors
    /// None at present: the image and the parameters were checked when they were made.
    pub fn detect<P: Pixel>(
        &self,
        image: &GrayImage<'_, P>,
        workspace: &mut Workspace,
        features: &mut Features,
    ) -> Result<(), SiftError> {
        self.detect_where(image, None, workspace, features, &mut |_| ());
        Ok(())
    }

    /// Detects as [`Detector::detect`] does and calls `done` after each stage, for measurements of time.
    ///
    /// # Errors
    /// As [`Detector::detect`].
    pub fn detect_observed<P: Pixel>(
        &self,
        image: &GrayImage<'_, P>,
        workspace: &mut Workspace,
        features: &mut Features,
        done: &mut dyn FnMut(Stage),
    ) -> Result<(), SiftError> {
        self.detect_where(image, None, workspace, features, done);
        Ok(())
    }

    /// Detects as [`Detector::detect`] does, but leaves out every keypoint whose nearest pixel of `region` is zero, before
    /// it is oriented, described or counted.
    ///
    /// The pixels outside the region still take part in blurs and windows, so that the region makes no edges of its own.
    ///
    /// # Errors
    /// [`SiftError::RegionSize`] when `region` and `image` differ in size.
    pub fn detect_in_region<P: Pixel>(
        &self,
        image: &GrayImage<'_, P>,
        region: &GrayImage<'_>,
        workspace: &mut Workspace,
        features: &mut Features,
    ) -> Result<(), SiftError> {
        let (given, needed) = (
            (region.width(), region.height()),
            (image.width(), image.height()),
        );
        if given != needed {
            return Err(SiftError::RegionSize { given, needed });
        }
        self.detect_where(image, Some(region), workspace, features, &mut |_| ());
        Ok(())
    }

    /// Runs all stages; keypoints outside the region are dropped after the refinement.
    fn detect_where<P: Pixel>(
        &self,
        image: &GrayImage<'_, P>,
        region: Option<&GrayImage<'_>>,
        workspace: &mut Workspace,
        features: &mut Features,
        done: &mut dyn FnMut(Stage),
    ) {
        features.keypoints.clear();
        features.descriptors.clear();
        let scale_space = &mut workspace.scale_space;
        scale_space.start(self.simd, image, &self.params);
        for octave in 0..scale_space.octaves() {
            scale_space.build_octave(self.simd, octave, &self.kernels);
        }
        done(Stage::ScaleSpace);
        self.find_points(workspace);
        if let Some(region) = region {
            workspace.points.retain(|p| {
                let step = self.params.octave_step(p.octave);
                // Refined positions may lie a little outside the last sample.
                let nearest = |v: f32, n: usize| ((step * v).round().max(0.0) as usize).min(n - 1);
                let x = nearest(p.point.x, region.width());
                region.row(nearest(p.point.y, region.height()))[x] != 0
            });
        }
        self.keep_points(workspace, image.width(), image.height());
        done(Stage::Extrema);
        self.orient(workspace, image.width(), image.height());
        done(Stage::Orientations);
        self.describe(workspace, features);
        done(Stage::Descriptors);
    }

    /// Finds and refines the extrema of all octaves into `workspace.points`.
    fn find_points(&self, workspace: &mut Workspace) {
        let Workspace {
            scale_space,
            blocks,
            points,
            ..
        } = workspace;
        let accept = Acceptance {
            min_contrast: self.params.min_contrast(),
            edge_ratio: self.params.edge_ratio,
            offsets: self.params.conventions.offset_limits(),
        };
        points.clear();
        for octave in 0..scale_space.octaves() {
            let differences = scale_space.differences(octave);
            let height = differences.height();
            let used = height.div_ceil(BLOCK_ROWS);
            if blocks.len() < used {
                blocks.resize_with(used, RowBlock::default);
            }
            for_each_indexed(&mut blocks[..used], |block, found| {
                found.candidates.clear();
                found.points.clear();
                extrema::scan(
                    self.simd,
                    differences,
                    block * BLOCK_ROWS..((block + 1) * BLOCK_ROWS).min(height),
                    PREFILTER_SHARE * accept.min_contrast,
                    &mut found.scratch,
                    &mut found.candidates,
                );
                let refined = found
                    .candidates
                    .iter()
                    .filter_map(|&sample| refine(differences, sample, &accept));
                found.points.extend(refined);
            });
            let first = points.len();
            points.extend(
                blocks[..used]
                    .iter()
                    .flat_map(|block| &block.points)
                    .map(|&point| OctavePoint { octave, point }),
            );
            points[first..].sort_unstable_by_key(|p| p.point.sample);
        }
        // Two candidates that settled on one sample have the same fit.
        points.dedup_by_key(|p| (p.octave, p.point.sample));
    }

    /// Drops the points that cannot be among the strongest features wanted.
    fn keep_points(&self, workspace: &mut Workspace, width: usize, height: usize) {
        let Some(limit) = self.params.max_features else {
            return;
        };
        // Every point with an orientation gives a feature, so no weaker point can be among the strongest features.
        let (response, key) = (
            |p: &OctavePoint| p.point.response,
            |p: &OctavePoint| (p.octave, p.point.sample),
        );
        match self.params.selection {
            Selection::Strongest => keep_strongest(&mut workspace.points, limit, response, key),
            Selection::Spread => {
                let grid = Grid::new(width, height, limit);
                let cell = |p: &OctavePoint| {
                    let step = self.params.octave_step(p.octave);
                    grid.cell(step * p.point.x, step * p.point.y)
                };
                keep_spread(&mut workspace.points, limit, response, key, cell);
            }
        }
    }

    /// The place of the windows of a point: on the Gaussian level nearest in scale.
    ///
    /// The next octave begins with every second sample of the coarsest of these levels. The windows of its points are read
    /// from there: a quarter of the gradients say nearly as much.
    fn window_place<'a>(
        &self,
        scale_space: &'a ScaleSpace,
        OctavePoint { octave, point }: OctavePoint,
    ) -> WindowPlace<'a> {
        let conventions = self.params.conventions;
        let sigma = self.params.level_sigma(point.level);
        let (x, y) = conventions.window_centre(&point);
        let level = point.sample.level;
        let halved = !conventions.windows_in_own_octave
            && level == self.params.scales_per_octave
            && octave + 1 < scale_space.octaves();
        if halved {
            WindowPlace {
                plane: scale_space.gaussian(octave + 1, 0),
                x: 0.5 * x,
                y: 0.5 * y,
                sigma: 0.5 * sigma,
            }
        } else {
            let plane = scale_space.gaussian(octave, level);
            WindowPlace { plane, x, y, sigma }
        }
    }

    /// Writes one entry into `workspace.oriented` for each orientation of each point.
    fn orient(&self, workspace: &mut Workspace, width: usize, height: usize) {
        let Workspace {
            scale_space,
            points,
            orientations: found,
            oriented,
            ..
        } = workspace;
        let conventions = self.params.conventions;
        let scale_space = &*scale_space;
        found.clear();
        found.resize(points.len(), Orientations::default());
        let window_of = |point: OctavePoint| {
            let WindowPlace { plane, x, y, sigma } = self.window_place(scale_space, point);
            let window = OrientationWindow {
                x,
                y,
                sigma,
                radius: conventions.orientation_radius(sigma),
                arctangent: conventions.arctangent(),
                to_nearest_bin: conventions.orientations_to_nearest_bin,
            };
            (plane, window)
        };
        for_each_with_scratch(found, orientation::Scratch::new, |i, out, scratch| {
            if let Some(&next) = points.get(i + 1) {
                let (plane, window) = window_of(next);
                prefetch_window(plane, window.x, window.y, window.radius);
            }
            let (plane, window) = window_of(points[i]);
            *out = orientations(self.simd, plane, window, scratch);
        });
        oriented.clear();
        for (index, (point, orientations)) in points.iter().zip(&*found).enumerate() {
            let response = point.point.response;
            let angles = orientations.angles().iter().enumerate();
            oriented.extend(angles.map(|(rank, &angle)| OrientedPoint {
                index,
                rank,
                angle,
                response,
            }));
        }
        if let Some(limit) = self.params.max_features {
            let (response, key) = (
                |p: &OrientedPoint| p.response,
                |p: &OrientedPoint| (p.index, p.rank),
            );
            match self.params.selection {
                Selection::Strongest => keep_strongest(oriented, limit, response, key),
                Selection::Spread => {
                    let grid = Grid::new(width, height, limit);
                    let cell = |p: &OrientedPoint| {
                        let OctavePoint { octave, point } = points[p.index];
                        let step = self.params.octave_step(octave);
                        grid.cell(step * point.x, step * point.y)
                    };
                    keep_spread(oriented, limit, response, key, cell);
                }
            }
        }
    }

    /// Writes the keypoints and descriptors of `workspace.oriented` into `features`.
    fn describe(&self, workspace: &Workspace, features: &mut Features) {
        let Workspace {
            scale_space,
            points,
            oriented,
            ..
        } = workspace;
        features.keypoints.extend(oriented.iter().map(
            |&OrientedPoint {
                 index,
                 angle,
                 response,
                 ..
             }| {
                let OctavePoint { octave, point } = points[index];
                let step = self.params.octave_step(octave);
                let sigma = step * self.params.level_sigma(point.level);
                Keypoint {
                    x: step * point.x,
                    y: step * point.y,
                    sigma,
                    angle,
                    response,
                }
            },
        ));
        let style = Style {
            normalisation: self.params.normalisation,
            arctangent: self.params.conventions.arctangent(),
        };
        features
            .descriptors
            .resize(oriented.len(), [0; DESCRIPTOR_LENGTH]);
        let frame_of = |&OrientedPoint { index, angle, .. }: &OrientedPoint| {
            let WindowPlace { plane, x, y, sigma } = self.window_place(scale_space, points[index]);
            (plane, Frame { x, y, sigma, angle })
        };
        let descriptors = &mut features.descriptors;
        for_each_with_scratch(descriptors, descriptor::Scratch::new, |i, out, scratch| {
            // A point with several orientations has its window at hand.
            let next = oriented.get(i + 1);
            if let Some(next) = next.filter(|next| next.index != oriented[i].index) {
                let (plane, frame) = frame_of(next);
                descriptor::prefetch(plane, frame);
            }
            let (plane, frame) = frame_of(&oriented[i]);
            *out = describe(self.simd, plane, frame, &style, scratch);
        });
    }
}

/// Finds and describes the keypoints of one image with the default parameters.
///
/// For a sequence of images keep a [`Detector`] and a [`Workspace`] instead, which saves the allocations.
///
/// # Errors
/// As [`Detector::detect`].
///
/// ```
/// use vision_sift::{GrayImage, detect};
///
/// // A bright disc of ten pixels on black is found once, in its middle.
/// let disc = |i: usize| {
///     let (x, y) = ((i % 96) as f64 - 48.0, (i / 96) as f64 - 40.0);
///     if x.hypot(y) < 5.0 { 200_u8 } else { 0 }
/// };
/// let pixels: Vec<u8> = (0..96 * 80).map(disc).collect();
/// let features = detect(&GrayImage::new(96, 80, &pixels)?)?;
/// assert_eq!(features.keypoints.len(), features.descriptors.len());
/// let near = |k: &&vision_sift::Keypoint| (k.x - 48.0).hypot(k.y - 40.0) < 0.5;
/// assert!(features.keypoints.iter().find(near).is_some_and(|k| k.sigma > 2.0));
/// # Ok::<(), vision_sift::SiftError>(())
/// ```
pub fn detect<P: Pixel>(image: &GrayImage<'_, P>) -> Result<Features, SiftError> {
    let mut features = Features::default();
    Detector::new(SiftParams::default())?.detect(image, &mut Workspace::new(), &mut features)?;
    Ok(features)
}
