//! The normal equations solved by eliminating the landmarks (Schur complement).
//!
//! V is block diagonal, so each landmark leaves on its own and the poses alone remain:
//!
//! > S dp = -g_p + W V^-1 g_l,  S = U - W V^-1 W^T,  dl = -V^-1 (g_l + W^T dp).
//!
//! Steps: factorise V = G^-T G^-1 (3x3 Cholesky); Z = W G for every link; S -= Z Z^T over the links of the landmark;
//! Cholesky of S (`reduced`); back-substitution. Cost per landmark seen by n poses: n^2 D^2 multiplications by 3.
//!
//! Degenerate: a landmark seen once, or from one place only, or at infinity, leaves V singular. Then G holds only the
//! directions whose eigenvalues stand above rounding, V^+ = G G^T: the landmark does not move along the others and says
//! nothing of the poses through them, which is exactly what eliminating a free direction means.
//!
//! Source: Brown (1958); Triggs, McLauchlan, Hartley and Fitzgibbon (2000), section 6.1.

use nalgebra::{DVector, Matrix3, SMatrix, Vector3};

use super::border::Border;
use super::layout::Layout;
use super::normal::Normal;
use super::reduced::{Factor, Reduced};
use crate::error::GeometryError;

/// Eigenvalues of V below this share of the largest are rounding. V is a sum of products of Jacobians that carry a
/// relative error of some tens of eps; a parallax of p radians gives a ratio of about p^2, so this is p = 2e-7.
const RANK_TOLERANCE: f64 = 256.0 * f64::EPSILON;

/// Share of the largest diagonal entry of V that the damping of each coordinate starts from.
const LANDMARK_DAMPING_FLOOR: f64 = 1e-6;

/// The same for a coordinate of a pose, against the largest of all poses: a pose nothing is known of must not move.
const POSE_DAMPING_FLOOR: f64 = 1e-12;

/// Square root G of V^+ = G G^T.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct InverseRoot {
    pub(super) g: Matrix3<f64>,
    /// Directions kept.
    pub(super) rank: usize,
    /// Largest over smallest eigenvalue kept, from the pivots.
    pub(super) condition: f64,
}

impl InverseRoot {
    pub(super) fn new(v: &Matrix3<f64>) -> Self {
        Self::by_cholesky(v).unwrap_or_else(|| Self::by_eigenvalues(v))
    }

    /// G = L^-T if every pivot stands clear of rounding.
    fn by_cholesky(v: &Matrix3<f64>) -> Option<Self> {
        let largest = v[(0, 0)].max(v[(1, 1)]).max(v[(2, 2)]);
        let floor = RANK_TOLERANCE * largest;
        let above = |pivot: f64| (pivot > floor).then(|| pivot.sqrt());
        let l00 = above(v[(0, 0)])?;
        let l10 = v[(1, 0)] / l00;
        let l20 = v[(2, 0)] / l00;
        let l11 = above(v[(1, 1)] - l10 * l10)?;
        let l21 = (v[(2, 1)] - l20 * l10) / l11;
        let l22 = above(v[(2, 2)] - l20 * l20 - l21 * l21)?;
        let (i0, i1, i2) = (1.0 / l00, 1.0 / l11, 1.0 / l22);
        let i10 = -l10 * i0 * i1;
        let i21 = -l21 * i1 * i2;
        let i20 = -(l20 * i0 + l21 * i10) * i2;
        let smallest = l00.min(l11).min(l22);
        Some(Self {
            g: Matrix3::new(i0, i10, i20, 0.0, i1, i21, 0.0, 0.0, i2),
            rank: 3,
            condition: largest / (smallest * smallest),
        })
    }

    /// G = Q diag(lambda^-1/2), the eigenvalues that are rounding left out.
    fn by_eigenvalues(v: &Matrix3<f64>) -> Self {
        let eigen = v.symmetric_eigen();
        let largest = eigen.eigenvalues.max();
        let mut root = Self {
            g: Matrix3::zeros(),
            rank: 0,
            condition: 1.0,
        };
        for k in 0..3 {
            let value = eigen.eigenvalues[k];
            if value > RANK_TOLERANCE * largest && value > f64::MIN_POSITIVE {
                root.g
                    .set_column(k, &(eigen.eigenvectors.column(k) / value.sqrt()));
                root.rank += 1;
                root.condition = root.condition.max(largest / value);
            }
        }
        root
    }
}

/// The system of poses and camera, its landmarks eliminated without damping.
#[derive(Debug)]
pub(super) struct Marginal {
    /// Factor of the reduced system.
    pub(super) factor: Factor,
    /// Of the camera's parameters, reduced.
    pub(super) border: Border,
    pub(super) roots: Vec<InverseRoot>,
    /// Size of the rounding in each pivot.
    pub(super) rounding: Vec<f64>,
}

/// Buffers of the elimination.
#[derive(Debug)]
pub(super) struct Schur<const D: usize> {
    /// S, then its factor.
    matrix: Reduced,
    no_floor: Vec<f64>,
    roots: Vec<InverseRoot>,
    /// Z of one landmark, column by column.
    z: [Vec<f64>; 3],
    border: Border,
    /// Scale of each coordinate for the damping.
    pub(super) pose_scale: Vec<f64>,
    pub(super) landmark_scale: Vec<Vector3<f64>>,
    pub(super) pose_step: Vec<f64>,
    pub(super) landmark_step: Vec<Vector3<f64>>,
    /// Likewise of the camera's free parameters.
    pub(super) camera_scale: DVector<f64>,
    pub(super) camera_step: DVector<f64>,
}

impl<const D: usize> Schur<D> {
    pub(super) fn new(layout: &Layout) -> Self {
        Self::with(layout, Reduced::new(layout, D))
    }

    /// Buffers around a reduced system.
    pub(super) fn with(layout: &Layout, matrix: Reduced) -> Self {
        let size = D * layout.free_poses.len();
        let landmarks = layout.starts.len() - 1;
        let column = vec![0.0; D * layout.longest()];
        Self {
            matrix,
            no_floor: vec![0.0; size],
            roots: vec![InverseRoot::by_eigenvalues(&Matrix3::zeros()); landmarks],
            z: [column.clone(), column.clone(), column],
            camera_scale: DVector::zeros(layout.parameters.len()),
            camera_step: DVector::zeros(layout.parameters.len()),
            border: Border::new(layout, size),
            pose_scale: vec![0.0; size],
            landmark_scale: vec![Vector3::zeros(); landmarks],
            pose_step: vec![0.0; size],
            landmark_step: vec![Vector3::zeros(); landmarks],
        }
    }

    /// Scale of every coordinate: the diagonal of the Hessian, never quite zero.
    pub(super) fn set_scales(&mut self, normal: &Normal<D>) {
        let size = self.pose_scale.len();
        let largest = (0..size).fold(0.0_f64, |m, j| m.max(normal.u.get(j, j)));
        let floor = if largest > 0.0 {
            POSE_DAMPING_FLOOR * largest
        } else {
            1.0
        };
        for j in 0..size {
            self.pose_scale[j] = normal.u.get(j, j).max(floor);
        }
        self.camera_scale = normal.border.scale();
        for (scale, v) in self.landmark_scale.iter_mut().zip(&normal.v) {
            let diagonal = v.diagonal();
            let floor = LANDMARK_DAMPING_FLOOR * diagonal.max();
            *scale = diagonal.map(|d| d.max(floor));
        }
    }

    /// The step (H + damping diag(scale)) step = -gradient, into `pose_step` and `landmark_step`.
    ///
    /// # Errors
    /// [`GeometryError::NotPositiveDefinite`] if rounding left the reduced system indefinite.
    pub(super) fn step(
        &mut self,
        layout: &Layout,
        normal: &Normal<D>,
        damping: f64,
    ) -> Result<(), GeometryError> {
        self.border
            .begin(&normal.border, damping, &self.camera_scale);
        self.matrix.copy_from(&normal.u);
        for (j, scale) in self.pose_scale.iter().enumerate() {
            self.matrix.add(j, j, damping * scale);
            self.pose_step[j] = -normal.pose_gradient[j];
        }
        for landmark in 0..normal.v.len() {
            let mut v = normal.v[landmark];
            for k in 0..3 {
                v[(k, k)] += damping * self.landmark_scale[landmark][k];
            }
            let root = InverseRoot::new(&v);
            self.roots[landmark] = root;
            let y = root.g.tr_mul(&normal.landmark_gradient[landmark]);
            let links = self.eliminate(layout, normal, landmark, &root.g, &y);
            for (local, free) in links.iter().enumerate() {
                for i in 0..D {
                    let row = local * D + i;
                    self.pose_step[free * D + i] +=
                        self.z[0][row] * y.x + self.z[1][row] * y.y + self.z[2][row] * y.z;
                }
            }
        }
        let factor = self.matrix.factorise(&self.no_floor)?;
        let solved = factor
            .solve_in_place(&mut self.pose_step)
            .and_then(|()| self.border.reduce(&factor, &self.pose_step));
        self.matrix.reuse(factor);
        solved?;
        self.camera_step = self.border.step(&mut self.pose_step)?;
        self.substitute_back(layout, normal);
        Ok(())
    }

    /// Subtracts W V^+ W^T of one landmark from the reduced system and eliminates it from the border; leaves its Z, D rows
    /// for each of the free poses that are returned. `y` is G^T g_l.
    fn eliminate<'a>(
        &mut self,
        layout: &'a Layout,
        normal: &Normal<D>,
        landmark: usize,
        g: &Matrix3<f64>,
        y: &Vector3<f64>,
    ) -> &'a [usize] {
        let (start, end) = (layout.starts[landmark], layout.starts[landmark + 1]);
        for (local, w) in normal.w[start.link..end.link].iter().enumerate() {
            let z = w * g;
            for column in 0..3 {
                for i in 0..D {
                    self.z[column][local * D + i] = z[(i, column)];
                }
            }
        }
        self.matrix
            .subtract(&layout.runs[start.run..end.run], &self.z, D);
        let links = &layout.links[start.link..end.link];
        self.border
            .eliminate(&normal.border, landmark, links, (&self.z, D), g, y);
        links
    }

    fn substitute_back(&mut self, layout: &Layout, normal: &Normal<D>) {
        for landmark in 0..normal.v.len() {
            let mut right = normal.landmark_gradient[landmark]
                + normal.border.of_landmark(landmark, &self.camera_step);
            let links = layout.starts[landmark].link..layout.starts[landmark + 1].link;
            for link in links {
                let step = &self.pose_step[layout.links[link] * D..][..D];
                let w = &normal.w[link];
                for column in 0..3 {
                    for i in 0..D {
                        right[column] += w[(i, column)] * step[i];
                    }
                }
            }
            let g = &self.roots[landmark].g;
            self.landmark_step[landmark] = -(g * g.tr_mul(&right));
        }
    }

    /// The undamped reduced system, factorised, the inverse roots of all landmarks, and what rounding can have left on
    /// the diagonal of S: eps times (size times the entry of U, plus each subtracted entry times the condition of the
    /// landmark's V, which the elimination squares in). A pivot below that counts as zero.
    ///
    /// # Errors
    /// [`GeometryError::GaugeFree`] with the pose and coordinate of the pivot.
    pub(super) fn marginal(
        mut self,
        layout: &Layout,
        normal: &Normal<D>,
    ) -> Result<Marginal, GeometryError> {
        self.border
            .begin(&normal.border, 0.0, &normal.border.scale());
        self.matrix.copy_from(&normal.u);
        let size = self.matrix.size();
        let mut floor: Vec<f64> = (0..size)
            .map(|j| size as f64 * normal.u.get(j, j))
            .collect();
        for landmark in 0..normal.v.len() {
            let root = InverseRoot::new(&normal.v[landmark]);
            self.roots[landmark] = root;
            let links = self.eliminate(layout, normal, landmark, &root.g, &Vector3::zeros());
            for (local, free) in links.iter().enumerate() {
                for i in 0..D {
                    let row = local * D + i;
                    let entry = self.z.iter().map(|z| z[row] * z[row]).sum::<f64>();
                    floor[free * D + i] += entry * root.condition;
                }
            }
        }
        for value in &mut floor {
            *value *= f64::EPSILON;
        }
        match self.matrix.factorise(&floor) {
            Ok(factor) => {
                let none = vec![0.0; size];
                self.border.reduce(&factor, &none)?;
                Ok(Marginal {
                    factor,
                    border: self.border,
                    roots: self.roots,
                    rounding: floor,
                })
            }
            Err(GeometryError::NotPositiveDefinite {
                pivot,
                value,
                required,
            }) => Err(GeometryError::GaugeFree {
                pose: layout.free_poses[pivot / D],
                coordinate: pivot % D,
                value,
                required,
            }),
            Err(other) => Err(other),
        }
    }
}

/// W^T of the links of one landmark times V^+: how the landmark follows the poses, dl = -sum (V^+ W^T) dp.
pub(super) fn follow<const D: usize>(
    w: &SMatrix<f64, D, 3>,
    root: &InverseRoot,
) -> SMatrix<f64, D, 3> {
    w * root.g * root.g.transpose()
}
