//! The rows and columns that parameters shared by all pixels add to the normal equations.
//!
//! With c the shared parameters, the system of poses p and landmarks l gets a border,
//!
//! > (U  W  E; W^T  V  F; E^T  F^T  C) (dp; dl; dc) = -(g_p; g_l; g_c),
//!
//! that keeps what makes it fast: the landmarks leave one by one (E -= W V^+ F, C -= F^T V^+ F, g_c -= F^T V^+ g_l), the
//! reduced system S of the poses is factorised as before, and the few parameters remain,
//!
//! > (C - E^T S^-1 E) dc = -g_c - E^T y,  dp = y - S^-1 E dc,  y the step of the poses alone.
//!
//! Without shared parameters all is empty and costs nothing.

use nalgebra::{DMatrix, DVector, Matrix2x3, Matrix3, SVector, Vector2, Vector3};

use super::intrinsics::gather;
use super::layout::Layout;
use super::reduced::Factor;
use crate::camera::ParameterJacobian;
use crate::error::GeometryError;
use crate::linalg::DenseCholesky;

/// As for a pose: a parameter that nothing is known of must not move.
const DAMPING_FLOOR: f64 = 1e-12;

/// The blocks of K shared parameters.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Border {
    /// Indices of the parameters among those of the camera.
    pub(super) free: Vec<usize>,
    /// E: a row for each coordinate of the free poses.
    pub(super) poses: DMatrix<f64>,
    /// F: three rows a landmark.
    pub(super) landmarks: DMatrix<f64>,
    /// C.
    pub(super) corner: DMatrix<f64>,
    pub(super) gradient: DVector<f64>,
}

/// One pixel as the border sees it: whitened residual, derivative by the parameters, weight.
#[derive(Debug, Clone, Copy)]
pub(super) struct BorderPixel {
    pub(super) residual: Vector2<f64>,
    pub(super) by_parameters: ParameterJacobian,
    pub(super) weight: f64,
}

impl Border {
    /// Zeros; `rows` of the reduced system.
    pub(super) fn new(layout: &Layout, rows: usize) -> Self {
        let free = layout.parameters.clone();
        let count = free.len();
        Self {
            poses: DMatrix::zeros(rows, count),
            landmarks: DMatrix::zeros(
                if count == 0 {
                    0
                } else {
                    3 * (layout.starts.len() - 1)
                },
                count,
            ),
            corner: DMatrix::zeros(count, count),
            gradient: DVector::zeros(count),
            free,
        }
    }

    pub(super) fn clear(&mut self) {
        self.poses.fill(0.0);
        self.landmarks.fill(0.0);
        self.corner.fill(0.0);
        self.gradient.fill(0.0);
    }

    /// Adds one pixel of a landmark to F, C and g_c; derivatives gathered for [`Self::add_pose_row`].
    pub(super) fn add_pixel(
        &mut self,
        landmark: usize,
        by_point: &Matrix2x3<f64>,
        seen: &BorderPixel,
    ) -> ParameterJacobian {
        let jacobian = gather(&seen.by_parameters, &self.free);
        for column in 0..self.free.len() {
            let weighted = jacobian.column(column) * seen.weight;
            self.gradient[column] += weighted.dot(&seen.residual);
            for row in 0..self.free.len() {
                self.corner[(row, column)] += jacobian.column(row).dot(&weighted);
            }
            for axis in 0..3 {
                self.landmarks[(3 * landmark + axis, column)] +=
                    by_point.column(axis).dot(&weighted);
            }
        }
        jacobian
    }

    /// Adds the weighted derivative by a pose, one axis of a pixel, times the gathered one by the parameters.
    pub(super) fn add_pose_row<const D: usize>(
        &mut self,
        free_pose: usize,
        weighted: &SVector<f64, D>,
        gathered: &ParameterJacobian,
        axis: usize,
    ) {
        for column in 0..self.free.len() {
            for i in 0..D {
                self.poses[(free_pose * D + i, column)] += weighted[i] * gathered[(axis, column)];
            }
        }
    }

    /// Adds what is known beforehand.
    pub(super) fn add_prior(&mut self, information: &DVector<f64>, gradient: &DVector<f64>) {
        for k in 0..self.free.len() {
            self.corner[(k, k)] += information[k];
        }
        self.gradient += gradient;
    }

    /// The diagonal of C, never quite zero.
    pub(super) fn scale(&self) -> DVector<f64> {
        let diagonal = self.corner.diagonal();
        // The parameters have different units: no largest of all of them.
        diagonal.map(|d| if d > 0.0 { d } else { DAMPING_FLOOR })
    }

    /// Takes over another border and damps it; the gradient becomes the right-hand side.
    pub(super) fn begin(&mut self, of: &Self, damping: f64, scale: &DVector<f64>) {
        self.poses.copy_from(&of.poses);
        self.corner.copy_from(&of.corner);
        for k in 0..self.free.len() {
            self.corner[(k, k)] += damping * scale[k];
        }
        self.gradient.copy_from(&-&of.gradient);
    }

    /// Eliminates one landmark: `z` are the rows W G of its links, G the root of V^+, `y` = G^T g_l.
    pub(super) fn eliminate(
        &mut self,
        of: &Self,
        landmark: usize,
        links: &[usize],
        (z, d): (&[Vec<f64>; 3], usize),
        g: &Matrix3<f64>,
        y: &Vector3<f64>,
    ) {
        let count = self.free.len();
        if count == 0 {
            return;
        }
        let f = g.transpose() * of.landmarks.fixed_rows::<3>(3 * landmark);
        for column in 0..count {
            let [f0, f1, f2] = [f[(0, column)], f[(1, column)], f[(2, column)]];
            for (local, free_pose) in links.iter().enumerate() {
                for i in 0..d {
                    let row = local * d + i;
                    self.poses[(free_pose * d + i, column)] -=
                        z[0][row] * f0 + z[1][row] * f1 + z[2][row] * f2;
                }
            }
            for row in 0..count {
                self.corner[(row, column)] -= f.column(row).dot(&f.column(column));
            }
            self.gradient[column] += f.column(column).dot(y);
        }
    }

    /// With the factor of the reduced system: S^-1 E in the place of E, C - E^T S^-1 E in that of C; the right-hand
    /// side loses what the poses alone explain.
    ///
    /// # Errors
    /// [`GeometryError::Shape`] never, as sizes fit.
    pub(super) fn reduce(&mut self, factor: &Factor, alone: &[f64]) -> Result<(), GeometryError> {
        if self.free.is_empty() || self.poses.nrows() == 0 {
            return Ok(());
        }
        let alone = nalgebra::DVectorView::from_slice(alone, alone.len());
        self.gradient -= self.poses.tr_mul(&alone);
        let before = self.poses.clone();
        factor.solve_in_place(self.poses.as_mut_slice())?;
        self.corner -= before.tr_mul(&self.poses);
        Ok(())
    }

    /// The step of the parameters after [`Self::reduce`]; `poses` is corrected for it.
    ///
    /// # Errors
    /// [`GeometryError::NotPositiveDefinite`] if rounding left the rest indefinite.
    pub(super) fn step(&self, poses: &mut [f64]) -> Result<DVector<f64>, GeometryError> {
        let count = self.free.len();
        let mut step = self.gradient.clone();
        if count == 0 {
            return Ok(step);
        }
        DenseCholesky::new(self.corner.clone(), &vec![0.0; count])?
            .solve_in_place(step.as_mut_slice())?;
        for (pose, off) in poses.iter_mut().zip((&self.poses * &step).iter()) {
            *pose -= off;
        }
        Ok(step)
    }

    /// F dc, by which the parameters change the right-hand side of the step of one landmark.
    pub(super) fn of_landmark(&self, landmark: usize, step: &DVector<f64>) -> Vector3<f64> {
        if self.free.is_empty() {
            return Vector3::zeros();
        }
        self.landmarks.fixed_rows::<3>(3 * landmark) * step
    }
}
