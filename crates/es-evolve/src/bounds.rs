//! Bounds of coordinates, for a search that knows none.
//!
//! A search that samples around a centre does badly at a bound: half of its offspring are beyond it, and the steps shrink before the
//! optimum is reached along the others. So the search moves in a space without bounds, whose points are folded into the box
//! before the fitness sees them (as in Hansen's pycma):
//!
//! ```text
//! x(u) = u                               inside, a margin a away from the bounds
//! x(u) = low + (u - (low - a))^2 / 4 a   for low - a <= u <= low + a, and likewise at the high bound
//! ```
//!
//! mirrored beyond low - a and high + a. x(u) is smooth and reaches the bound with slope zero, so an optimum at a bound, or in
//! a corner, is a smooth optimum in u like any other. Every point that is evaluated lies in the box, the bounds included.

use crate::error::EvolveError;

/// The least and greatest value of each coordinate; minus and plus infinity for none.
#[derive(Debug, Clone, PartialEq)]
pub struct Bounds {
    low: Vec<f64>,
    high: Vec<f64>,
}

/// Margin in initial step sizes.
const MARGIN_STEPS: f64 = 0.1;

impl Bounds {
    /// No bounds in `dimension` coordinates.
    #[must_use]
    pub fn none(dimension: usize) -> Self {
        Self {
            low: vec![f64::NEG_INFINITY; dimension],
            high: vec![f64::INFINITY; dimension],
        }
    }

    /// The box between `low` and `high`, as many of each as coordinates.
    ///
    /// # Errors
    /// [`EvolveError::Dimension`] for lists of different lengths, [`EvolveError::Bounds`] where low is not below high or one is
    /// not a number.
    pub fn new(low: &[f64], high: &[f64]) -> Result<Self, EvolveError> {
        check_dimension("upper bounds", high.len(), low.len())?;
        for (coordinate, (low, high)) in low.iter().zip(high).enumerate() {
            let apart = low < high;
            if !apart {
                return Err(EvolveError::Bounds {
                    coordinate,
                    low: *low,
                    high: *high,
                });
            }
        }
        Ok(Self {
            low: low.to_vec(),
            high: high.to_vec(),
        })
    }

    /// Number of coordinates.
    #[must_use]
    pub fn dimension(&self) -> usize {
        self.low.len()
    }

    /// Least value of each coordinate.
    #[must_use]
    pub fn low(&self) -> &[f64] {
        &self.low
    }

    /// Greatest value of each coordinate.
    #[must_use]
    pub fn high(&self) -> &[f64] {
        &self.high
    }

    /// x(u) of one coordinate, for an initial step size.
    pub(crate) fn folded(&self, coordinate: usize, u: f64, step: f64) -> f64 {
        let (low, high) = (self.low[coordinate], self.high[coordinate]);
        let margin = margin(low, high, step);
        let (first, last) = (low - margin, high + margin);
        let mut u = u;
        if u < first || u > last {
            u = mirrored(u, first, last);
        }
        let x = if u < low + margin {
            low + (u - first).powi(2) / (4.0 * margin)
        } else if u > high - margin {
            high - (last - u).powi(2) / (4.0 * margin)
        } else {
            u
        };
        x.clamp(low, high)
    }

    /// The u nearest to the middle of which x is the image; x is brought into the box first.
    pub(crate) fn unfolded(&self, coordinate: usize, x: f64, step: f64) -> f64 {
        let (low, high) = (self.low[coordinate], self.high[coordinate]);
        let margin = margin(low, high, step);
        let x = x.clamp(low, high);
        if x < low + margin {
            low - margin + 2.0 * (margin * (x - low)).sqrt()
        } else if x > high - margin {
            high + margin - 2.0 * (margin * (high - x)).sqrt()
        } else {
            x
        }
    }
}

fn margin(low: f64, high: f64, step: f64) -> f64 {
    (MARGIN_STEPS * step).min(0.5 * (high - low))
}

/// u between `first` and `last`, one of which is finite, by mirrors at both.
fn mirrored(u: f64, first: f64, last: f64) -> f64 {
    if last == f64::INFINITY {
        return 2.0 * first - u;
    }
    if first == f64::NEG_INFINITY {
        return 2.0 * last - u;
    }
    let width = last - first;
    let along = (u - first).rem_euclid(2.0 * width);
    first + along.min(2.0 * width - along)
}

pub(crate) fn check_dimension(
    what: &'static str,
    given: usize,
    required: usize,
) -> Result<(), EvolveError> {
    if given == required {
        Ok(())
    } else {
        Err(EvolveError::Dimension {
            what,
            given,
            required,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_u_lands_in_the_box_and_every_x_comes_back() {
        let inf = f64::INFINITY;
        for (low, high) in [
            (-1.0, 2.0),
            (0.0, inf),
            (-inf, 3.0),
            (1.0, 1.0 + 1e-9),
            (-inf, inf),
        ] {
            let bounds = Bounds::new(&[low], &[high]).unwrap();
            for step in [0.01, 1.0, 50.0] {
                for k in -3000..3000 {
                    let u = f64::from(k) * 0.0173;
                    let x = bounds.folded(0, u, step);
                    assert!(x >= low && x <= high, "{u} {x}");
                    let again = bounds.folded(0, bounds.unfolded(0, x, step), step);
                    assert!(
                        (again - x).abs() < 1e-12 * (1.0 + x.abs()),
                        "{u} {x} {again}"
                    );
                    // continuous
                    let near = bounds.folded(0, u + 1e-9, step);
                    assert!((near - x).abs() < 2e-9, "{u}");
                }
                for x in [low, high] {
                    if x.is_finite() {
                        assert_eq!(bounds.folded(0, bounds.unfolded(0, x, step), step), x);
                    }
                }
            }
        }
        assert!(Bounds::new(&[1.0], &[1.0]).is_err());
        assert!(Bounds::new(&[f64::NAN], &[1.0]).is_err());
        assert!(Bounds::new(&[0.0, 0.0], &[1.0]).is_err());
    }
}
