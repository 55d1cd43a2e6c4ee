//! How sure a bundle is: marginal covariances of poses and landmarks at the estimate.
//!
//! The inverse of the Hessian of Gauss and Newton, blockwise: the poses have S^-1 (Schur complement, by solving, not from
//! the blocks of the full inverse), and a landmark has
//!
//! > cov(l) = V^-1 + (V^-1 W^T) S^-1 (W V^-1).
//!
//! The parameters of an unknown camera come after the poses and widen them: with X = S^-1 E and Q the covariance of the parameters,
//! the poses have S^-1 + X Q X^T (`border`).
//!
//! With a robust loss the pixels enter with their weights rho', so the covariance is that of least squares with the
//! far-off pixels down-weighted.
//!
//! Degenerate: with no fixed pose and no prior the whole can be moved at will (gauge), and without odometry or a
//! second known pose it can be scaled too; S is singular and the answer is an error with the pivot, not large numbers.
//! A landmark whose V is singular has no covariance (`None`).

use estimation_base::symmetric;
use nalgebra::{DMatrix, Matrix3, SMatrix};

use super::border::Border;
use super::layout::Layout;
use super::normal::{Estimate, Normal, Whitening};
use super::pose::BundlePose;
use super::problem::Problem;
use super::schur::{InverseRoot, Marginal, Schur, follow};
use crate::error::{GeometryError, bad};
use crate::linalg::DenseCholesky;
use crate::robust_loss::RobustLoss;

/// The information of a coordinate, all others unknown, must be this many times what rounding leaves of a zero: then its
/// variance is good to three digits.
const ROUNDING_MARGIN: f64 = 1e3;

/// Joint covariance of the free poses, and what the landmarks' covariances are made of.
#[derive(Debug)]
pub struct Covariance<const D: usize> {
    layout: Layout,
    joint: DMatrix<f64>,
    w: Vec<SMatrix<f64, D, 3>>,
    roots: Vec<InverseRoot>,
    /// Covariance of the camera's free parameters, and of the poses with them.
    camera: DMatrix<f64>,
    with_camera: DMatrix<f64>,
    /// F of the normal equations.
    by_camera: DMatrix<f64>,
    /// Number of the camera's parameters, free or held.
    parameters: usize,
}

/// Covariance of the estimates that the problem holds (take over an adjustment's result first). O((D poses)^3) beyond one
/// iteration.
///
/// # Errors
/// As [`Problem::check`]; a landmark behind a camera; [`GeometryError::GaugeFree`] if the measurements leave a direction
/// of the poses free.
pub fn covariance<P: BundlePose<D>, const D: usize>(
    problem: &Problem<P, D>,
    loss: &RobustLoss,
) -> Result<Covariance<D>, GeometryError> {
    problem.check()?;
    loss.check()?;
    let layout = Layout::new(problem);
    let whitening = Whitening::new(problem)?;
    let mut normal = Normal::new(&layout);
    normal.fill(problem, &layout, &whitening, loss, &Estimate::new(problem))?;
    let Marginal {
        factor,
        border,
        roots,
        rounding,
    } = Schur::new(&layout).marginal(&layout, &normal)?;
    let size = D * layout.free_poses.len();
    let mut joint = DMatrix::identity(size, size);
    factor.solve_in_place(joint.as_mut_slice())?;
    let camera = camera_covariance(&border, &normal.border)?;
    // The border holds S^-1 E: the poses follow the camera.
    let with_camera = -(&border.poses * &camera);
    joint -= &with_camera * border.poses.transpose();
    // Solving leaves the two triangles apart by rounding.
    let joint = (&joint + joint.transpose()) * 0.5;
    // Rounding adds up over a long chain of poses: the last pivot can pass its own floor and still be nothing else.
    for j in 0..size {
        let (value, required) = (1.0 / joint[(j, j)], ROUNDING_MARGIN * rounding[j]);
        if !(value > required && value.is_finite()) {
            return Err(GeometryError::GaugeFree {
                pose: layout.free_poses[j / D],
                coordinate: j % D,
                value,
                required,
            });
        }
    }
    Ok(Covariance {
        layout,
        joint,
        w: normal.w,
        roots,
        camera,
        with_camera,
        by_camera: normal.border.landmarks,
        parameters: problem.intrinsics.as_ref().map_or(0, |i| i.sigmas.len()),
    })
}

impl<const D: usize> Covariance<D> {
    /// Covariance of one pose, in the tangent at its right (body axes, translation first); zero for a fixed pose, `None`
    /// for an index out of range.
    #[must_use]
    pub fn pose(&self, pose: usize) -> Option<SMatrix<f64, D, D>> {
        self.between(pose, pose)
    }

    /// Covariance of two poses with one another (rows: the first).
    #[must_use]
    pub fn between(&self, first: usize, second: usize) -> Option<SMatrix<f64, D, D>> {
        let rows = self.layout.free_index.get(first)?;
        let columns = self.layout.free_index.get(second)?;
        Some(match (rows, columns) {
            (Some(r), Some(c)) => self.block(*r, *c),
            _ => SMatrix::zeros(),
        })
    }

    /// Covariance of the camera, rows and columns as [`crate::Camera::parameters`]; zero where a parameter is held, and without
    /// rows if the problem has no [`super::Intrinsics`].
    #[must_use]
    pub fn intrinsics(&self) -> DMatrix<f64> {
        let mut all = DMatrix::zeros(self.parameters, self.parameters);
        for (i, &row) in self.layout.parameters.iter().enumerate() {
            for (j, &column) in self.layout.parameters.iter().enumerate() {
                all[(row, column)] = self.camera[(i, j)];
            }
        }
        all
    }

    /// Joint covariance of the free poses in ascending order, D rows each.
    #[must_use]
    pub fn joint(&self) -> &DMatrix<f64> {
        &self.joint
    }

    /// Covariance of one landmark, m^2; `None` if its sightings do not fix it, or for an index out of range.
    /// O((poses that see it)^2).
    #[must_use]
    pub fn landmark(&self, landmark: usize) -> Option<Matrix3<f64>> {
        let root = self.roots.get(landmark).filter(|root| root.rank == 3)?;
        let range = self.layout.starts[landmark].link..self.layout.starts[landmark + 1].link;
        let mut covariance = root.g * root.g.transpose();
        for i in range.clone() {
            let left = follow(&self.w[i], root);
            for j in range.clone() {
                let block = self.block(self.layout.links[i], self.layout.links[j]);
                covariance += left.transpose() * block * follow(&self.w[j], root);
            }
        }
        if !self.layout.parameters.is_empty() {
            let inverse = root.g * root.g.transpose();
            let by_camera = inverse * self.by_camera.fixed_rows::<3>(3 * landmark);
            let spread = &by_camera * &self.camera * by_camera.transpose();
            covariance += spread.fixed_view::<3, 3>(0, 0);
            for i in range {
                let left = follow(&self.w[i], root);
                let rows = self.with_camera.fixed_rows::<D>(self.layout.links[i] * D);
                let mixed = left.transpose() * rows * by_camera.transpose();
                let mixed = mixed.fixed_view::<3, 3>(0, 0);
                covariance += mixed + mixed.transpose();
            }
        }
        let covariance = symmetric(&covariance);
        covariance
            .iter()
            .all(|v| v.is_finite())
            .then_some(covariance)
    }

    fn block(&self, row: usize, column: usize) -> SMatrix<f64, D, D> {
        self.joint
            .fixed_view::<D, D>(row * D, column * D)
            .into_owned()
    }
}

/// The inverse of what is left of the camera's parameters.
fn camera_covariance(reduced: &Border, full: &Border) -> Result<DMatrix<f64>, GeometryError> {
    let count = reduced.free.len();
    // Rounding of the elimination is relative to what was there before.
    let floor: Vec<f64> = (0..count)
        .map(|k| ROUNDING_MARGIN * f64::EPSILON * full.corner[(k, k)])
        .collect();
    match DenseCholesky::new(reduced.corner.clone(), &floor) {
        Ok(factor) => Ok(factor.inverse()),
        Err(GeometryError::NotPositiveDefinite {
            pivot,
            value,
            required,
        }) => Err(bad(
            "camera parameter",
            reduced.free[pivot],
            "information",
            value,
            if required > 0.0 {
                "more than rounding leaves of a zero (give it a prior)"
            } else {
                "above 0 (give it a prior)"
            },
        )),
        Err(other) => Err(other),
    }
}
