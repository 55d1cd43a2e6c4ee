//! The landmarks that a camera of uncertain pose may see, by boxes.
//!
//! The direction to a landmark in camera axes is affine in its three parameters, q = o + B m
//! ([`mono_geometry::inverse_depth::LandmarkView`]), for an anchored inverse depth as for a point. A pixel lies right of the
//! left edge of the image where g . q >= 0 with g = (fx, 0, cx - left), and so on for the other edges. Over a box of
//! parameters with centre c and half extents h the largest g . q is g . (o + B c) + sum |g . B_i| h_i.
//!
//! A landmark counts as in view if the *mean* of its pixels in the cameras of the sigma points is on the image, so for every
//! edge at least one of these cameras sees it on the right side. Camera k is the mean camera turned by R_k - R and moved by
//! t_k: it changes g . q by no more than |g| (|R_k - R| |q| + |rate| |t_k|). A box that stays on the wrong side of an edge
//! with this added holds no landmark in view. The converse is not true: boxes are tested to save work, not to decide.

use mono_geometry::PlacedCamera;
use mono_geometry::inverse_depth::{LandmarkGeometry, LandmarkView};
use nalgebra::Vector3;

use crate::filter::linearised::PoseLinearisation;
use crate::rig::Rig;

/// Room beyond the image on all sides, pixels: half a pixel is still its edge, the rest is for rounding.
const MARGIN_PX: f64 = 1.0;

/// The smallest box that holds the parameters of some landmarks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Extent {
    low: Vector3<f64>,
    high: Vector3<f64>,
}

impl Extent {
    /// A box that holds nothing.
    pub(crate) const EMPTY: Self = Self {
        low: Vector3::new(f64::INFINITY, f64::INFINITY, f64::INFINITY),
        high: Vector3::new(f64::NEG_INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY),
    };

    /// The box of one landmark.
    #[must_use]
    pub(crate) fn of(parameters: &Vector3<f64>) -> Self {
        Self {
            low: *parameters,
            high: *parameters,
        }
    }

    /// Widens the box so that it holds `parameters`.
    pub(crate) fn include(&mut self, parameters: &Vector3<f64>) {
        self.low = self.low.inf(parameters);
        self.high = self.high.sup(parameters);
    }

    /// Whether it holds nothing.
    #[must_use]
    pub(crate) fn is_empty(&self) -> bool {
        self.low.x > self.high.x
    }
}

/// The view of the cameras of a pose distribution.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Frustum {
    mean: PlacedCamera,
    /// Inward directions of the four edges, camera axes, unit length.
    edges: [Vector3<f64>; 4],
    /// Largest |R_k - R| over the cameras.
    turned: f64,
    /// Largest |t_k|.
    moved: f64,
}

impl Frustum {
    /// The view of the cameras of `linearisation`.
    #[must_use]
    pub(crate) fn new(rig: &Rig, linearisation: &PoseLinearisation) -> Self {
        let pinhole = rig.pinhole();
        let size = rig.image_size_px();
        let (left, top) = (-MARGIN_PX, -MARGIN_PX);
        let (right, bottom) = (size.x - 1.0 + MARGIN_PX, size.y - 1.0 + MARGIN_PX);
        let edges = [
            Vector3::new(pinhole.fx, 0.0, pinhole.cx - left),
            Vector3::new(-pinhole.fx, 0.0, right - pinhole.cx),
            Vector3::new(0.0, pinhole.fy, pinhole.cy - top),
            Vector3::new(0.0, -pinhole.fy, bottom - pinhole.cy),
        ]
        .map(|edge| edge.normalize());
        let (turned, moved) = linearisation.spread();
        Self {
            mean: *linearisation.mean_camera(),
            edges,
            turned,
            moved,
        }
    }

    /// The landmarks of `geometry` as the mean camera sees them.
    #[must_use]
    pub(crate) fn view(&self, geometry: &LandmarkGeometry) -> SeenGeometry {
        SeenGeometry {
            view: geometry.view(&self.mean),
            is_point: geometry.anchor().is_none(),
        }
    }

    /// Whether a landmark whose parameters are in `extent` may be in view; never `false` for one that is.
    #[must_use]
    pub(crate) fn may_see(&self, seen: &SeenGeometry, extent: &Extent) -> bool {
        if extent.is_empty() {
            return false;
        }
        let LandmarkView {
            offset,
            by_parameters,
        } = seen.view;
        let centre = (extent.low + extent.high) * 0.5;
        let half = (extent.high - extent.low) * 0.5;
        let direction = offset + by_parameters * centre;
        let length = direction.norm()
            + (0..3)
                .map(|i| by_parameters.column(i).norm() * half[i])
                .sum::<f64>();
        let rate = if seen.is_point {
            1.0
        } else {
            centre.z.abs() + half.z
        };
        let room = self.turned * length + self.moved * rate;
        !self.edges.iter().any(|edge| {
            let slopes = by_parameters.tr_mul(edge);
            edge.dot(&direction) + slopes.abs().dot(&half) + room < 0.0
        })
    }
}

/// All landmarks of one geometry as the mean camera of a [`Frustum`] sees them.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SeenGeometry {
    view: LandmarkView,
    is_point: bool,
}
