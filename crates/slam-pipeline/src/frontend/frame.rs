//! The keypoints of one frame, undistorted.

use kiddo::SquaredEuclidean;
use kiddo::float::kdtree::KdTree;
use mono_geometry::Camera;
use nalgebra::Vector2;
use vision_sift::Features;

/// Keypoints that look the same as their neighbours to the last digit would
/// overfill a bucket of the tree; one bucket holds more orientations than a
/// keypoint can have.
const BUCKET: usize = 256;

/// Features of one frame with their ideal pixels.
#[derive(Debug)]
pub(crate) struct FrameFeatures<'a> {
    /// Keypoints and descriptors as detected.
    pub(crate) features: &'a Features,
    /// Ideal pinhole pixel of each keypoint; `None` outside the lens model.
    pub(crate) ideal: Vec<Option<Vector2<f64>>>,
    tree: KdTree<f64, u64, 2, BUCKET, u32>,
}

impl<'a> FrameFeatures<'a> {
    /// Undistorts the keypoints. O(n log n).
    #[must_use]
    pub(crate) fn new(features: &'a Features, camera: &Camera) -> Self {
        let ideal: Vec<_> = features
            .keypoints
            .iter()
            .map(|k| {
                camera
                    .undistort_pixel(&Vector2::new(f64::from(k.x), f64::from(k.y)))
                    .ok()
            })
            .collect();
        let mut tree = KdTree::with_capacity(ideal.len().max(1));
        for (i, p) in ideal.iter().enumerate() {
            if let Some(p) = p {
                tree.add(&[p.x, p.y], i as u64);
            }
        }
        Self {
            features,
            ideal,
            tree,
        }
    }

    /// Keypoints within `radius_px` of `pixel`, in index order.
    #[must_use]
    pub(crate) fn near(&self, pixel: &Vector2<f64>, radius_px: f64) -> Vec<usize> {
        let mut found: Vec<usize> = self
            .tree
            .within_unsorted::<SquaredEuclidean>(&[pixel.x, pixel.y], radius_px * radius_px)
            .into_iter()
            .map(|n| n.item as usize)
            .collect();
        found.sort_unstable();
        found
    }
}
