//! The input of a bundle adjustment: poses, landmarks, pixels, measured motions, priors, and what is held.
//!
//! A plain description with public fields; [`Problem::check`] finds the first entry that cannot be used. Poses and
//! landmarks are the start of the minimisation, and its result goes to the same place.

use estimation_base::Se2;
use nalgebra::{SMatrix, SVector, Vector2, Vector3};

use super::intrinsics::Intrinsics;
use super::pose::BundlePose;
use crate::camera::Pinhole;
use crate::error::{GeometryError, bad};
use crate::linalg::cholesky;
use crate::motion::Increment;
use crate::noise_shape::NoiseShape;
use crate::se3::Se3;

/// A landmark seen in one image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PixelObservation {
    /// Index of the pose the image was taken from.
    pub pose: usize,
    /// Index of the landmark.
    pub landmark: usize,
    /// Where it is seen, in ideal (undistorted) pixels.
    pub pixel_ideal: Vector2<f64>,
    /// Standard deviation of each coordinate, pixels, above zero: of the distorted pixel, if `shape` is that of a lens.
    pub sigma_px: f64,
    /// The shape of the noise: [`NoiseShape::ROUND`], or what the lens makes of it
    /// ([`crate::Camera::undistort_with_shape`]).
    pub shape: NoiseShape,
}

/// A measured motion between two poses: from^-1 * to = motion * exp(delta), delta ~ N(0, covariance).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OdometryFactor<P, const D: usize> {
    /// Index of the first pose.
    pub from: usize,
    /// Index of the second pose, another one.
    pub to: usize,
    /// The second pose in the frame of the first, as measured.
    pub motion: P,
    /// Covariance of delta, positive definite; metres and radians, translation first.
    pub covariance: SMatrix<f64, D, D>,
}

impl OdometryFactor<Se2, 3> {
    /// The factor of an accumulated increment (its floors must keep the covariance positive definite).
    #[must_use]
    pub fn from_increment(from: usize, to: usize, increment: &Increment) -> Self {
        Self {
            from,
            to,
            motion: increment.mean,
            covariance: increment.covariance,
        }
    }
}

/// Prior knowledge of a pose: pose = mean * exp(delta), delta ~ N(0, covariance).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PosePrior<P, const D: usize> {
    /// Index of the pose.
    pub pose: usize,
    /// Its expected value.
    pub mean: P,
    /// Covariance of delta, positive definite; metres and radians, translation first.
    pub covariance: SMatrix<f64, D, D>,
}

/// A bundle adjustment; see [`PlanarProblem`] and [`SpatialProblem`].
#[derive(Debug, Clone, PartialEq)]
pub struct Problem<P, const D: usize> {
    /// The camera, lens removed.
    pub pinhole: Pinhole,
    /// Pose of the camera on the body, known; the identity if the poses are the camera's own.
    pub body_from_camera: Se3,
    /// `world_from_body` of every image.
    pub poses: Vec<P>,
    /// Indices of the poses that are held as they are; usually the first one, which fixes the world frame.
    pub fixed_poses: Vec<usize>,
    /// Landmarks in the world, metres.
    pub landmarks: Vec<Vector3<f64>>,
    /// Sightings, in any order.
    pub observations: Vec<PixelObservation>,
    /// Measured motions, between any two poses (loop closures too).
    pub odometry: Vec<OdometryFactor<P, D>>,
    /// Prior knowledge of poses.
    pub priors: Vec<PosePrior<P, D>>,
    /// The camera as an unknown, shared by all images; `None` where it is known. Its calibrated pinhole is `pinhole`, and the
    /// ideal pixels are made with it.
    pub intrinsics: Option<Intrinsics>,
}

/// A robot on a plane: bodies in SE(2), height, roll and pitch zero, three degrees of freedom a pose.
pub type PlanarProblem = Problem<Se2, 3>;

/// A body or camera free in space: SE(3), six degrees of freedom a pose.
pub type SpatialProblem = Problem<Se3, 6>;

impl<P: BundlePose<D>, const D: usize> Problem<P, D> {
    /// A problem without entries.
    #[must_use]
    pub fn new(pinhole: Pinhole, body_from_camera: Se3) -> Self {
        Self {
            pinhole,
            body_from_camera,
            poses: Vec::new(),
            fixed_poses: Vec::new(),
            landmarks: Vec::new(),
            observations: Vec::new(),
            odometry: Vec::new(),
            priors: Vec::new(),
            intrinsics: None,
        }
    }

    /// The first entry that cannot be used. O(size of the problem).
    ///
    /// # Errors
    /// [`GeometryError::InvalidElement`] with list, index and value: an index out of range, a number that is not finite,
    /// a sigma that is not above zero, a covariance that is not positive definite, a factor from a pose to itself;
    /// [`GeometryError::InvalidParameter`] for the camera or its mount.
    pub fn check(&self) -> Result<(), GeometryError> {
        self.check_camera()?;
        for (index, pose) in self.poses.iter().enumerate() {
            if !pose.is_finite() {
                return Err(bad("pose", index, "a coordinate", f64::NAN, "finite"));
            }
        }
        for (index, point) in self.landmarks.iter().enumerate() {
            for value in point.iter() {
                finite("landmark", index, "a coordinate (m)", *value)?;
            }
        }
        let poses = self.poses.len();
        for (index, pose) in self.fixed_poses.iter().enumerate() {
            in_range("fixed pose", index, "pose", *pose, poses)?;
        }
        for (index, o) in self.observations.iter().enumerate() {
            let list = "observation";
            in_range(list, index, "pose", o.pose, poses)?;
            in_range(list, index, "landmark", o.landmark, self.landmarks.len())?;
            finite(list, index, "pixel u (px)", o.pixel_ideal.x)?;
            finite(list, index, "pixel v (px)", o.pixel_ideal.y)?;
            if !(o.sigma_px > 0.0 && o.sigma_px.is_finite()) {
                return Err(bad(
                    list,
                    index,
                    "sigma (px)",
                    o.sigma_px,
                    "finite and above 0",
                ));
            }
        }
        for (index, factor) in self.odometry.iter().enumerate() {
            let list = "odometry factor";
            in_range(list, index, "from", factor.from, poses)?;
            in_range(list, index, "to", factor.to, poses)?;
            if factor.from == factor.to {
                return Err(bad(
                    list,
                    index,
                    "to",
                    factor.to as f64,
                    "another pose than from",
                ));
            }
            check_measured(list, index, &factor.motion, &factor.covariance)?;
        }
        for (index, prior) in self.priors.iter().enumerate() {
            in_range("prior", index, "pose", prior.pose, poses)?;
            check_measured("prior", index, &prior.mean, &prior.covariance)?;
        }
        Ok(())
    }

    /// The camera, if it differs from one that is known.
    pub(super) fn unknown_camera(&self) -> Option<&Intrinsics> {
        self.intrinsics.as_ref().filter(|i| i.is_unknown())
    }

    fn check_camera(&self) -> Result<(), GeometryError> {
        let p = &self.pinhole;
        let numbers = [
            ("fx (px)", p.fx, true),
            ("fy (px)", p.fy, true),
            ("cx (px)", p.cx, false),
            ("cy (px)", p.cy, false),
        ];
        for (name, value, positive) in numbers {
            let required = if positive {
                "finite and above 0"
            } else {
                "finite"
            };
            crate::error::checked(name, value, required, |v| !positive || v > 0.0)?;
        }
        if let Some(intrinsics) = &self.intrinsics {
            intrinsics.check(p)?;
        }
        let mount = &self.body_from_camera;
        for value in mount
            .translation
            .iter()
            .chain(mount.rotation.matrix().iter())
        {
            crate::error::checked("mount of the camera", *value, "finite", |_| true)?;
        }
        Ok(())
    }
}

/// W with W^T W = covariance^-1 applied from the left: whitens an error or its Jacobian.
pub(super) fn whiten<const D: usize, const C: usize>(
    factor: &SMatrix<f64, D, D>,
    matrix: &SMatrix<f64, D, C>,
) -> SMatrix<f64, D, C> {
    // Forward substitution L y = b, b overwritten.
    let mut y = *matrix;
    for column in 0..C {
        for i in 0..D {
            let mut value = y[(i, column)];
            for k in 0..i {
                value -= factor[(i, k)] * y[(k, column)];
            }
            y[(i, column)] = value / factor[(i, i)];
        }
    }
    y
}

/// e = log(mean^-1 * pose) with its Jacobian, both whitened; `factor` is the lower factor of the covariance.
pub(super) fn prior_error<P: BundlePose<D>, const D: usize>(
    prior: &PosePrior<P, D>,
    pose: &P,
    factor: &SMatrix<f64, D, D>,
) -> (SVector<f64, D>, SMatrix<f64, D, D>) {
    let (error, jacobian) = prior.mean.between(pose).log_with_jacobian();
    (whiten(factor, &error), whiten(factor, &jacobian))
}

/// e = log(motion^-1 * from^-1 * to) with its Jacobians by `from` and `to`, all whitened.
pub(super) fn odometry_error<P: BundlePose<D>, const D: usize>(
    measured: &OdometryFactor<P, D>,
    from: &P,
    to: &P,
    factor: &SMatrix<f64, D, D>,
) -> (SVector<f64, D>, SMatrix<f64, D, D>, SMatrix<f64, D, D>) {
    let moved = from.between(to);
    let (error, by_to) = measured.motion.between(&moved).log_with_jacobian();
    let by_from = -(by_to * moved.inverse_adjoint());
    (
        whiten(factor, &error),
        whiten(factor, &by_from),
        whiten(factor, &by_to),
    )
}

fn check_measured<P: BundlePose<D>, const D: usize>(
    list: &'static str,
    index: usize,
    mean: &P,
    covariance: &SMatrix<f64, D, D>,
) -> Result<(), GeometryError> {
    if !mean.is_finite() {
        return Err(bad(list, index, "a coordinate", f64::NAN, "finite"));
    }
    match cholesky(covariance) {
        Ok(_) => Ok(()),
        Err(GeometryError::NotPositiveDefinite { value, .. }) => Err(bad(
            list,
            index,
            "a pivot of the covariance",
            value,
            "positive definite",
        )),
        Err(other) => Err(other),
    }
}

fn in_range(
    list: &'static str,
    index: usize,
    name: &'static str,
    value: usize,
    length: usize,
) -> Result<(), GeometryError> {
    if value < length {
        Ok(())
    } else {
        Err(bad(list, index, name, value as f64, "an index of the list"))
    }
}

fn finite(
    list: &'static str,
    index: usize,
    name: &'static str,
    value: f64,
) -> Result<(), GeometryError> {
    if value.is_finite() {
        Ok(())
    } else {
        Err(bad(list, index, name, value, "finite"))
    }
}
