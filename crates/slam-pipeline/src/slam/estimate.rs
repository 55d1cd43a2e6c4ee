//! What is reported: pose, covariance, path and map in metres.

use mono_geometry::Se2;
use nalgebra::{Matrix3, Rotation3, Vector2, Vector3};

use super::{FrameOutcome, Slam};
use crate::filter::drift::{Support, cover};
use crate::filter::linearised::PosePosterior;
use crate::filter::motion::{Control, MotionPrior};
use crate::filter::particle::Particle;
use crate::frontend::catalogue::Stage;
use crate::record::{LandmarkRecord, PlanarPose};

impl Slam {
    /// Weighted mean and covariance of the body pose over the particles, plus
    /// what each particle leaves open, the constant scale error of the wheels and
    /// the drift of the path the particles share.
    pub(super) fn estimate(
        &mut self,
        support: Option<&Support>,
        control: &Control,
    ) -> (PlanarPose, Matrix3<f64>) {
        let (pose, covariance) = self.spread();
        let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), self.last_outcome.0.phi);
        let odometry = turn.matrix() * control.covariance * turn.matrix().transpose();
        let drift = self
            .drift
            .push(Vector2::new(pose.x, pose.y), support, &odometry);
        // The methods of the paper report what their particles show.
        let covered = if self.mapping.delayed.is_none() {
            cover(&covariance, &drift)
        } else {
            covariance
        };
        let along = Vector3::new(pose.x, pose.y, 0.0) * self.config.odometry.scale_bias;
        (pose, covered + along * along.transpose())
    }

    fn spread(&self) -> (PlanarPose, Matrix3<f64>) {
        let set = self.filter.set();
        let weights = set.weights();
        let first = set.particles()[0].pose.phi;
        let mut mean = Vector3::zeros();
        for (w, p) in weights.iter().zip(set.particles()) {
            let turn = mono_geometry::angle::wrap(p.pose.phi - first);
            mean += Vector3::new(p.metric.mean.y, p.metric.mean.z, turn) * *w;
        }
        let mut covariance = Matrix3::zeros();
        for (w, p) in weights.iter().zip(set.particles()) {
            let turn = mono_geometry::angle::wrap(p.pose.phi - first);
            let d = Vector3::new(p.metric.mean.y, p.metric.mean.z, turn) - mean;
            covariance += d * d.transpose() * *w;
            for i in 0..2 {
                for j in 0..2 {
                    covariance[(i, j)] += w * p.metric.covariance[(i + 1, j + 1)];
                }
            }
        }
        (
            PlanarPose {
                x: mean.x,
                y: mean.y,
                phi: mono_geometry::angle::wrap(first + mean.z),
            },
            covariance,
        )
    }

    pub(super) fn report_between(
        &self,
        reference: &Particle,
        prior: &MotionPrior,
        posterior: &PosePosterior,
        motion: Se2,
        outcome: &mut FrameOutcome,
    ) {
        let (pose, covariance) = self.last_outcome;
        let at = Se2::new(pose.x, pose.y, pose.phi);
        let now = at.compose(&motion);
        let (dx, dy) = (now.x - at.x, now.y - at.y);
        let transition = Matrix3::new(1.0, 0.0, -dy, 0.0, 1.0, dx, 0.0, 0.0, 1.0);
        let step = posterior.pose_covariance(prior);
        let s = reference.metric.mean.x;
        let scale = Vector3::new(s, s, 1.0);
        let mut added = Matrix3::zeros();
        for (i, gi) in [0, 1, 3].into_iter().enumerate() {
            for (j, gj) in [0, 1, 3].into_iter().enumerate() {
                added[(i, j)] = step[(gi, gj)] * scale[i] * scale[j];
            }
        }
        outcome.pose = PlanarPose {
            x: now.x,
            y: now.y,
            phi: now.phi,
        };
        outcome.covariance = transition * covariance * transition.transpose() + added;
    }

    /// The whole path of the best particle, one body pose per frame.
    #[must_use]
    pub fn smoothed_path(&self) -> Vec<PlanarPose> {
        let set = self.filter.set();
        let best = &set.particles()[set.best()];
        self.relative
            .iter()
            .filter_map(|(keyframe, motion)| {
                let body = best.path.get(*keyframe as usize)?.body;
                let pose = Se2::new(body.x, body.y, body.phi).compose(motion);
                Some(PlanarPose {
                    x: pose.x,
                    y: pose.y,
                    phi: pose.phi,
                })
            })
            .collect()
    }

    /// The map of the best particle in metres, in id order; landmarks whose
    /// depth is not positive are left out.
    #[must_use]
    pub fn landmarks(&self) -> Vec<LandmarkRecord> {
        let set = self.filter.set();
        let best = &set.particles()[set.best()];
        self.catalogue
            .iter()
            .filter(|(_, e)| e.stage == Stage::Mapped)
            .filter_map(|(id, entry)| {
                let landmark = best.map.get(id)?;
                let (position, covariance) = best.metric_point(landmark, &self.position_in_body)?;
                Some(LandmarkRecord {
                    id,
                    position,
                    covariance,
                    observations: entry.observations,
                    descriptor: Some(entry.descriptor.clone()),
                })
            })
            .collect()
    }
}

/// Metric body motion of the reference particle since its keyframe.
pub(super) fn relative_motion(
    reference: &Particle,
    prior: &MotionPrior,
    posterior: &PosePosterior,
) -> Se2 {
    let pose = posterior.mean_pose(prior);
    let body = reference
        .metric
        .condition_on_pose(prior, &pose)
        .body(pose.phi);
    let from = reference.metric.body(reference.pose.phi);
    Se2::new(from.x, from.y, from.phi).between(&Se2::new(body.x, body.y, body.phi))
}
