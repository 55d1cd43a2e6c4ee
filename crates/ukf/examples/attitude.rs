//! A drone's attitude from a gyroscope with an unknown bias, an accelerometer and a magnetometer, simulated.
//! The state is a type of its own: an attitude (3 degrees of freedom, on the sphere of quaternions) and the gyroscope's
//! bias. Printed: error, the filter's own deviation, and whether the two agree.
//!
//! `cargo run --example attitude`

use nalgebra::{SMatrix, SVector, UnitQuaternion, Vector3, Vector6};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use ukf::{Manifold, SigmaPoints, Ukf, assess_consistency, normalized_error_squared};

/// A product of two spaces: six numbers of tangent, three for each.
#[derive(Clone, Copy)]
struct State {
    world_from_body: UnitQuaternion<f64>,
    /// rad/s
    gyro_bias: Vector3<f64>,
}

impl Manifold<6> for State {
    fn retract(&self, tangent: &Vector6<f64>) -> Self {
        Self {
            world_from_body: self
                .world_from_body
                .retract(&tangent.fixed_rows::<3>(0).into()),
            gyro_bias: self.gyro_bias + tangent.fixed_rows::<3>(3),
        }
    }

    fn local(&self, other: &Self) -> Vector6<f64> {
        let turn = self.world_from_body.local(&other.world_from_body);
        let bias = other.gyro_bias - self.gyro_bias;
        Vector6::new(turn.x, turn.y, turn.z, bias.x, bias.y, bias.z)
    }
}

const DT: f64 = 0.01;
const GYRO_DEVIATION: f64 = 0.02; // rad/s at 100 Hz
const BIAS_WALK: f64 = 1e-4; // rad/s a step
const DIRECTION_DEVIATION: f64 = 0.05; // of unit vectors

fn turned(state: &State, rate: &Vector3<f64>) -> State {
    State {
        world_from_body: state
            .world_from_body
            .retract(&((rate - state.gyro_bias) * DT)),
        ..*state
    }
}

/// Up and magnetic north as the body sees them.
fn directions(state: &State) -> Vector6<f64> {
    let body_from_world = state.world_from_body.inverse();
    let up = body_from_world * Vector3::z();
    let north = body_from_world * Vector3::new(0.6, 0.0, -0.8);
    Vector6::new(up.x, up.y, up.z, north.x, north.y, north.z)
}

#[expect(clippy::print_stdout, reason = "an example shows its result")]
fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut normal = |deviation: f64| deviation * rng.sample::<f64, _>(StandardNormal);
    let mut truth = State {
        world_from_body: UnitQuaternion::identity(),
        gyro_bias: Vector3::new(0.05, -0.03, 0.02),
    };
    let start = State {
        world_from_body: truth.world_from_body.retract(&Vector3::new(0.4, -0.3, 0.5)),
        gyro_bias: Vector3::zeros(),
    };
    let squares = |turn: f64, bias: f64| {
        SMatrix::<f64, 6, 6>::from_diagonal(
            &Vector6::new(turn, turn, turn, bias, bias, bias).map(|d| d * d),
        )
    };
    let mut filter = Ukf::new(start, squares(0.5, 0.05), SigmaPoints::default())?;
    let process_noise = squares(GYRO_DEVIATION * DT, BIAS_WALK);
    let noise = SMatrix::<f64, 6, 6>::identity() * DIRECTION_DEVIATION.powi(2);

    let mut nees = Vec::new();
    for step in 1..=3000_u32 {
        let time = f64::from(step) * DT;
        let rate = Vector3::new((0.7 * time).sin(), 0.8 * (0.3 * time).cos(), 0.5);
        truth.world_from_body = truth.world_from_body.retract(&(rate * DT));
        truth.gyro_bias += Vector3::from_fn(|_, _| normal(BIAS_WALK));
        let gyro = rate + truth.gyro_bias + Vector3::from_fn(|_, _| normal(GYRO_DEVIATION));
        filter.predict(&process_noise, |state| turned(state, &gyro))?;
        if step % 10 == 0 {
            let seen: SVector<f64, 6> =
                directions(&truth) + Vector6::from_fn(|_, _| normal(DIRECTION_DEVIATION));
            filter.update(&seen, &noise, directions)?;
        }
        let error = filter.mean().local(&truth);
        if step % 500 == 0 {
            let deviation = filter.covariance().fixed_view::<3, 3>(0, 0).trace().sqrt();
            println!(
                "{time:4.0} s: attitude off by {:.2} deg (own deviation {:.2}), bias by {:.4} rad/s",
                error.fixed_rows::<3>(0).norm().to_degrees(),
                deviation.to_degrees(),
                error.fixed_rows::<3>(3).norm(),
            );
        }
        if step > 500 && step % 250 == 0 {
            nees.push(normalized_error_squared(&error, filter.covariance())?);
        }
    }
    let verdict = assess_consistency(nees, 6, 0.99)?;
    println!(
        "NEES {:.2} of 6, bounds {:.2} to {:.2}: {:?}",
        verdict.mean, verdict.lower, verdict.upper, verdict.verdict
    );
    Ok(())
}
