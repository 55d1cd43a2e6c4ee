//! Trigonometric quotients that are smooth at zero and 0/0 in their naive form.
//!
//! The exponential maps of SE(2), SO(3) and SE(3) and their Jacobians are built from them. Each is accurate to a few
//! units in the last place over the whole range: half-angle identities where they remove the cancellation, power series
//! where they do not.

use nalgebra::ComplexField;

use crate::real::Real;

/// sin(x) / x.
#[must_use]
pub fn sinc<T: Real>(x: T) -> T {
    // Below 1e-4 the next term, x^4 / 120, is under one unit in the last place.
    if ComplexField::abs(x) < T::of(1e-4) {
        T::one() - x * x / T::of(6.0)
    } else {
        ComplexField::sin(x) / x
    }
}

/// (1 - cos x) / x = (x / 2) sinc(x / 2)^2.
#[must_use]
pub fn versine_over_x<T: Real>(x: T) -> T {
    let half = sinc(T::of(0.5) * x);
    T::of(0.5) * x * half * half
}

/// (1 - cos x) / x^2 = sinc(x / 2)^2 / 2.
#[must_use]
pub fn versine_over_x2<T: Real>(x: T) -> T {
    let half = sinc(T::of(0.5) * x);
    T::of(0.5) * half * half
}

/// (x - sin x) / x^3.
#[must_use]
pub fn x_minus_sin_over_x3<T: Real>(x: T) -> T {
    let x2 = x * x;
    if x2 > T::one() {
        return (x - ComplexField::sin(x)) / (x2 * x);
    }
    // 1/3! - x^2/5! + x^4/7! - ...; the first term left out is x^16 / 19! < 1e-17.
    let mut term = T::of(1.0 / 6.0);
    let mut sum = term;
    for k in 2..9_u32 {
        let n = T::of(f64::from(2 * k));
        term *= -x2 / (n * (n + T::one()));
        sum += term;
    }
    sum
}
