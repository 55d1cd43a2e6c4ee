//! Problems that are refused, with the reason.

use slam_batch::{BatchError, solve};

use crate::simulation::{Drive, settings};

#[test]
fn a_problem_that_is_none_says_why() {
    let good = Drive::new(&settings(), 1).problem;
    assert!(good.check().is_ok());

    let mut one = good.clone();
    one.keyframes.truncate(1);
    assert_eq!(solve(&one), Err(BatchError::TooFewKeyframes { found: 1 }));

    let mut adrift = good.clone();
    adrift.keyframes[0].motion = Some(Vec::new());
    assert_eq!(solve(&adrift), Err(BatchError::NoStart));

    let mut blind = good.clone();
    blind.tracks.clear();
    assert_eq!(solve(&blind), Err(BatchError::NoTracks));

    let mut disordered = good.clone();
    disordered.tracks[0].sightings = good.tracks[0].sightings.iter().rev().copied().collect();
    assert!(matches!(
        solve(&disordered),
        Err(BatchError::Sighting { landmark: 0, .. })
    ));

    let mut noiseless = good.clone();
    noiseless.model.sigma_px = 0.0;
    assert!(
        solve(&noiseless)
            .unwrap_err()
            .to_string()
            .contains("sigma_px is 0, expected finite and above 0")
    );

    let mut nan = good.clone();
    nan.tracks[3].sightings[0].pixel.x = f64::NAN;
    assert!(matches!(solve(&nan), Err(BatchError::OutOfRange { .. })));

    for size_px in [f64::NAN, -1.0] {
        let mut sized = good.clone();
        sized.tracks[3].sightings[0].size_px = size_px;
        let reason = solve(&sized).unwrap_err().to_string();
        assert!(reason.contains("size of a keypoint"), "{reason}");
    }

    let mut rows = good;
    if let Some(motion) = &mut rows.keyframes[2].motion {
        motion[0].v_mps = f64::INFINITY;
    }
    assert!(matches!(solve(&rows), Err(BatchError::Geometry(_))));
}
