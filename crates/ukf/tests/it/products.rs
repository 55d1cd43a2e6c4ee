//! A product of manifolds as a state: a robot with a heading near the cut and a landmark.

use nalgebra::{Matrix1, Matrix5, Vector1, Vector2, Vector5};
use proptest::prelude::*;
use ukf::{Angle, Manifold, Se2, SigmaPoints, Ukf, product_manifold};

product_manifold! {
    /// A robot and a landmark.
    #[derive(Debug, Clone, Copy, PartialEq)]
    struct State: Manifold<5> {
        robot: Se2 = 3,
        landmark: Vector2<f64> = 2,
    }
}

product_manifold! {
    /// A range and a bearing.
    #[derive(Debug, Clone, Copy, PartialEq)]
    struct Seen: Manifold<2> {
        range: f64 = 1,
        bearing: Angle = 1,
    }
}

fn seen(state: &State) -> Seen {
    let place = state.robot.inverse().act(&state.landmark);
    Seen {
        range: place.norm(),
        bearing: Angle::new(place.y.atan2(place.x)),
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]
    #[test]
    fn a_product_obeys_the_laws_of_a_manifold_field_by_field(
        start in prop::array::uniform5(-3.0..3.0_f64), step in prop::array::uniform5(-3.0..3.0_f64),
    ) {
        let state = State {
            robot: Se2::new(start[0], start[1], start[2]),
            landmark: Vector2::new(start[3], start[4]),
        };
        let step = Vector5::from(step);
        let moved = state.retract(&step);
        prop_assert!((state.local(&moved) - step).amax() < 1e-13);
        prop_assert_eq!(moved.robot, state.robot.retract(&step.fixed_rows::<3>(0).into_owned()));
        prop_assert_eq!(moved.landmark, state.landmark + step.fixed_rows::<2>(3));
    }
}

/// The robot is sure of its place, the landmark is not: range and bearing put it where they say, across the cut.
#[test]
fn a_landmark_is_found_through_a_product_state() {
    let truth = State {
        robot: Se2::new(1.0, 2.0, 3.1),
        landmark: Vector2::new(-3.0, 1.0),
    };
    let start = State {
        landmark: truth.landmark + Vector2::new(0.3, -0.2),
        ..truth
    };
    let covariance = Matrix5::from_diagonal(&Vector5::new(1e-6, 1e-6, 1e-6, 0.1, 0.1));
    let mut filter = Ukf::new(start, covariance, SigmaPoints::default()).unwrap();
    let noise = nalgebra::Matrix2::identity() * 1e-6;
    for _ in 0..3 {
        filter.update(&seen(&truth), &noise, seen).unwrap();
    }
    assert!((filter.mean().landmark - truth.landmark).norm() < 0.01);
    assert!(filter.mean().robot.local(&truth.robot).norm() < 0.01);
    // the heading's variance adds to that of the bearing, 4 m away: nothing is more precise than that
    assert!(filter.covariance().fixed_view::<2, 2>(3, 3).trace() < 1e-4);
    let told = filter
        .update(&Vector1::new(2.0), &Matrix1::new(1.0), |s| {
            Vector1::new(s.robot.y)
        })
        .unwrap();
    assert!(told.nis < 1e-2);
}
