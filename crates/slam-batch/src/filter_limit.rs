//! The limit of a filter: the last pose of the batch over what was known at the time.
//!
//! A batch of the whole drive looks back, which no filter can. Solved again at every keyframe over the sightings until then, its
//! last poses make the path of a filter that forgets nothing and linearises everything anew.

use mono_geometry::Se2;
use slam_pipeline::Rig;

use crate::error::BatchError;
use crate::problem::Model;
use crate::recording::Recording;
use crate::solve::solve;

/// One body pose a frame, each from the batch over the frames until then, with the associations of the recording; `path`, one pose
/// a frame, is where the batches start. Frames before the second keyframe, and those by which no landmark has been seen twice,
/// keep the pose of `path`.
///
/// Time is that of a batch for each keyframe.
///
/// # Errors
/// As [`solve()`], other than for want of landmarks.
pub fn filter_limit(
    recording: &Recording,
    rig: Rig,
    model: &Model,
    path: &[Se2],
) -> Result<Vec<Se2>, BatchError> {
    let mut limit = path.to_vec();
    for keyframe in 1..recording.keyframes().len() {
        let known = recording.until(keyframe);
        let begin = recording.keyframes()[keyframe];
        let Some(start) = path.get(..known.frames()) else {
            break;
        };
        match solve(&known.problem(rig, model.clone(), start)) {
            Ok(solution) => {
                let poses = known.whole_path(&solution);
                for (at, estimate) in limit.iter_mut().zip(&poses).skip(begin) {
                    *at = estimate.pose;
                }
            }
            Err(BatchError::NoTracks) => {}
            Err(e) => return Err(e),
        }
    }
    Ok(limit)
}
