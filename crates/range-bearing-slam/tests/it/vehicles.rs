//! The vehicles: mean and covariance against draws of every command's own noise.

use estimation_base::wrap;
use nalgebra::{Matrix3, Vector3};
use rand::RngExt;
use rand_distr::StandardNormal;
use range_bearing_slam::{
    Bicycle, Command, Deviation, Gaussian, MotionModel, Propagation, Unicycle,
};
use rbpf_core::{Purpose, Streams};
use std::f64::consts::TAU;

const FLOOR: [f64; 3] = [2e-3, 1e-3, 1e-3];
const DRAWS: u32 = 200_000;
const WHEELBASE: f64 = 1.2;

const fn deviation(fixed: f64, share: f64) -> Deviation {
    Deviation { fixed, share }
}

/// A bend to the left, then to the right, then straight, across the heading of pi.
fn commands() -> Vec<Command> {
    [
        (0.5, 1.2, 0.5),
        (0.4, 1.0, 0.3),
        (0.6, 1.5, -0.4),
        (0.5, 1.0, 0.0),
        (0.5, -0.5, 0.2),
    ]
    .map(|(seconds, speed, turn)| Command {
        seconds,
        speed,
        turn,
    })
    .to_vec()
}

const START: Vector3<f64> = Vector3::new(5.0, -3.0, 3.0);

/// The end of an arc by its centre, a line where it is straight to rounding.
fn drive(pose: &Vector3<f64>, speed: f64, rate: f64, seconds: f64) -> Vector3<f64> {
    let turned = pose.z + rate * seconds;
    if (rate * seconds).abs() < 1e-6 {
        let middle = pose.z + 0.5 * rate * seconds;
        let distance = speed * seconds;
        return Vector3::new(
            pose.x + distance * middle.cos(),
            pose.y + distance * middle.sin(),
            turned,
        );
    }
    let radius = speed / rate;
    Vector3::new(
        pose.x + radius * (turned.sin() - pose.z.sin()),
        pose.y - radius * (turned.cos() - pose.z.cos()),
        turned,
    )
}

/// Mean and covariance of the end, headings about that of `about`. `shared` draws the noise once for
/// all commands, the wrong form.
fn draws(
    about: &Vector3<f64>,
    speed: Deviation,
    turn: Deviation,
    rate: impl Fn(f64, f64) -> f64,
    shared: bool,
) -> Gaussian<3> {
    let mut rng = Streams::new(31).shared(0, Purpose::OdometryNoise);
    let spread = |d: Deviation, value: f64| d.fixed.hypot(d.share * value);
    let (mut sum, mut squares) = (Vector3::zeros(), Matrix3::zeros());
    for _ in 0..DRAWS {
        let mut draw = || rng.sample::<f64, _>(StandardNormal);
        let mut pose = START;
        let mut noise = [draw(), draw()];
        for command in commands() {
            let v = command.speed + noise[0] * spread(speed, command.speed);
            let a = command.turn + noise[1] * spread(turn, command.turn);
            pose = drive(&pose, v, rate(v, a), command.seconds);
            if !shared {
                noise = [draw(), draw()];
            }
        }
        let mut d = pose + Vector3::from(FLOOR).map(|floor| floor * draw()) - about;
        d.z = wrap(d.z);
        sum += d;
        squares += d * d.transpose();
    }
    let n = f64::from(DRAWS);
    let mean = sum / n;
    Gaussian {
        mean: about + mean,
        covariance: squares / n - mean * mean.transpose(),
    }
}

/// Largest excess of |model - draws| over a bound, in units of the bound: below one is agreement. `[mean, covariance]`.
///
/// A position is d (cos, sin) of a heading with error e of variance s^2, d the length of the path (3.25 m). The
/// model's mean is off by d s^2 / 2 to first order and d s^4 / 8 to second order; turn rates bent in
/// the steering angle (second derivative over first 2 tan(0.5) = 1.1) shift the heading in the same
/// way, by up to 0.55 s^2 and twice 0.55 s^4, hence 1 m more. Second moments are off by d^2 s^4 and by s^2 of
/// themselves. To this 5 standard errors of the draws.
fn excess(model: &Gaussian<3>, draws: &Gaussian<3>, propagation: Propagation) -> [f64; 2] {
    let n = f64::from(DRAWS);
    let p = &draws.covariance;
    let s2 = p[(2, 2)];
    let length: f64 = commands().iter().map(|c| (c.seconds * c.speed).abs()).sum();
    let d = length + 1.0;
    let mean_bias = match propagation {
        Propagation::Jacobians => d * s2 / 2.0,
        Propagation::SigmaPoints => d * s2 * s2,
    };
    let mut difference = model.mean - draws.mean;
    difference.z = wrap(difference.z);
    let mut worst = [0.0_f64; 2];
    for i in 0..3 {
        let bound = mean_bias + 5.0 * (p[(i, i)] / n).sqrt();
        worst[0] = worst[0].max(difference[i].abs() / bound);
        for j in 0..3 {
            let product = p[(i, i)] * p[(j, j)];
            let error = 5.0 * ((product + p[(i, j)].powi(2)) / n).sqrt();
            let bound = d * d * s2 * s2 + s2 * product.sqrt() + error;
            worst[1] = worst[1].max((model.covariance[(i, j)] - p[(i, j)]).abs() / bound);
        }
    }
    worst
}

const PROPAGATIONS: [Propagation; 2] = [Propagation::Jacobians, Propagation::SigmaPoints];

/// The end of the commands for a unicycle.
fn unicycle(speed: Deviation, turn_rate: Deviation, propagation: Propagation) -> Gaussian<3> {
    let vehicle = Unicycle {
        speed,
        turn_rate,
        floor: FLOOR,
        propagation,
    };
    vehicle.predict(&START, &commands())
}

/// `model` predicts with a propagation; `rate` is its turn rate.
fn check(
    speed: Deviation,
    turn: Deviation,
    model: impl Fn(Propagation) -> Gaussian<3>,
    rate: impl Fn(f64, f64) -> f64,
) {
    let about = model(Propagation::Jacobians).mean;
    let right = draws(&about, speed, turn, &rate, false);
    let wrong = draws(&about, speed, turn, &rate, true);
    for propagation in PROPAGATIONS {
        let model = model(propagation);
        let [mean, covariance] = excess(&model, &right, propagation);
        assert!(
            mean < 1.0 && covariance < 1.0,
            "{propagation:?} {mean} {covariance}"
        );
        // one noise for the whole list, instead of one each, is another covariance by far
        let [_, covariance] = excess(&model, &wrong, propagation);
        assert!(covariance > 5.0, "{propagation:?} {covariance}");
    }
}

#[test]
fn a_unicycle_agrees_with_draws() {
    let (speed, turn_rate) = (deviation(0.02, 0.05), deviation(0.03, 0.1));
    let model = |propagation| unicycle(speed, turn_rate, propagation);
    check(speed, turn_rate, model, |_, turn| turn);
}

#[test]
fn a_bicycle_agrees_with_draws() {
    let (speed, steering) = (deviation(0.02, 0.05), deviation(0.03, 0.05));
    let model = |propagation| {
        let vehicle = Bicycle {
            wheelbase: WHEELBASE,
            speed,
            steering,
            floor: FLOOR,
            propagation,
        };
        vehicle.predict(&START, &commands())
    };
    check(speed, steering, model, |v, a| v * a.tan() / WHEELBASE);
}

/// A heading uncertain by 0.25 rad: the mean by Jacobians is off by many standard errors, by sigma points not.
#[test]
fn sigma_points_have_the_mean_that_jacobians_miss() {
    let (speed, turn_rate) = (deviation(0.05, 0.0), deviation(0.25, 0.0));
    let [jacobians, sigma] =
        PROPAGATIONS.map(|propagation| unicycle(speed, turn_rate, propagation));
    let truth = draws(&jacobians.mean, speed, turn_rate, |_, turn| turn, false);
    let off = |model: &Gaussian<3>| (model.mean - truth.mean).xy().norm();
    let error =
        5.0 * ((truth.covariance[(0, 0)] + truth.covariance[(1, 1)]) / f64::from(DRAWS)).sqrt();
    assert!(off(&jacobians) > 5.0 * error, "{} {error}", off(&jacobians));
    assert!(
        off(&sigma) < 0.2 * off(&jacobians) + error,
        "{} {error}",
        off(&sigma)
    );
    assert!(off(&sigma) + 2.0 * error < off(&jacobians));
}

/// Sums and differences of numbers up to ten: some 1e-15 each.
#[test]
fn tangents_lead_from_one_pose_to_the_other_across_the_cut() {
    let still = deviation(0.0, 0.0);
    let unicycle = Unicycle {
        speed: still,
        turn_rate: still,
        floor: FLOOR,
        propagation: Propagation::Jacobians,
    };
    let bicycle = Bicycle {
        wheelbase: WHEELBASE,
        speed: still,
        steering: still,
        floor: FLOOR,
        propagation: Propagation::Jacobians,
    };
    let from = Vector3::new(1.0, -2.0, 3.1);
    let to = Vector3::new(4.0, 5.0, -3.1);
    for tangent in [unicycle.local(&from, &to), bicycle.local(&from, &to)] {
        assert!((tangent.z - (TAU - 6.2)).abs() < 1e-14, "{tangent}");
        for reached in [
            unicycle.retract(&from, &tangent),
            bicycle.retract(&from, &tangent),
        ] {
            assert!((reached - to).amax() < 1e-14, "{reached}");
        }
    }
}
