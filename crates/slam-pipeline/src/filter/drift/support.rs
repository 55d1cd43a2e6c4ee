//! The keyframes that a pose leans on.
//!
//! The matches of a keyframe are grouped by the keyframe that their landmarks are anchored in: Lambda_a is the information
//! of such a group about the pose, Lambda that of all groups and of the motion prior together, and Lambda^-1 Lambda_a the
//! share of the anchor's error that the pose takes over.

use std::collections::BTreeMap;

use nalgebra::{Matrix3, Vector3};

use super::super::linearised::{PoseLinearisation, PosePosterior};
use super::super::motion::MotionPrior;
use super::super::observation::{Prepared, Scoring};
use super::super::pose::{PLANAR, PoseMatrix};
use crate::rig::Rig;

/// The information behind a keyframe's pose, by the keyframes that its landmarks are anchored in.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Support {
    /// Lambda^-1 Lambda_a, planar part, by anchor keyframe.
    pub(crate) gains: BTreeMap<u32, Matrix3<f64>>,
    /// Lambda^-1, planar part.
    pub(crate) covariance: Matrix3<f64>,
}

impl Support {
    /// The support of `posterior`, from `matches` with the anchor keyframe of each. The particle has `scale` metres per
    /// unit. `None` if a factor is singular.
    #[must_use]
    pub(crate) fn new(
        rig: &Rig,
        prior: &MotionPrior,
        posterior: &PosePosterior,
        scale: f64,
        matches: &[(u32, Prepared)],
    ) -> Option<Self> {
        let linearisation = PoseLinearisation::new(rig, prior, posterior);
        let mut information: BTreeMap<u32, PoseMatrix> = BTreeMap::new();
        for (anchor, prepared) in matches {
            let Some(line) = linearisation.linearise(prepared) else {
                continue;
            };
            let sum = information.entry(*anchor).or_insert_with(PoseMatrix::zeros);
            match prepared.scoring {
                Scoring::Full => {
                    if let Some(c) = line.noise.cholesky() {
                        *sum += line.slope.tr_mul(&c.solve(&line.slope));
                    }
                }
                Scoring::AcrossEpipolar => {
                    let row = line.slope.tr_mul(&line.across);
                    let variance = (line.across.transpose() * line.noise * line.across)[(0, 0)];
                    *sum += row * row.transpose() / variance;
                }
                Scoring::MapOnly => {}
            }
        }
        // x = F xi': Lambda^-1 Lambda_a = F T^-1 M_a F^-1, with T the information of the prior and of all groups together.
        // The posterior itself has down-weighted matches; dividing by its information could give gains above one.
        let factor = prior.factor * posterior.factor;
        let total =
            posterior.factor.tr_mul(&posterior.factor) + information.values().sum::<PoseMatrix>();
        let total = total.cholesky()?;
        let inverse = factor.solve_lower_triangular(&PoseMatrix::identity())?;
        let metric = Matrix3::from_diagonal(&Vector3::new(scale, scale, 1.0));
        let unit = Matrix3::from_diagonal(&Vector3::new(1.0 / scale, 1.0 / scale, 1.0));
        let gains = information
            .into_iter()
            .map(|(a, m)| {
                let gain = planar(&(factor * total.solve(&m) * inverse));
                (a, metric * gain * unit)
            })
            .collect();
        Some(Self {
            gains,
            covariance: metric * planar(&(factor * total.solve(&factor.transpose()))) * metric,
        })
    }
}

fn planar(m: &PoseMatrix) -> Matrix3<f64> {
    Matrix3::from_fn(|i, j| m[(PLANAR[i], PLANAR[j])])
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector2;

    /// A consensus that down-weighted most of its matches is less sure than all matches together. Gains against its own
    /// information summed to hundreds, and the covariance exploded at a revisit.
    #[test]
    fn regress_gains_never_exceed_one_together() {
        use crate::filter::tests::common::{
            control, inverse_depth, normal, particle, place, planar_carrier, pose, prepared, rig,
            rng,
        };
        use mono_geometry::inverse_depth::LandmarkGeometry;
        let mut rng = rng(61);
        let p = particle(pose(0.0, 0.0, 0.1));
        let u = control([0.1, 0.0, 0.01], [0.01, 0.01, 0.02]);
        let prior = planar_carrier().prior(&Vector2::zeros(), &p.departure(), &u);
        let anchor = place(&p.pose);
        let matches: Vec<(u32, Prepared)> = (0..60)
            .map(|i| {
                let direction = Vector3::new(0.1 * normal(&mut rng), 0.1 * normal(&mut rng), 0.5);
                let landmark = inverse_depth(direction, Matrix3::identity() * 1e-8);
                let geometry = LandmarkGeometry::InverseDepth { anchor };
                let pixel = Vector2::new(160.0, 120.0);
                (
                    i % 3,
                    prepared(geometry, &landmark, pixel, 0.36, Scoring::Full),
                )
            })
            .collect();
        for posterior in [
            PosePosterior::prior(),
            PosePosterior {
                factor: PoseMatrix::identity() * 0.5,
                ..PosePosterior::prior()
            },
        ] {
            let support = Support::new(&rig(), &prior, &posterior, 1.0, &matches).unwrap();
            let sum: Matrix3<f64> = support.gains.values().sum();
            assert!(support.gains.len() == 3 && sum.norm() > 0.5, "{sum}");
            let largest = sum.complex_eigenvalues().map(|v| v.norm()).max();
            assert!(largest < 1.0 + 1e-9, "{largest}: {sum}");
        }
    }
}
