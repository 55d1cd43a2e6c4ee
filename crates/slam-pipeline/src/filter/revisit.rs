//! A revisit: an old place measured again ties the present to it, and with it all that lies between.
//!
//! At a revisit the present pose is known twice: from the recent landmarks, which carry the error e_t of the path, and
//! from the landmarks of the old place, which carry that of their anchors. The difference of the two poses,
//!
//! h = T e_t - sum_a w_a T_a e_a + r,
//!
//! is a measurement of the joint error of the keyframes whose covariance P is kept in [`Drift`]: with g_k = cov(e_k, h) and
//! S = var h the error of keyframe k becomes N(g_k S^-1 h, P - g S^-1 g^T), a Kalman update. Every keyframe is moved by its
//! expected error; landmarks follow, because they are anchored in keyframes. T moves a rigid error from where it is kept to
//! the present position.

use nalgebra::{Matrix3, Vector2, Vector3};

use super::drift::{Drift, transport};

/// The news that a revisit brings of the errors of all keyframes.
#[derive(Debug, Clone)]
pub(crate) struct Revisit {
    /// cov(e_k, h) of every kept keyframe.
    gains: Vec<Matrix3<f64>>,
    /// var h.
    covariance: Matrix3<f64>,
    /// dh / d (relative error of all angles that the camera sees).
    focal_rate: Vector3<f64>,
    kept: Vec<u32>,
    positions: Vec<Vector2<f64>>,
}

/// Expected errors of the kept keyframes.
#[derive(Debug, Clone)]
pub(crate) struct Correction {
    kept: Vec<u32>,
    positions: Vec<Vector2<f64>>,
    errors: Vec<Vector3<f64>>,
    /// Share of a difference at the present that is an error of the keyframe, the mean of those of x and y.
    shares: Vec<f64>,
}

impl Revisit {
    /// The measurement of h at `position` (metres) against anchors with weights that sum to one, with `noise` the
    /// covariance of r. `None` when nothing is kept. O(window x anchors).
    #[must_use]
    pub(crate) fn new(
        drift: &Drift,
        position: &Vector2<f64>,
        anchors: &[(u32, f64)],
        noise: &Matrix3<f64>,
    ) -> Option<Self> {
        let positions: Vec<Vector2<f64>> = drift
            .bodies()
            .iter()
            .map(|b| Vector2::new(b.x, b.y))
            .collect();
        let last = positions.len().checked_sub(1)?;
        let mut terms = vec![(last, transport(&positions[last], position))];
        for (anchor, weight) in anchors {
            let slot = drift.slot(*anchor);
            terms.push((slot, transport(&positions[slot], position) * -*weight));
        }
        let gains: Vec<Matrix3<f64>> = (0..=last)
            .map(|k| {
                terms
                    .iter()
                    .map(|(slot, t)| drift.block(k, *slot) * t.transpose())
                    .sum()
            })
            .collect();
        let covariance = terms
            .iter()
            .map(|(slot, t)| t * gains[*slot])
            .sum::<Matrix3<f64>>()
            + noise;
        let focal_rate = terms
            .iter()
            .map(|(slot, t)| t * drift.focal_rates()[*slot])
            .sum();
        Some(Self {
            gains,
            focal_rate,
            covariance: (covariance + covariance.transpose()) * 0.5,
            kept: drift.kept().to_vec(),
            positions,
        })
    }

    /// var h: what the two poses may differ by, m^2, m rad, rad^2.
    #[must_use]
    pub(crate) fn covariance(&self) -> &Matrix3<f64> {
        &self.covariance
    }

    /// log N(h; 0, var h) up to a constant; minus infinity when var h is singular.
    #[must_use]
    pub(crate) fn log_density(&self, h: &Vector3<f64>) -> f64 {
        self.covariance
            .cholesky()
            .map_or(f64::NEG_INFINITY, |c| -0.5 * h.dot(&c.solve(h)))
    }

    /// The expected errors given h; `None` when var h is singular.
    #[must_use]
    pub(crate) fn correction(&self, h: &Vector3<f64>) -> Option<Correction> {
        let inverse = self.covariance.cholesky()?.inverse();
        Some(Correction {
            kept: self.kept.clone(),
            positions: self.positions.clone(),
            errors: self.gains.iter().map(|g| g * inverse * h).collect(),
            shares: self
                .gains
                .iter()
                .map(|g| {
                    let gain = g * inverse;
                    0.5 * (gain[(0, 0)] + gain[(1, 1)])
                })
                .collect(),
        })
    }

    /// The joint covariance after h was measured, and the derivatives by the error of the focal length, which moves h like
    /// any other; unchanged when var h is singular. O(window^2).
    pub(crate) fn condition(&self, drift: &mut Drift) {
        let Some(c) = self.covariance.cholesky() else {
            return;
        };
        let whitened: Vec<Matrix3<f64>> = self
            .gains
            .iter()
            .map(|g| {
                // L^-1 g^T, so that g S^-1 g^T is a product of two of them.
                c.l()
                    .solve_lower_triangular(&g.transpose())
                    .unwrap_or_else(Matrix3::zeros)
            })
            .collect();
        let taken_back = c.solve(&self.focal_rate);
        drift.lower(
            |i, j| whitened[i].tr_mul(&whitened[j]),
            |i| self.gains[i] * taken_back,
        );
    }
}

impl Correction {
    /// The expected error (dx, dy, dphi) of keyframe `keyframe` at `position` (metres): between the kept ones it changes
    /// linearly with the index.
    #[must_use]
    pub(crate) fn at(&self, keyframe: u32, position: &Vector2<f64>) -> Vector3<f64> {
        let moved = |slot: usize| transport(&self.positions[slot], position) * self.errors[slot];
        self.between(keyframe, moved)
    }

    /// The share of a difference at the present, of a quantity that drifts as the position does, that keyframe `keyframe`
    /// has.
    #[must_use]
    pub(crate) fn share(&self, keyframe: u32) -> f64 {
        self.between(keyframe, |slot| self.shares[slot])
    }

    fn between<V>(&self, keyframe: u32, value: impl Fn(usize) -> V) -> V
    where
        V: core::ops::Mul<f64, Output = V> + core::ops::Add<Output = V>,
    {
        let after = self.kept.partition_point(|&k| k < keyframe);
        if after == 0 {
            return value(0);
        }
        if after == self.kept.len() {
            return value(after - 1);
        }
        let (low, high) = (self.kept[after - 1], self.kept[after]);
        let share = f64::from(keyframe - low) / f64::from(high - low);
        value(after - 1) * (1.0 - share) + value(after) * share
    }
}
