//! filterpy's unscented filter on three published examples, step by step. Tables: `filterpy/generate.py`.

use nalgebra::{
    Matrix1, Matrix2, Matrix3, SMatrix, SVector, Vector1, Vector2, Vector3, matrix, vector,
};
use ukf::{Angle, CholeskyFactor, Manifold, SigmaPoints, SquareRootUkf, Ukf};

/// Both programs round each of some hundred operations a step in 40 steps; the filters forget earlier rounding. Relative to
/// standard deviations for means, to the product of two of them for covariances.
const TOLERANCE: f64 = 1e-9;

type Moments<const L: usize> = (SVector<f64, L>, SMatrix<f64, L, L>);

/// Measurement, then mean and covariance by scaled points, then by Julier's.
fn rows<const L: usize, const M: usize>(table: &str) -> Vec<(SVector<f64, M>, [Moments<L>; 2])> {
    table
        .lines()
        .map(|line| {
            let values: Vec<f64> = line
                .split(',')
                .map(|v| v.parse().expect("a number"))
                .collect();
            let size = L + L * L;
            assert_eq!(values.len(), M + 2 * size);
            let state = |at: usize| {
                let at = M + at * size;
                let mean = SVector::from_column_slice(&values[at..at + L]);
                let covariance = SMatrix::from_row_slice(&values[at + L..at + size]);
                (mean, covariance)
            };
            (
                SVector::from_column_slice(&values[..M]),
                [state(0), state(1)],
            )
        })
        .collect()
}

struct Model<X, Z, const L: usize, const M: usize> {
    start: X,
    covariance: SMatrix<f64, L, L>,
    q: SMatrix<f64, L, L>,
    r: SMatrix<f64, M, M>,
    f: fn(&X) -> X,
    h: fn(&X) -> Z,
    state: fn(&SVector<f64, L>) -> X,
    measurement: fn(&SVector<f64, M>) -> Z,
}

fn check<X: Manifold<L>, Z: Manifold<M>, const L: usize, const M: usize>(
    table: &str,
    model: &Model<X, Z, L, M>,
) {
    let rows = rows::<L, M>(table);
    assert_eq!(rows.len(), 40);
    let sets = [
        SigmaPoints::scaled(0.5, 2.0, 1.0).expect("valid parameters"),
        SigmaPoints::julier(1.0).expect("valid parameters"),
    ];
    let factor = |matrix: &_| CholeskyFactor::definite(matrix);
    for (number, set) in sets.into_iter().enumerate() {
        let mut plain = Ukf::new(model.start.clone(), model.covariance, set).expect("definite");
        let root = factor(&model.covariance).expect("definite");
        let mut square_root = SquareRootUkf::new(model.start.clone(), root, set).expect("finite");
        let q = factor(&model.q).expect("definite");
        let r = CholeskyFactor::definite(&model.r).expect("definite");
        for (step, (z, reference)) in rows.iter().enumerate() {
            let z = (model.measurement)(z);
            plain.predict(&model.q, model.f).expect("definite");
            plain.update(&z, &model.r, model.h).expect("definite");
            square_root.predict(&q, model.f).expect("definite");
            square_root.update(&z, &r, model.h).expect("definite");
            let (mean, covariance) = &reference[number];
            let mean = (model.state)(mean);
            let deviations = covariance.diagonal().map(f64::sqrt);
            for (ours, c) in [
                (plain.mean(), *plain.covariance()),
                (square_root.mean(), square_root.covariance()),
            ] {
                let gap = mean.local(ours).component_div(&deviations).amax();
                assert!(gap < TOLERANCE, "set {number}, step {step}: mean {gap:e}");
                let scale = deviations * deviations.transpose();
                let gap = (c - covariance).component_div(&scale).amax();
                assert!(
                    gap < TOLERANCE,
                    "set {number}, step {step}: covariance {gap:e}"
                );
            }
        }
    }
}

#[test]
fn val_filterpy_falling_body() {
    check(
        include_str!("filterpy/falling_body.csv"),
        &Model {
            start: vector![3e5, 2e4, 3e-5],
            covariance: Matrix3::from_diagonal(&vector![1e6, 4e6, 1e-6]),
            q: Matrix3::from_diagonal(&vector![1e-2, 1e-2, 1e-16]),
            r: Matrix1::new(1e4),
            f: |x: &Vector3<f64>| {
                (0..20).fold(*x, |x, _| {
                    let drag = (-5e-5 * x[0]).exp() * x[1] * x[1] * x[2];
                    x + vector![-x[1], -drag, 0.0] * 0.05
                })
            },
            h: |x| Vector1::new(1e5_f64.hypot(x[0] - 1e5)),
            state: |x| *x,
            measurement: |z| *z,
        },
    );
}

#[test]
fn val_filterpy_van_der_pol() {
    check(
        include_str!("filterpy/van_der_pol.csv"),
        &Model {
            start: vector![0.0, 5.0],
            covariance: matrix![1.0, 0.2; 0.2, 2.0],
            q: matrix![1e-3, 2e-4; 2e-4, 1e-3],
            r: Matrix1::new(1e-2),
            f: |x: &Vector2<f64>| x + vector![x[1], 0.2 * (1.0 - x[0] * x[0]) * x[1] - x[0]] * 0.1,
            h: |x| Vector1::new(x[0]),
            state: |x| *x,
            measurement: |z| *z,
        },
    );
}

/// Position and heading as a product of the plane and the circle, range and bearing likewise: the first entries add, the
/// last wraps.
#[derive(Clone, Copy)]
struct LastWraps<const N: usize>(SVector<f64, N>);

impl<const N: usize> LastWraps<N> {
    fn new(mut values: SVector<f64, N>) -> Self {
        values[N - 1] = Angle::new(values[N - 1]).radians();
        Self(values)
    }
}

impl<const N: usize> Manifold<N> for LastWraps<N> {
    fn retract(&self, tangent: &SVector<f64, N>) -> Self {
        Self::new(self.0 + tangent)
    }

    fn local(&self, other: &Self) -> SVector<f64, N> {
        Self::new(other.0 - self.0).0
    }
}

#[test]
fn val_filterpy_beacons() {
    check(
        include_str!("filterpy/beacons.csv"),
        &Model {
            start: LastWraps(vector![0.2, -0.1, 2.8]),
            covariance: matrix![0.3, 0.05, 0.0; 0.05, 0.2, 0.02; 0.0, 0.02, 0.1],
            q: matrix![1e-3, 2e-4, 0.0; 2e-4, 1e-3, 1e-4; 0.0, 1e-4, 2e-3],
            r: Matrix2::new(0.04, 0.002, 0.002, 0.01),
            f: |x: &LastWraps<3>| {
                let heading = x.0[2] + 0.05;
                let step = vector![0.3 * heading.cos(), 0.3 * heading.sin(), 0.1];
                LastWraps::new(x.0 + step)
            },
            h: |x| {
                let d = vector![-6.0 - x.0[0], 2.0 - x.0[1]];
                LastWraps::new(vector![d.norm(), d.y.atan2(d.x) - x.0[2]])
            },
            state: |x| LastWraps::new(*x),
            measurement: |z| LastWraps::new(*z),
        },
    );
}
