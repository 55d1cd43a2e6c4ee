//! Two-view estimates against OpenCV's; `reference/opencv_two_view.py` made the table.

use mono_geometry::epipolar::{
    Correspondence, choose_pose, essential_from_five, fundamental_from_points,
};
use nalgebra::{Matrix3, Vector2, Vector3};

/// Case, matches, and what follows them, for the rows of one kind.
fn rows(kind: &str, matches: usize) -> Vec<(usize, Vec<Correspondence>, Vec<f64>)> {
    include_str!("../reference/opencv_two_view.csv")
        .lines()
        .filter_map(|line| line.strip_prefix(kind)?.strip_prefix(','))
        .map(|line| {
            let (case, rest) = line.split_once(',').expect("a case");
            let numbers: Vec<f64> = rest
                .split(',')
                .map(|v| v.parse().expect("a number"))
                .collect();
            let (coordinates, rest) = numbers.split_at(4 * matches);
            let matches = coordinates
                .chunks(4)
                .map(|c| Correspondence {
                    first: Vector2::new(c[0], c[1]),
                    second: Vector2::new(c[2], c[3]),
                })
                .collect();
            (case.parse().expect("a case"), matches, rest.to_vec())
        })
        .collect()
}

/// Difference of the matrices scaled to norm 1, up to sign.
fn difference(a: &Matrix3<f64>, b: &Matrix3<f64>) -> f64 {
    let (a, b) = (a / a.norm(), b / b.norm());
    (a - b).norm().min((a + b).norm())
}

#[test]
fn val_opencv_five_point_solutions_are_the_same_set() {
    let rows = rows("five", 5);
    assert!(rows.len() > 40);
    for case in 0..12 {
        let theirs: Vec<_> = rows.iter().filter(|r| r.0 == case).collect();
        let mut ours = Vec::new();
        essential_from_five(theirs[0].1.first_chunk().unwrap(), &mut ours);
        assert_eq!(ours.len(), theirs.len(), "case {case}");
        for (_, _, e) in theirs {
            let e = Matrix3::from_row_slice(e);
            let nearest = ours
                .iter()
                .map(|o| difference(o, &e))
                .fold(f64::INFINITY, f64::min);
            // Theirs are not polished: half the digits, and fewer near double roots.
            assert!(nearest < 1e-6, "case {case}: {nearest:e}");
        }
    }
}

#[test]
fn val_opencv_eight_point_matrix() {
    let rows = rows("eight", 20);
    assert_eq!(rows.len(), 10);
    for (case, matches, f) in rows {
        let ours = fundamental_from_points(&matches).unwrap().matrix;
        let error = difference(&ours, &Matrix3::from_row_slice(&f));
        // Theirs is an eigenvector of A^T A: squaring costs digits.
        assert!(error < 1e-9, "case {case}: {error:e}");
    }
}

#[test]
fn val_opencv_recovered_pose() {
    let rows = rows("pose", 20);
    assert_eq!(rows.len(), 10);
    let all: Vec<usize> = (0..20).collect();
    for (case, matches, numbers) in rows {
        let e = Matrix3::from_row_slice(&numbers[..9]);
        let pose = choose_pose(&e, &matches, &all, 0.0).unwrap();
        let pose = pose.best().unwrap().second_from_first;
        let rotation = Matrix3::from_row_slice(&numbers[9..18]);
        let translation = Vector3::from_row_slice(&numbers[18..21]);
        assert!(
            (pose.rotation.matrix() - rotation).amax() < 1e-12,
            "case {case}"
        );
        assert!(
            (pose.translation - translation).amax() < 1e-12,
            "case {case}"
        );
    }
}
