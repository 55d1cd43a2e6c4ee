//! Rational radial-tangential lens: the eight-coefficient form for wide lenses.
//!
//! As the radial-tangential lens with the gain g(s) = N / D, N = 1 + k1 s + k2 s^2 + k3 s^3,
//! D = 1 + k4 s + k5 s^2 + k6 s^3, s = r^2. The radial part r g has the derivative
//! (N D + 2 s (N' D - N D')) / D^2, so its folds are the zeros of a polynomial of degree six in s.
//!
//! Degenerate: at a zero of D the image runs to infinity and comes back from the other side. The field ends at the
//! first fold or the first pole, whichever is nearer. With k4 = k5 = k6 = 0 it is the radial-tangential lens, to the
//! bit. Numerator and denominator that share a factor (k1 = k4, k2 = k5, k3 = k6) cancel in the image but not in the
//! calibration: those parameters are then not observable one by one.
//!
//! Source: OpenCV's `CALIB_RATIONAL_MODEL`; D. Claus and A. Fitzgibbon, A rational function lens distortion model for
//! general cameras, 2005, is the general form.

use nalgebra::Vector2;

use super::jacobian::LensJacobian;
use super::radtan::set_tangential;
use super::roots::first_root;

/// Numerator and denominator coefficients k1 k2 k3, k4 k5 k6.
#[derive(Clone, Copy)]
pub(super) struct Ratio {
    pub(super) numerator: [f64; 3],
    pub(super) denominator: [f64; 3],
}

impl Ratio {
    /// g and dg/ds.
    pub(super) fn gain(&self, s: f64) -> (f64, f64) {
        let (n, n_slope) = super::radtan::gain(self.numerator, s);
        let (d, d_slope) = super::radtan::gain(self.denominator, s);
        let gain = n / d;
        (gain, (n_slope - gain * d_slope) / d)
    }

    /// Radius of the first fold or pole; infinite if there is neither. O(1).
    pub(super) fn field_radius(&self) -> f64 {
        let n = monic(self.numerator);
        let d = monic(self.denominator);
        // N D + 2 s (N' D - N D'), coefficient of s^(i + j): n_i d_j (1 + 2 (i - j)).
        let mut fold = [0.0; 7];
        for (i, a) in n.iter().enumerate() {
            for (j, b) in d.iter().enumerate() {
                fold[i + j] += a * b * (1.0 + 2.0 * (i as f64 - j as f64));
            }
        }
        [
            first_root(&fold, f64::INFINITY),
            first_root(&d, f64::INFINITY),
        ]
        .into_iter()
        .flatten()
        .fold(f64::INFINITY, f64::min)
        .sqrt()
    }

    /// Derivative of the distorted point by k1 k2 p1 p2 k3 k4 k5 k6.
    pub(super) fn parameter_jacobian(&self, point: &Vector2<f64>) -> LensJacobian {
        let s = point.norm_squared();
        let (d, _) = super::radtan::gain(self.denominator, s);
        let (gain, _) = self.gain(s);
        let mut jacobian = LensJacobian::zeros();
        let mut power = 1.0 / d;
        for (above, below) in [(0, 5), (1, 6), (4, 7)] {
            power *= s;
            jacobian.set_column(above, &(point * power));
            jacobian.set_column(below, &(point * (-gain * power)));
        }
        set_tangential(&mut jacobian, point);
        jacobian
    }
}

fn monic(k: [f64; 3]) -> [f64; 4] {
    [1.0, k[0], k[1], k[2]]
}
