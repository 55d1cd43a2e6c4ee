//! The budget of matches that weigh the particles.
//!
//! Weights of a frame with hundreds of matches are very peaked, because errors that the model leaves out are multiplied
//! by their number. At most a given number of matches scores, well spread over the image; the others update the map
//! alone.

use nalgebra::Vector2;

use crate::filter::observation::{MatchedFeature, Scoring};

/// Columns of the grid that spreads the matches.
const COLUMNS: usize = 8;
/// Rows of the grid that spreads the matches.
const ROWS: usize = 6;

/// Leaves at most `limit` matches scoring: one in turn from each cell of a grid, those of closed depth first.
pub(crate) fn spread_scoring(
    matches: &mut [MatchedFeature],
    limit: usize,
    image_size_px: &Vector2<f64>,
) {
    if matches.len() <= limit {
        return;
    }
    let mut cells: Vec<Vec<usize>> = vec![Vec::new(); COLUMNS * ROWS];
    let mut order: Vec<usize> = (0..matches.len()).collect();
    order.sort_by_key(|&i| (matches[i].scoring != Scoring::Full, i));
    for i in order {
        let p = matches[i].pixel;
        let cell =
            |v: f64, size: f64, n: usize| ((v / size * n as f64).max(0.0) as usize).min(n - 1);
        cells[cell(p.y, image_size_px.y, ROWS) * COLUMNS + cell(p.x, image_size_px.x, COLUMNS)]
            .push(i);
    }
    let mut kept = vec![false; matches.len()];
    let (mut count, mut depth) = (0, 0);
    while count < limit {
        for cell in &cells {
            if let Some(&i) = cell.get(depth)
                && count < limit
            {
                kept[i] = true;
                count += 1;
            }
        }
        depth += 1;
    }
    for (m, kept) in matches.iter_mut().zip(kept) {
        if !kept {
            m.scoring = Scoring::MapOnly;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::filter::pixel_noise::PixelNoise;

    fn at(x: f64, y: f64, scoring: Scoring) -> MatchedFeature {
        MatchedFeature {
            id: 0,
            pixel: Vector2::new(x, y),
            noise: PixelNoise::round(1.0),
            scoring,
            prototype: None,
        }
    }

    fn scoring_in_left_half(matches: &[MatchedFeature]) -> usize {
        matches
            .iter()
            .filter(|m| m.pixel.x < 160.0 && m.scoring != Scoring::MapOnly)
            .count()
    }

    #[test]
    fn a_crowded_corner_does_not_take_the_budget() {
        let size = Vector2::new(320.0, 240.0);
        // 300 matches in one cell, 10 in ten others.
        let mut matches: Vec<_> = (0..300).map(|_| at(5.0, 5.0, Scoring::Full)).collect();
        matches.extend((0..10).map(|i| at(170.0 + 15.0 * f64::from(i), 200.0, Scoring::Full)));
        spread_scoring(&mut matches, 12, &size);
        let left = scoring_in_left_half(&matches);
        let all = matches
            .iter()
            .filter(|m| m.scoring != Scoring::MapOnly)
            .count();
        assert_eq!(all, 12);
        // The right half has four columns of the grid: ten matches in four cells.
        assert!(left <= 4, "{left}");
    }

    #[test]
    fn closed_depths_score_before_open_ones() {
        let size = Vector2::new(320.0, 240.0);
        let mut matches = vec![
            at(5.0, 5.0, Scoring::AcrossEpipolar),
            at(6.0, 5.0, Scoring::Full),
        ];
        spread_scoring(&mut matches, 1, &size);
        assert_eq!(matches[0].scoring, Scoring::MapOnly);
        assert_eq!(matches[1].scoring, Scoring::Full);
        let mut few = vec![at(5.0, 5.0, Scoring::AcrossEpipolar)];
        spread_scoring(&mut few, 1, &size);
        assert_eq!(few[0].scoring, Scoring::AcrossEpipolar, "within the budget");
    }
}
