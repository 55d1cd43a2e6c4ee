//! Least-squares alignment of matched positions.
//!
//! Minimises `sum |y_i - (s R x_i + t)|^2` (Umeyama, PAMI 1991). The rotation is found by
//! Horn's quaternion form (JOSA A 1987): the unit quaternion is the eigenvector of the
//! largest eigenvalue of a symmetric 4x4 matrix built from the cross-covariance. It is
//! always a proper rotation, equal to Umeyama's, and needs no singular value
//! decomposition. The scale is `sum y_i' . R x_i' / sum |x_i'|^2` with centred points.
//! In the plane (SE(2)) the angle has a closed form and height is left alone; with a scale (Sim(2)) the same angle serves and
//! the scale is that of the planar coordinates.
//!
//! `Heading` turns the estimate about the first position `p` of the reference and does not move it: the sum
//! `|y_i - p - R (x_i - p)|^2` is smallest at the angle `atan2(sum a_i x b_i, sum a_i . b_i)` of the planar offsets
//! `a_i = x_i - p`, `b_i = y_i - p`. The offsets are from the start, not from the means: centred ones would free a
//! translation in secret.
//!
//! Positions on one line leave the rotation about it open: that is an error for SE(3) and
//! Sim(3) and no problem for SE(2) and Sim(2).

use nalgebra::{Isometry3, Matrix3, Matrix4, Quaternion, UnitQuaternion, Vector3};

use crate::alignment::{Alignment, Similarity};
use crate::error::EvaluationError;
use crate::pose::StampedPose;

/// The alignment of matched pairs.
pub(crate) fn alignment_of(
    pairs: &[(StampedPose, StampedPose)],
    alignment: Alignment,
) -> Result<Similarity, EvaluationError> {
    let position = |pose: &StampedPose| pose.world_from_frame.translation.vector;
    let estimates: Vec<_> = pairs
        .iter()
        .map(|(estimate, _)| position(estimate))
        .collect();
    let references: Vec<_> = pairs
        .iter()
        .map(|(_, reference)| position(reference))
        .collect();
    align_positions(&estimates, &references, alignment)
}

/// The similarity of the asked kind that brings `estimate` closest to `reference` (same lengths, metres).
///
/// # Errors
/// [`EvaluationError::Degenerate`] when the positions do not determine it.
fn align_positions(
    estimate: &[Vector3<f64>],
    reference: &[Vector3<f64>],
    alignment: Alignment,
) -> Result<Similarity, EvaluationError> {
    let identity = Similarity {
        scale: 1.0,
        reference_from_estimate: Isometry3::identity(),
    };
    if alignment == Alignment::None {
        return Ok(identity);
    }
    let degenerate = |reason| EvaluationError::Degenerate {
        alignment,
        poses: estimate.len(),
        reason,
    };
    let poses = estimate.len().min(reference.len());
    if poses < 2 {
        return Err(degenerate("at least two are needed"));
    }
    if alignment == Alignment::Heading {
        return turn_about_start(estimate, reference)
            .map(|reference_from_estimate| Similarity {
                scale: 1.0,
                reference_from_estimate,
            })
            .ok_or_else(|| degenerate("they fix no direction in the plane"));
    }
    let mean = |points: &[Vector3<f64>]| points.iter().sum::<Vector3<f64>>() / points.len() as f64;
    let (estimate_mean, reference_mean) = (mean(estimate), mean(reference));
    let mut cross = Matrix3::zeros();
    let mut estimate_square = 0.0;
    let mut reference_square = 0.0;
    for (x, y) in estimate.iter().zip(reference) {
        let (x, y) = (x - estimate_mean, y - reference_mean);
        cross += x * y.transpose();
        estimate_square += x.norm_squared();
        reference_square += y.norm_squared();
    }
    // Rounding of the centred coordinates: what is smaller carries no direction.
    let size = estimate_mean.norm_squared() + reference_mean.norm_squared();
    let floor = (f64::EPSILON * f64::EPSILON) * size * poses as f64;
    if estimate_square.min(reference_square) <= floor {
        return Err(degenerate("they all coincide"));
    }
    let rotation = match alignment {
        Alignment::Se2 | Alignment::Sim2 => {
            let (sin, cos) = (cross[(0, 1)] - cross[(1, 0)], cross[(0, 0)] + cross[(1, 1)]);
            if sin.hypot(cos) <= f64::EPSILON * (estimate_square * reference_square).sqrt() {
                return Err(degenerate("they fix no direction in the plane"));
            }
            UnitQuaternion::from_euler_angles(0.0, 0.0, sin.atan2(cos))
        }
        _ => horn_rotation(&cross).ok_or_else(|| degenerate("they lie on one line"))?,
    };
    let scale = match alignment {
        Alignment::Sim3 => {
            (rotation.to_rotation_matrix().matrix().transpose() * cross.transpose()).trace()
                / estimate_square
        }
        Alignment::Sim2 => {
            let (sin, cos) = (cross[(0, 1)] - cross[(1, 0)], cross[(0, 0)] + cross[(1, 1)]);
            let planar: f64 = estimate
                .iter()
                .map(|x| (x - estimate_mean).xy().norm_squared())
                .sum();
            sin.hypot(cos) / planar
        }
        _ => 1.0,
    };
    let mut translation = reference_mean - rotation * (estimate_mean * scale);
    if matches!(alignment, Alignment::Se2 | Alignment::Sim2) {
        translation.z = 0.0;
    }
    Ok(Similarity {
        scale,
        reference_from_estimate: Isometry3::from_parts(translation.into(), rotation),
    })
}

/// The turn about the vertical through the first reference that brings the estimate closest; `None` when every turn is
/// as good.
fn turn_about_start(
    estimate: &[Vector3<f64>],
    reference: &[Vector3<f64>],
) -> Option<Isometry3<f64>> {
    let pivot = *reference.first()?;
    let (mut sin, mut cos, mut size) = (0.0_f64, 0.0_f64, 0.0_f64);
    for (x, y) in estimate.iter().zip(reference) {
        let (a, b) = ((x - pivot).xy(), (y - pivot).xy());
        sin += a.perp(&b);
        cos += a.dot(&b);
        size += a.norm() * b.norm();
    }
    if sin.hypot(cos) <= f64::EPSILON * size {
        return None;
    }
    let rotation = UnitQuaternion::from_euler_angles(0.0, 0.0, sin.atan2(cos));
    Some(Isometry3::from_parts(
        (pivot - rotation * pivot).into(),
        rotation,
    ))
}

/// Rotation maximising `sum y . R x` for `cross = sum x y^T`; `None` when it is not unique.
fn horn_rotation(cross: &Matrix3<f64>) -> Option<UnitQuaternion<f64>> {
    let s = |row: usize, column: usize| cross[(row, column)];
    let (a, b, c) = (s(1, 2) - s(2, 1), s(2, 0) - s(0, 2), s(0, 1) - s(1, 0));
    let (d, e, f) = (s(0, 1) + s(1, 0), s(2, 0) + s(0, 2), s(1, 2) + s(2, 1));
    let (xx, yy, zz) = (s(0, 0), s(1, 1), s(2, 2));
    #[rustfmt::skip]
    let horn = Matrix4::new(
        xx + yy + zz, a,            b,            c,
        a,            xx - yy - zz, d,            e,
        b,            d,            yy - xx - zz, f,
        c,            e,            f,            zz - xx - yy,
    );
    let eigen = horn.symmetric_eigen();
    let mut order = [0, 1, 2, 3];
    order.sort_by(|&i, &j| eigen.eigenvalues[j].total_cmp(&eigen.eigenvalues[i]));
    let largest = eigen.eigenvalues[order[0]];
    let gap = largest - eigen.eigenvalues[order[1]];
    // The gap is twice the sum of the two smaller (signed) singular values of the cross-covariance.
    if largest <= 0.0 || gap <= 1e-12 * largest {
        return None;
    }
    let q = eigen.eigenvectors.column(order[0]);
    Some(UnitQuaternion::from_quaternion(Quaternion::new(
        q[0], q[1], q[2], q[3],
    )))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn config() -> ProptestConfig {
        ProptestConfig {
            cases: 64,
            failure_persistence: None,
            ..ProptestConfig::default()
        }
    }

    proptest! {
        #![proptest_config(config())]

        /// A similarity applied to a cloud is found again, and no small turn of it does better.
        #[test]
        fn a_similarity_is_recovered(
            cloud in prop::collection::vec(prop::array::uniform3(-5.0..5.0_f64), 4..20),
            angles in prop::array::uniform3(-3.0..3.0_f64),
            offset in prop::array::uniform3(-100.0..100.0_f64),
            scale in 0.1..10.0_f64,
        ) {
            let cloud: Vec<Vector3<f64>> = cloud.into_iter().map(Vector3::from).collect();
            let rotation = UnitQuaternion::from_euler_angles(angles[0], angles[1], angles[2]);
            let moved: Vec<_> = cloud.iter().map(|point| rotation * point * scale + Vector3::from(offset)).collect();
            let found = align_positions(&cloud, &moved, Alignment::Sim3).unwrap();
            prop_assert!((found.scale / scale - 1.0).abs() < 1e-10);
            prop_assert!(found.reference_from_estimate.rotation.angle_to(&rotation) < 1e-6);
            for (point, target) in cloud.iter().zip(&moved) {
                let aligned = found.apply(&Isometry3::translation(point.x, point.y, point.z));
                prop_assert!((aligned.translation.vector - target).norm() < 1e-6);
            }
        }

        /// The rigid alignment is a minimum: neighbours of it have a larger sum of squares.
        #[test]
        fn the_alignment_is_a_minimum(
            cloud in prop::collection::vec(prop::array::uniform3(-5.0..5.0_f64), 5..20),
            noise in prop::collection::vec(prop::array::uniform3(-1.0..1.0_f64), 20),
            turn in prop::array::uniform3(-0.01..0.01_f64),
            shift in prop::array::uniform3(-0.01..0.01_f64),
            planar in prop::bool::ANY,
        ) {
            let from: Vec<Vector3<f64>> = cloud.into_iter().map(Vector3::from).collect();
            let to: Vec<Vector3<f64>> = from.iter().zip(&noise).map(|(point, noise)| point + Vector3::from(*noise)).collect();
            let alignment = if planar { Alignment::Se2 } else { Alignment::Se3 };
            let best = align_positions(&from, &to, alignment).unwrap().reference_from_estimate;
            let cost = |motion: &Isometry3<f64>| -> f64 {
                from.iter().zip(&to).map(|(from, to)| (motion.rotation * from + motion.translation.vector - to).norm_squared()).sum()
            };
            let (turn, shift) = if planar { ([0.0, 0.0, turn[2]], [shift[0], shift[1], 0.0]) } else { (turn, shift) };
            let neighbour = Isometry3::new(Vector3::from(shift), Vector3::from(turn)) * best;
            prop_assert!(cost(&best) <= cost(&neighbour) * (1.0 + 1e-12));
        }
    }

    /// A planar similarity is found again from a straight path, too, which leaves a turn in space open; and a mirrored path stays an error where a turn in space would lay it over.
    #[test]
    fn a_planar_similarity_needs_no_curve_and_turns_nothing_over() {
        let rotation = UnitQuaternion::from_euler_angles(0.0, 0.0, 2.1);
        let moved = |path: &[Vector3<f64>]| -> Vec<Vector3<f64>> {
            path.iter()
                .map(|p| rotation * p * 0.3 + Vector3::new(7.0, -2.0, 0.0))
                .collect()
        };
        let straight: Vec<Vector3<f64>> = (0..9)
            .map(|k| Vector3::new(f64::from(k), 2.0 * f64::from(k), 0.0))
            .collect();
        let found = align_positions(&straight, &moved(&straight), Alignment::Sim2).unwrap();
        assert!((found.scale - 0.3).abs() < 1e-14);
        assert!(found.reference_from_estimate.rotation.angle_to(&rotation) < 1e-7);
        assert!(align_positions(&straight, &moved(&straight), Alignment::Sim3).is_err());
        let flat: Vec<Vector3<f64>> = curve()
            .iter()
            .map(|p| Vector3::new(p.x, p.y, 0.0))
            .collect();
        let mirrored: Vec<Vector3<f64>> =
            flat.iter().map(|p| Vector3::new(p.x, -p.y, 0.0)).collect();
        let left = |alignment| -> f64 {
            let found = align_positions(&flat, &mirrored, alignment).unwrap();
            flat.iter()
                .zip(&mirrored)
                .map(|(from, to)| {
                    let aligned = found.apply(&Isometry3::translation(from.x, from.y, from.z));
                    (aligned.translation.vector - to).norm_squared()
                })
                .sum()
        };
        let (planar, spatial) = (left(Alignment::Sim2), left(Alignment::Sim3));
        assert!(planar > 1.0 && spatial < 1e-20, "{planar}, {spatial}");
    }

    fn summed_squares(motion: &Isometry3<f64>, from: &[Vector3<f64>], to: &[Vector3<f64>]) -> f64 {
        from.iter()
            .zip(to)
            .map(|(from, to)| {
                (motion.rotation * from + motion.translation.vector - to).norm_squared()
            })
            .sum()
    }

    proptest! {
        #![proptest_config(config())]

        /// Of all turns about the start the found one is best, whatever the noise and the place of the start.
        #[test]
        fn the_freed_heading_is_the_best_turn_about_the_start(
            steps in prop::collection::vec(prop::array::uniform3(-0.5..0.5_f64), 5..30),
            noise in prop::collection::vec(prop::array::uniform3(-0.2..0.2_f64), 30),
            start in prop::array::uniform3(-50.0..50.0_f64),
            heading in -3.1..3.1_f64,
            other in 0.001..3.1_f64,
        ) {
            let mut path = vec![Vector3::from(start)];
            for step in steps {
                path.push(path[path.len() - 1] + Vector3::from(step) + Vector3::x());
            }
            let pivot = path[0];
            let turn = |angle: f64| {
                let rotation = UnitQuaternion::from_euler_angles(0.0, 0.0, angle);
                Isometry3::from_parts((pivot - rotation * pivot).into(), rotation)
            };
            let estimate: Vec<_> = path.iter().zip(&noise).map(|(point, noise)| {
                turn(heading) * nalgebra::Point3::from(point + Vector3::from(*noise))
            }).map(|point| point.coords).collect();
            let found = align_positions(&estimate, &path, Alignment::Heading).unwrap().reference_from_estimate;
            let best = summed_squares(&found, &estimate, &path);
            let (roll, pitch, angle) = found.rotation.euler_angles();
            prop_assert!(roll.abs() < 1e-12 && pitch.abs() < 1e-12);
            prop_assert!((found.rotation * pivot + found.translation.vector - pivot).norm() < 1e-10);
            for angle in [angle - other, angle + other] {
                prop_assert!(best <= summed_squares(&turn(angle), &estimate, &path) * (1.0 + 1e-9));
            }
        }
    }

    /// Twenty positions of a gentle left curve.
    fn curve() -> Vec<Vector3<f64>> {
        (0..20)
            .map(|k| 0.1 * f64::from(k))
            .map(|angle| Vector3::new(4.0 + 5.0 * angle.sin(), 6.0 - 5.0 * angle.cos(), 0.3))
            .collect()
    }

    fn turned_about_start(path: &[Vector3<f64>], angle: f64) -> Vec<Vector3<f64>> {
        let rotation = UnitQuaternion::from_euler_angles(0.0, 0.0, angle);
        path.iter()
            .map(|point| path[0] + rotation * (point - path[0]))
            .collect()
    }

    /// Half a turn has no wrong branch: just below, at and just above it the path comes back onto itself.
    #[test]
    fn headings_near_half_a_turn_are_freed() {
        let path = curve();
        for angle in [
            0.0,
            1.0,
            std::f64::consts::PI,
            -std::f64::consts::PI,
            std::f64::consts::PI - 1e-9,
            -std::f64::consts::PI + 1e-9,
        ] {
            let turned = turned_about_start(&path, angle);
            let found = align_positions(&turned, &path, Alignment::Heading)
                .unwrap()
                .reference_from_estimate;
            assert!(summed_squares(&found, &turned, &path).sqrt() < 1e-12);
            let (_, _, back) = found.rotation.euler_angles();
            assert!(
                ((back + angle).sin()).abs() < 1e-12 && (back + angle).cos() > 0.0,
                "{angle}: {back}"
            );
        }
    }

    /// The wrong forms: offsets from the means give the angle of SE(2), which is another one as soon as the estimate
    /// is also displaced (SE(2) moves it back, a turn has to make the best of it); and a shift of the whole estimate
    /// must stay an error.
    #[test]
    fn a_freed_heading_frees_no_translation() {
        let path = curve();
        let drifted: Vec<_> = turned_about_start(&path, 0.03)
            .into_iter()
            .enumerate()
            .map(|(k, point)| point + Vector3::new(0.0, if k > 0 { 0.5 } else { 0.0 }, 0.0))
            .collect();
        let angle = |alignment| {
            let found = align_positions(&drifted, &path, alignment).unwrap();
            found.reference_from_estimate.rotation.euler_angles().2
        };
        assert!((angle(Alignment::Heading) - angle(Alignment::Se2)).abs() > 0.05);

        let shifted: Vec<_> = path
            .iter()
            .map(|point| point + Vector3::new(0.0, 0.0, 0.5))
            .collect();
        let found = align_positions(&shifted, &path, Alignment::Heading).unwrap();
        let left = summed_squares(&found.reference_from_estimate, &shifted, &path);
        assert!((left / 20.0 - 0.25).abs() < 1e-12, "{left}");
    }

    #[test]
    fn a_robot_that_stood_still_has_no_heading_to_free() {
        let still = vec![Vector3::new(1.0, 2.0, 0.0); 4];
        let error = align_positions(&still, &still, Alignment::Heading).unwrap_err();
        assert_eq!(
            error.to_string(),
            "the heading alignment is not determined by 4 matched positions: they fix no direction in the plane"
        );
    }
}
