//! The gate: how far a measurement may lie from its prediction.

use nalgebra::{Matrix2, Vector2};

/// Bound on the squared normalised innovation d^T S^-1 d of a pixel (2 degrees of freedom).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Gate {
    /// The bound.
    pub(crate) limit: f64,
}

impl Gate {
    /// Whether `innovation` lies within the gate of covariance `s`.
    #[must_use]
    pub(crate) fn admits(&self, innovation: &Vector2<f64>, s: &Matrix2<f64>) -> bool {
        // d^T adj(S) d <= limit det(S), without a division for each candidate.
        let squared = s[(1, 1)] * innovation.x * innovation.x
            - 2.0 * s[(0, 1)] * innovation.x * innovation.y
            + s[(0, 0)] * innovation.y * innovation.y;
        squared <= self.limit * s.determinant()
    }

    /// Radius in pixels of the circle around the gate of covariance `s`.
    #[must_use]
    pub(crate) fn radius_px(&self, s: &Matrix2<f64>) -> f64 {
        (self.limit * largest_eigenvalue(s)).sqrt()
    }
}

/// Larger eigenvalue of a symmetric 2 x 2 matrix, in closed form.
fn largest_eigenvalue(m: &Matrix2<f64>) -> f64 {
    let half = 0.5 * (m[(0, 0)] + m[(1, 1)]);
    let difference = 0.5 * (m[(0, 0)] - m[(1, 1)]);
    half + difference.hypot(m[(0, 1)])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_circle_touches_the_gate_along_its_long_axis() {
        let gate = Gate { limit: 9.0 };
        // Axes (1, 1) / sqrt(2) with variance 5 and (1, -1) / sqrt(2) with variance 1.
        let s = Matrix2::new(3.0, 2.0, 2.0, 3.0);
        let radius = gate.radius_px(&s);
        assert!((radius - (9.0_f64 * 5.0).sqrt()).abs() < 1e-12);
        let long = Vector2::new(1.0, 1.0).normalize();
        assert!(gate.admits(&(long * (radius - 1e-9)), &s));
        assert!(!gate.admits(&(long * (radius + 1e-9)), &s));
        let short = Vector2::new(1.0, -1.0).normalize();
        assert!(!gate.admits(&(short * (radius - 1e-9)), &s));
        assert!(gate.admits(&(short * (3.0 - 1e-9)), &s));
    }
}
