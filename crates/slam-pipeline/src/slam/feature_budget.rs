//! The budget of new features: the strongest keypoints that no landmark explains.

use std::collections::BTreeSet;

use crate::frontend::association::Association;
use crate::frontend::frame::FrameFeatures;

/// Indices of at most `limit` keypoints that the association, if there is one, did not use, the strongest first.
pub(crate) fn strongest_unused(
    frame: &FrameFeatures<'_>,
    association: Option<&Association<'_>>,
    limit: usize,
) -> Vec<usize> {
    let taken: BTreeSet<usize> = association
        .into_iter()
        .flat_map(|a| a.inliers.iter().chain(&a.outliers))
        .map(|p| p.keypoint)
        .collect();
    let responses: Vec<f32> = frame
        .features
        .keypoints
        .iter()
        .map(|k| k.response.abs())
        .collect();
    let candidates = (0..responses.len())
        .filter(|k| !taken.contains(k) && frame.ideal[*k].is_some())
        .collect();
    strongest(candidates, &responses, limit)
}

/// The `limit` candidates of largest response; ties go to the lower index.
fn strongest(mut candidates: Vec<usize>, responses: &[f32], limit: usize) -> Vec<usize> {
    candidates.sort_by(|&a, &b| responses[b].total_cmp(&responses[a]).then(a.cmp(&b)));
    candidates.truncate(limit);
    candidates
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_strongest_come_first_and_ties_go_to_the_lower_index() {
        let responses = [0.1, 0.4, 0.2, 0.4, 0.3];
        assert_eq!(strongest(vec![0, 1, 2, 3, 4], &responses, 3), [1, 3, 4]);
        assert_eq!(strongest(vec![0, 2], &responses, 3), [2, 0]);
    }
}
