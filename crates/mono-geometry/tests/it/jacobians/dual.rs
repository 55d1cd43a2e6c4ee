//! Dual numbers a + b e, e^2 = 0: the derivative of a formula along one direction, exact to rounding.

use std::ops::{Add, Div, Mul, Neg, Sub};

/// A value and its derivative along the direction in question.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Dual {
    pub(crate) value: f64,
    pub(crate) slope: f64,
}

impl Dual {
    pub(crate) fn constant(value: f64) -> Self {
        Self { value, slope: 0.0 }
    }

    /// `values` with the direction along entry `active`; none if it is out of range.
    pub(crate) fn seeded(values: &[f64], active: usize) -> Vec<Self> {
        values
            .iter()
            .enumerate()
            .map(|(index, &value)| Self {
                value,
                slope: f64::from(u8::from(index == active)),
            })
            .collect()
    }

    pub(crate) fn sqrt(self) -> Self {
        let root = self.value.sqrt();
        Self {
            value: root,
            slope: self.slope / (2.0 * root),
        }
    }

    pub(crate) fn atan(self) -> Self {
        Self {
            value: self.value.atan(),
            slope: self.slope / (1.0 + self.value * self.value),
        }
    }
}

impl Add for Dual {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self {
            value: self.value + other.value,
            slope: self.slope + other.slope,
        }
    }
}

impl Sub for Dual {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

impl Neg for Dual {
    type Output = Self;
    fn neg(self) -> Self {
        Self {
            value: -self.value,
            slope: -self.slope,
        }
    }
}

impl Mul for Dual {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        Self {
            value: self.value * other.value,
            slope: self.slope * other.value + self.value * other.slope,
        }
    }
}

impl Mul<f64> for Dual {
    type Output = Self;
    fn mul(self, other: f64) -> Self {
        self * Self::constant(other)
    }
}

impl Div for Dual {
    type Output = Self;
    fn div(self, other: Self) -> Self {
        Self {
            value: self.value / other.value,
            slope: (self.slope * other.value - self.value * other.slope)
                / (other.value * other.value),
        }
    }
}

/// A square matrix of dual numbers, row by row.
pub(crate) type DualMatrix<const N: usize> = [[Dual; N]; N];

pub(crate) fn product<const N: usize>(a: &DualMatrix<N>, b: &DualMatrix<N>) -> DualMatrix<N> {
    std::array::from_fn(|i| {
        std::array::from_fn(|j| (0..N).fold(Dual::constant(0.0), |sum, k| sum + a[i][k] * b[k][j]))
    })
}

/// The exponential of a matrix from its definition, the power series, halved six times and squared back.
///
/// Knows nothing of rotations, so it has no special cases at zero or at half a turn.
pub(crate) fn exponential<const N: usize>(matrix: &DualMatrix<N>) -> DualMatrix<N> {
    let scaled = matrix.map(|row| row.map(|entry| entry * (1.0 / 64.0)));
    let identity: DualMatrix<N> = std::array::from_fn(|i| {
        std::array::from_fn(|j| Dual::constant(f64::from(u8::from(i == j))))
    });
    let mut sum = identity;
    let mut term = identity;
    for k in 1..20_u32 {
        term = product(&term, &scaled).map(|row| row.map(|entry| entry * (1.0 / f64::from(k))));
        for (to, from) in sum.iter_mut().flatten().zip(term.iter().flatten()) {
            *to = *to + *from;
        }
    }
    for _ in 0..6 {
        sum = product(&sum, &sum);
    }
    sum
}

#[test]
fn dual_numbers_know_the_product_and_the_quotient_rule() {
    let x = Dual {
        value: 2.0,
        slope: 1.0,
    };
    // x^3 / (1 + x) at 2: slope (3 x^2 (1 + x) - x^3) / (1 + x)^2 = 28 / 9.
    let quotient = x * x * x / (Dual::constant(1.0) + x);
    assert!((quotient.slope - 28.0 / 9.0).abs() < 1e-15);
    assert!(((x * x).sqrt().slope - 1.0).abs() < 1e-15);
    assert!((x.atan().slope - 0.2).abs() < 1e-15);
    let grown = exponential(&[[x]]);
    assert!((grown[0][0].slope - 2.0_f64.exp()).abs() < 1e-13);
}
