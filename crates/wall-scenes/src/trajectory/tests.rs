//! The path against its wheels, and each effect of the carrier against its stated size.

use super::*;
use crate::odometry::{OdometryNoise, report};
use crate::stops::Stop;
use rand::SeedableRng;

const WALL: Course = Course::Straight {
    step_m: 0.1,
    wave_m: 4.0,
};
const ROOM: Course = Course::Loop {
    long_m: 2.2,
    short_m: 1.2,
    laps: 1,
    overlap: 14,
};

fn plan(course: Course, frames: usize, carrier: Carrier) -> Drive {
    Drive {
        course,
        frames,
        rate: FrameRate::ONE,
        carrier,
        stops: Stops::default(),
        kidnap: None,
        shutter_s: 0.0,
    }
}

fn drive(plan: &Drive) -> TruePath {
    let stream = |seed| ChaCha8Rng::seed_from_u64(seed);
    TruePath::drive(
        plan,
        &mut DriveStreams {
            steering: stream(3),
            slip: stream(4),
            sway: stream(5),
        },
    )
    .unwrap()
}

/// Integrates odometry rows from `start` and returns the pose at each of `times_s`.
/// Times and rows must be sorted.
fn dead_reckoning(start: Se2, rows: &[OdometryRow], times_s: &[f64]) -> Vec<Se2> {
    let mut pose = start;
    let mut now = rows.first().map_or(0.0, |row| row.t_s);
    let mut next = 0;
    let mut poses = Vec::with_capacity(times_s.len());
    for &time in times_s {
        while now < time && next < rows.len() {
            let row_end = rows.get(next + 1).map_or(f64::INFINITY, |row| row.t_s);
            let until = row_end.min(time);
            let row = rows[next];
            pose = advance(&pose, [row.v_mps, 0.0], row.omega_radps, until - now);
            now = until;
            if now >= row_end {
                next += 1;
            }
        }
        poses.push(pose);
    }
    poses
}

fn noiseless(path: &TruePath) -> Vec<OdometryRow> {
    report(
        &path.controls,
        &OdometryNoise::NONE,
        &Carrier::IDEAL,
        &mut ChaCha8Rng::seed_from_u64(4),
    )
}

fn assert_same(a: &Se2, b: &Se2) {
    assert!((a.x - b.x).hypot(a.y - b.y) < 1e-12, "{a:?} {b:?}");
    assert!(wrap(a.phi - b.phi).abs() < 1e-12, "{a:?} {b:?}");
}

#[test]
fn noiseless_odometry_integrates_to_the_truth() {
    for course in [WALL, ROOM] {
        let path = drive(&plan(course, 60, Carrier::IDEAL));
        let reckoned = dead_reckoning(Se2::identity(), &noiseless(&path), &path.times_s);
        for (a, b) in reckoned.iter().zip(&path.poses) {
            assert_same(a, b);
        }
    }
}

#[test]
fn with_an_offset_origin_noiseless_odometry_integrates_to_the_turning_centre() {
    let ahead = -0.59;
    let carrier = Carrier {
        origin_ahead_m: ahead,
        ..Carrier::IDEAL
    };
    let path = drive(&plan(ROOM, 186, carrier));
    assert_eq!((path.poses[0].x, path.poses[0].y), (0.0, 0.0));
    let reckoned = dead_reckoning(Se2::new(-ahead, 0.0, 0.0), &noiseless(&path), &path.times_s);
    let mut most = 0.0_f64;
    for (centre, body) in reckoned.iter().zip(&path.poses) {
        let (sin, cos) = body.phi.sin_cos();
        assert_same(
            centre,
            &Se2::new(body.x - ahead * cos, body.y - ahead * sin, body.phi),
        );
        most = most.max((centre.x + ahead - body.x).hypot(centre.y - body.y));
    }
    // The wrong form, wheels at the body origin, is more than a metre off half-way round.
    assert!(most > 1.0, "{most}");
}

#[test]
fn images_at_common_times_show_the_same_poses_at_every_frame_rate() {
    let carrier = Carrier {
        curve_slip_s: 0.1,
        slip_ratio: 0.03,
        roll_rad: 0.01,
        pitch_rad: 0.02,
        origin_ahead_m: 0.3,
        slope_rad: 0.05,
        ..Carrier::IDEAL
    };
    for course in [WALL, ROOM] {
        let mut plan = plan(course, 60, carrier);
        let once = drive(&plan);
        for multiple in [2, 4, 8] {
            plan.rate = FrameRate {
                multiple,
                divisor: 1,
            };
            let often = drive(&plan);
            assert_eq!(often.poses.len(), 59 * multiple + 1);
            assert_eq!(often.controls, once.controls);
            for k in 0..60 {
                assert_eq!(often.times_s[k * multiple], once.times_s[k]);
                assert_eq!(often.poses[k * multiple], once.poses[k]);
                assert_eq!(often.attitudes[k * multiple], once.attitudes[k]);
            }
            // Between them the path is a path: no step is longer than the speed allows.
            for pair in often.poses.windows(2) {
                let step = (pair[1].x - pair[0].x).hypot(pair[1].y - pair[0].y);
                assert!(step < 0.4 / multiple as f64, "{step}");
            }
        }
        plan.rate = FrameRate {
            multiple: 1,
            divisor: 4,
        };
        let seldom = drive(&plan);
        assert_eq!(seldom.poses.len(), 15);
        for (k, pose) in seldom.poses.iter().enumerate() {
            assert_eq!(*pose, once.poses[4 * k]);
        }
    }
}

#[test]
fn slip_in_curves_and_at_random_has_the_stated_size() {
    let sideways = |plan: &Drive| -> Vec<[f64; 3]> {
        let path = drive(plan);
        path.poses
            .windows(2)
            .map(|pair| {
                let turn = wrap(pair[1].phi - pair[0].phi);
                let (dx, dy) = (pair[1].x - pair[0].x, pair[1].y - pair[0].y);
                let (sin, cos) = (pair[0].phi + turn / 2.0).sin_cos();
                [cos * dx + sin * dy, cos * dy - sin * dx, turn]
            })
            .collect()
    };
    // In curves: outwards by 0.2 s times the turn rate, row by row (an image a row).
    let carrier = Carrier {
        curve_slip_s: 0.2,
        ..Carrier::IDEAL
    };
    let rows = Drive {
        rate: FrameRate {
            multiple: ROWS_PER_FRAME,
            divisor: 1,
        },
        ..plan(ROOM, 186, carrier)
    };
    let mut widest = 0.0_f64;
    for [ahead, left, turn] in sideways(&rows) {
        assert!((left / ahead + 0.2 * turn / 0.1).abs() < 1e-9);
        widest = widest.max(left / ahead);
    }
    // A clockwise course is left on its left side.
    assert!(widest > 0.02, "{widest}");
    // At random: 4 % of a frame's length.
    let carrier = Carrier {
        slip_ratio: 0.04,
        ..Carrier::IDEAL
    };
    let steps = sideways(&plan(WALL, 2001, carrier));
    let ratio2: f64 = steps
        .iter()
        .map(|[ahead, left, _]| (left / ahead).powi(2) / 2000.0)
        .sum();
    // A sample deviation of 2000 draws is within 6 % at four sigma.
    assert!(
        (ratio2.sqrt() / 0.04 - 1.0).abs() < 0.07,
        "{}",
        ratio2.sqrt()
    );
}

#[test]
fn sway_has_the_stated_root_mean_square_and_leaves_the_plane_alone() {
    let carrier = Carrier {
        roll_rad: 0.012,
        pitch_rad: 0.005,
        ..Carrier::IDEAL
    };
    let level = drive(&plan(WALL, 2001, Carrier::IDEAL));
    let path = drive(&plan(WALL, 2001, carrier));
    assert_eq!(path.poses, level.poses);
    let rms = |of: fn(&Attitude) -> f64| {
        let sum: f64 = path.attitudes.iter().map(|a| of(a).powi(2)).sum();
        (sum / 2001.0).sqrt()
    };
    assert!((rms(|a| a.roll_rad) / 0.012 - 1.0).abs() < 0.02);
    assert!((rms(|a| a.pitch_rad) / 0.005 - 1.0).abs() < 0.02);
    assert!(level.attitudes.iter().all(|a| *a == Attitude::LEVEL));
}

#[test]
fn a_slope_raises_the_nose_with_the_floor_and_shortens_the_way_in_the_plane() {
    let carrier = Carrier {
        slope_rad: 0.1,
        ..Carrier::IDEAL
    };
    let path = drive(&plan(WALL, 41, carrier));
    // Half a wave of 4 m: the height is the integral of sin(0.1 sin), to the third order 0.2 / pi * 2 * (1 - 0.1^2 / 9).
    let peak = path
        .attitudes
        .iter()
        .map(|a| a.height_m)
        .fold(0.0, f64::max);
    let expected = 0.1 * 4.0 / std::f64::consts::PI * (1.0 - 0.01 / 9.0);
    assert!((peak / expected - 1.0).abs() < 0.01, "{peak} {expected}");
    for (pair, poses) in path.attitudes.windows(2).zip(path.poses.windows(2)) {
        let climbed = pair[1].height_m - pair[0].height_m;
        let driven = (poses[1].x - poses[0].x).hypot(poses[1].y - poses[0].y);
        let nose_up = -(pair[0].pitch_rad + pair[1].pitch_rad) / 2.0;
        assert!((climbed.atan2(driven) - nose_up).abs() < 5e-4);
    }
    let level = drive(&plan(WALL, 41, Carrier::IDEAL));
    // Mean of 1 - cos: a quarter of the square of the steepest slope.
    let shortened = 1.0 - path.poses[40].x / level.poses[40].x;
    assert!((shortened / 0.0025 - 1.0).abs() < 0.1, "{shortened}");
}

#[test]
fn arc_series_meets_the_closed_form() {
    let start = Se2::new(1.0, -2.0, 0.3);
    for omega in [1.9e-4, 2.1e-4, 0.5, -3.0] {
        let got = advance(&start, [0.7, 0.0], omega, 1.0);
        let radius = 0.7 / omega;
        let x = 1.0 + radius * ((0.3 + omega).sin() - 0.3_f64.sin());
        let y = -2.0 - radius * ((0.3 + omega).cos() - 0.3_f64.cos());
        // The closed form loses digits to cancellation at small omega.
        let tolerance = 8.0 * f64::EPSILON * radius.abs().max(1.0);
        assert!((got.x - x).abs() < tolerance && (got.y - y).abs() < tolerance);
    }
}

#[test]
fn wall_run_is_a_decimetre_a_frame_with_varying_heading() {
    let path = drive(&plan(WALL, 38, Carrier::IDEAL));
    let end = path.poses[37];
    assert!((end.x - 3.7).abs() < 0.1, "{end:?}");
    assert!(end.y.abs() < 0.15, "{end:?}");
    let widest = path.poses.iter().map(|p| p.phi.abs()).fold(0.0, f64::max);
    assert!((0.01..0.06).contains(&widest), "{widest}");
}

#[test]
fn room_loop_comes_back_to_its_start() {
    let path = drive(&plan(ROOM, 186, Carrier::IDEAL));
    let nearest_start = path.poses[150..]
        .iter()
        .map(|p| p.x.hypot(p.y))
        .fold(f64::INFINITY, f64::min);
    assert!(nearest_start < 0.25, "{nearest_start}");
}

#[test]
fn at_a_stop_the_drive_waits_and_goes_on_as_if_nothing_had_been() {
    let carrier = Carrier {
        roll_rad: 0.01,
        slope_rad: 0.05,
        curve_slip_s: 0.1,
        ..Carrier::IDEAL
    };
    let stops = Stops {
        pause: Some(Stop {
            every: 20,
            frames: 7,
        }),
        spin: Some(Stop {
            every: 50,
            frames: 12,
        }),
    };
    let through = drive(&plan(ROOM, 186, carrier));
    let frames = 186 + stops.added(185);
    let stopping = drive(&Drive {
        stops,
        ..plan(ROOM, frames, carrier)
    });
    assert_eq!(stopping.poses.len(), frames);
    // Frame by frame: the drive without stops, with the frames of the stops left out.
    let doings = stops.plan(frames - 1);
    let mut driven = 0;
    let mut turned = 0.0;
    for (frame, doing) in doings.iter().enumerate() {
        let [here, next] = [frame, frame + 1].map(|f| stopping.poses[f]);
        match doing {
            Doing::Drive => {
                // The rows before the last stop add up in another order.
                assert!((here.x - through.poses[driven].x).abs() < 1e-9, "{frame}");
                assert!((here.y - through.poses[driven].y).abs() < 1e-9, "{frame}");
                assert!(wrap(here.phi - through.poses[driven].phi).abs() < 1e-9);
                let (a, b) = (stopping.attitudes[frame], through.attitudes[driven]);
                assert!(
                    (a.roll_rad - b.roll_rad).abs() < 1e-9
                        && (a.height_m - b.height_m).abs() < 1e-9
                );
                driven += 1;
            }
            Doing::Stand => {
                assert_eq!(here, next);
                let [a, b] = [frame, frame + 1].map(|f| stopping.attitudes[f]);
                assert!((a.roll_rad - b.roll_rad).abs() < 1e-9);
                let row = stopping.controls[frame * ROWS_PER_FRAME];
                assert_eq!((row.v_mps, row.omega_radps), (0.0, 0.0));
            }
            Doing::Spin(_) => {
                assert!((here.x, here.y) == (next.x, next.y));
                turned += wrap(next.phi - here.phi);
            }
        }
    }
    assert_eq!(driven, 185);
    assert!((turned - 3.0 * TAU).abs() < 1e-9, "{turned}");
}

#[test]
fn wheels_at_rest_report_rest_and_leave_the_noise_of_other_rows_alone() {
    let stops = Stops {
        pause: Some(Stop {
            every: 3,
            frames: 4,
        }),
        spin: None,
    };
    let path = drive(&Drive {
        stops,
        ..plan(WALL, 12, Carrier::IDEAL)
    });
    let rows = report(
        &path.controls,
        &OdometryNoise::PAPER,
        &Carrier::IDEAL,
        &mut ChaCha8Rng::seed_from_u64(4),
    );
    for (row, control) in rows.iter().zip(&path.controls) {
        let rests = control.v_mps == 0.0;
        assert_eq!(rests, row.v_mps == 0.0 && row.omega_radps == 0.0);
    }
    assert!(rows.iter().filter(|row| row.v_mps == 0.0).count() > 20);
}

#[test]
fn a_kidnapped_robot_goes_on_along_its_course_and_its_wheels_do_not_know() {
    for (course, metres) in [(WALL, 3.0), (ROOM, 1.4)] {
        let kidnap = Kidnap { frame: 30, metres };
        let plan = Drive {
            kidnap: Some(kidnap),
            ..plan(course, 60, Carrier::IDEAL)
        };
        let path = drive(&plan);
        let step = |k: usize| {
            let [a, b] = [k - 1, k].map(|k| path.poses[k]);
            (a.x - b.x).hypot(a.y - b.y)
        };
        // The last step before, and that of the frame itself, are those of the wheels.
        let usual = step(29);
        assert!((step(30) - metres).abs() < 2.0 * usual, "{}", step(30));
        assert!(step(31) < 1.3 * usual && step(31) > 0.7 * usual);
        // The wheels report a drive that ends somewhere else.
        let reckoned = dead_reckoning(Se2::identity(), &noiseless(&path), &path.times_s);
        assert_same(&reckoned[29], &path.poses[29]);
        let away = (reckoned[30].x - path.poses[30].x).hypot(reckoned[30].y - path.poses[30].y);
        assert!((away / metres - 1.0).abs() < 0.1, "{away}");
    }
    let far = Drive {
        kidnap: Some(Kidnap {
            frame: 30,
            metres: 3.0,
        }),
        ..plan(ROOM, 60, Carrier::IDEAL)
    };
    let stream = |seed| ChaCha8Rng::seed_from_u64(seed);
    let refused = TruePath::drive(
        &far,
        &mut DriveStreams {
            steering: stream(3),
            slip: stream(4),
            sway: stream(5),
        },
    );
    let message = refused.unwrap_err().to_string();
    assert!(
        message.starts_with("distance of the kidnapping 3, required: 0 to "),
        "{message}"
    );
}

#[test]
fn an_exposure_is_about_the_time_of_its_image_and_never_across_a_kidnapping() {
    let plan = Drive {
        shutter_s: 0.2,
        kidnap: Some(Kidnap {
            frame: 8,
            metres: 1.0,
        }),
        ..plan(WALL, 16, Carrier::IDEAL)
    };
    let path = drive(&plan);
    for frame in 1..15 {
        let exposure = &path.exposures[frame];
        assert!(exposure.len() > 8);
        let mean = exposure.iter().map(|(pose, _)| pose.x).sum::<f64>() / exposure.len() as f64;
        let spread = exposure[exposure.len() - 1].0.x - exposure[0].0.x;
        // A fifth of a second at 0.2 m/s, and half of that beside the jump.
        if frame == 8 {
            assert!((0.01..0.03).contains(&spread), "{spread}");
            assert!((mean - path.poses[frame].x - 0.01).abs() < 0.002);
        } else {
            assert!((0.02..0.05).contains(&spread), "{frame}: {spread}");
            assert!((mean - path.poses[frame].x).abs() < 0.001);
        }
    }
    assert!(
        drive(&Drive {
            shutter_s: 0.0,
            ..plan
        })
        .exposures
        .iter()
        .all(Vec::is_empty)
    );
}
