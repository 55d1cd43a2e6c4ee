//! The covariance of the bodies of a window, in metres.

use std::sync::Arc;

use crate::filter::local_batch::segment_gaussian;
use crate::filter::metric::MetricState;
use crate::filter::motion::CarrierModel;
use crate::filter::window_equations::row_of;
use estimation_base::Manifold;
use nalgebra::{DMatrix, DVector, Rotation2, Vector2, Vector3};

use super::fixed_lag::{STEPS, carrier, drive, driven, mapping};

/// The scale is known to 5 %, and the unit of the path follows it: their product, the position in metres, is known much better than
/// either. Compared with difference quotients of the metric body.
#[test]
fn the_covariance_of_bodies_is_that_of_scale_and_path_together() {
    let mut drive = drive(47);
    drive.start.metric = MetricState::new(&CarrierModel {
        scale_sigma: 0.05,
        ..carrier()
    });
    // Nothing but the wheels tells the unit.
    for step in &mut drive.steps {
        let step = Arc::make_mut(step);
        step.observation.matches.retain(|m| m.id >= 4);
    }
    let mapping = mapping(&drive.rig);
    let gaussian = segment_gaussian(
        &drive.driver(&mapping),
        &drive.start,
        &driven(&drive),
        &drive.steps,
    )
    .unwrap();
    let lever_m = Vector2::new(0.3, -0.1);
    let found = gaussian.body_covariance(&lever_m).unwrap();
    let factor = &gaussian.factor;
    let joint = (factor * factor.transpose()).try_inverse().unwrap();
    let body = |k: usize, unknowns: &DVector<f64>| {
        let pose = gaussian.mean[k].retract(&unknowns.fixed_rows::<6>(row_of(k)).into_owned());
        let travelled =
            (pose.centre - drive.start.pose.centre).xy() * (gaussian.scale + unknowns[0]);
        let lever = Rotation2::new(pose.phi) * lever_m;
        Vector3::new(travelled.x - lever.x, travelled.y - lever.y, pose.phi)
    };
    let mut jacobian = DMatrix::zeros(3 * STEPS, joint.nrows());
    for column in 0..joint.nrows() {
        let mut step = DVector::zeros(joint.nrows());
        step[column] = 1e-6;
        for k in 0..STEPS {
            let rate = (body(k, &step) - body(k, &-&step)) / 2e-6;
            jacobian
                .fixed_view_mut::<3, 1>(3 * k, column)
                .copy_from(&rate);
        }
    }
    let expected = &jacobian * &joint * jacobian.transpose();
    let error = (&found - &expected).amax();
    assert!(
        error < 1e-6 * expected.amax(),
        "{error} of {}",
        expected.amax()
    );
    // Without the scale the last position is as uncertain as the unit.
    let last = 3 * (STEPS - 1);
    let alone = joint[(row_of(STEPS - 1), row_of(STEPS - 1))] * gaussian.scale.powi(2);
    assert!(
        alone > 4.0 * found[(last, last)],
        "{alone} {}",
        found[(last, last)]
    );
}
