//! Figures of a list of errors.

use serde::Serialize;

/// Root mean square, mean, median, standard deviation, minimum, maximum; all in the errors' unit.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Statistics {
    /// Root of the mean square.
    pub rmse: f64,
    /// Mean.
    pub mean: f64,
    /// Median; of an even number of errors the mean of the middle two.
    pub median: f64,
    /// Standard deviation about the mean (divided by the number of errors, as `evo` does).
    pub std: f64,
    /// Smallest.
    pub min: f64,
    /// Largest.
    pub max: f64,
}

impl Statistics {
    /// Figures of `errors`; `None` when there are none. Sums run in the order given.
    pub fn of(errors: &[f64]) -> Option<Statistics> {
        if errors.is_empty() {
            return None;
        }
        let count = errors.len() as f64;
        let mean = errors.iter().sum::<f64>() / count;
        let mean_square = errors.iter().map(|error| error * error).sum::<f64>() / count;
        let variance = errors
            .iter()
            .map(|error| (error - mean).powi(2))
            .sum::<f64>()
            / count;
        let mut sorted = errors.to_vec();
        sorted.sort_by(f64::total_cmp);
        let middle = sorted.len() / 2;
        let median = if sorted.len() % 2 == 1 {
            sorted[middle]
        } else {
            0.5 * (sorted[middle - 1] + sorted[middle])
        };
        Some(Statistics {
            rmse: mean_square.sqrt(),
            mean,
            median,
            std: variance.sqrt(),
            min: sorted[0],
            max: sorted[sorted.len() - 1],
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_of_a_short_list() {
        let figures = Statistics::of(&[4.0, 1.0, 3.0, 2.0]).unwrap();
        assert_eq!(
            (figures.mean, figures.median, figures.min, figures.max),
            (2.5, 2.5, 1.0, 4.0)
        );
        assert_eq!(figures.rmse, 7.5_f64.sqrt());
        assert_eq!(figures.std, 1.25_f64.sqrt());
        assert_eq!(Statistics::of(&[3.0, 1.0, 9.0]).unwrap().median, 3.0);
        assert_eq!(Statistics::of(&[]), None);
    }
}
