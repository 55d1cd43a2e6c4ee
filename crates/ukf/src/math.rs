//! Elementary functions that `core` lacks, from whichever library nalgebra is built with.

use nalgebra::{ComplexField, RealField};

pub(crate) fn sqrt(x: f64) -> f64 {
    ComplexField::sqrt(x)
}

pub(crate) fn ln(x: f64) -> f64 {
    ComplexField::ln(x)
}

pub(crate) fn exp(x: f64) -> f64 {
    ComplexField::exp(x)
}

pub(crate) fn sin_cos(x: f64) -> (f64, f64) {
    ComplexField::sin_cos(x)
}

pub(crate) fn atan2(y: f64, x: f64) -> f64 {
    RealField::atan2(y, x)
}

pub(crate) fn floor(x: f64) -> f64 {
    ComplexField::floor(x)
}
