//! The path of a particle in metres, smoothed.
//!
//! The unit of a particle drifts: where landmarks leave the view for good, the map that follows has a scale of its own. One
//! scale for the whole path then stretches the beginning by as much as the unit has drifted since, on a street by a tenth.
//! Every keyframe therefore notes what was known of the scale s, and of its drift since the keyframe before. Given all
//! keyframes the scale is that of the smoother of Rauch, Tung and Striebel (1965) for a random walk,
//!
//! > s_k <- s_k + P_k / (P_k + q_{k+1}) (s_{k+1} - s_k),
//!
//! and the path is its sum, p_{k+1} = p_k + s_{k+1} (c_{k+1} - c_k).
//!
//! Where landmarks of one keyframe are still seen long after, the keyframes between are *tied*: their unit is one (q = 0), as it
//! must be for path and map to agree in every pixel where a loop closes.

use mono_geometry::Se2;
use nalgebra::{Vector2, Vector3};

use super::landmark::{Landmark, PointEstimate};
use super::metric::ScaleNote;
use super::particle::Particle;
use super::pose::CameraPose;

/// A path in metres, and the world about it.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct MetricPath {
    lever_m: Vector2<f64>,
    keyframes: Vec<Placed>,
}

/// A keyframe in both worlds.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Placed {
    /// Camera, in the unit.
    centre: Vector3<f64>,
    /// Camera, metres.
    position: Vector3<f64>,
    /// Metres per unit.
    scale: f64,
}

impl MetricPath {
    /// The path of `particle`, whose camera stands at `lever_m` in the body; `tied[k]` says whether keyframes k and k + 1 have
    /// one unit. O(keyframes).
    #[must_use]
    pub(crate) fn new(particle: &Particle, lever_m: Vector2<f64>, tied: &[bool]) -> Self {
        let notes: Vec<(Vector3<f64>, ScaleNote)> = particle
            .path
            .iter()
            .map(|k| (k.camera.centre, k.scale))
            .collect();
        let scales = smoothed(notes.iter().map(|(_, note)| *note), tied);
        let mut keyframes: Vec<Placed> = Vec::with_capacity(notes.len());
        for ((centre, _), scale) in notes.into_iter().zip(scales) {
            let position = keyframes.last().map_or(centre, |before| {
                before.position + (centre - before.centre) * scale
            });
            keyframes.push(Placed {
                centre,
                position,
                scale,
            });
        }
        Self { lever_m, keyframes }
    }

    /// Metres per unit at a keyframe; 1 without it.
    #[must_use]
    pub(crate) fn scale(&self, keyframe: u32) -> f64 {
        self.keyframes
            .get(keyframe as usize)
            .map_or(1.0, |k| k.scale)
    }

    /// A position of the unit world as keyframe `keyframe` measures it, metres.
    #[must_use]
    pub(crate) fn position(&self, keyframe: u32, in_unit: &Vector3<f64>) -> Vector3<f64> {
        self.keyframes
            .get(keyframe as usize)
            .map_or(*in_unit, |k| k.position + (in_unit - k.centre) * k.scale)
    }

    /// World position of a landmark of `particle`, whose path this is, as keyframe `keyframe` measures it, metres, with its
    /// covariance; `None` while its depth is not positive.
    #[must_use]
    pub(crate) fn point(
        &self,
        particle: &Particle,
        landmark: &Landmark,
        keyframe: u32,
    ) -> Option<PointEstimate> {
        let point = landmark.point(&particle.geometry(landmark)?)?;
        let scale = self.scale(keyframe);
        Some(PointEstimate {
            position: self.position(keyframe, &point.position),
            covariance: point.covariance * (scale * scale),
        })
    }

    /// The body under a camera pose of the unit world as keyframe `keyframe` measures it, metres.
    #[must_use]
    pub(crate) fn body(&self, keyframe: u32, pose: &CameraPose) -> Se2 {
        let centre = self.position(keyframe, &pose.centre);
        let (sin, cos) = pose.phi.sin_cos();
        Se2 {
            x: centre.x - (cos * self.lever_m.x - sin * self.lever_m.y),
            y: centre.y - (sin * self.lever_m.x + cos * self.lever_m.y),
            phi: pose.phi,
        }
    }

    /// [`Self::body`] as the nearest keyframe measures it. O(keyframes).
    #[must_use]
    pub(crate) fn body_anywhere(&self, pose: &CameraPose) -> Se2 {
        let away = |k: &Placed| (k.centre - pose.centre).norm_squared();
        let nearest = (0..self.keyframes.len())
            .min_by(|a, b| away(&self.keyframes[*a]).total_cmp(&away(&self.keyframes[*b])));
        self.body(nearest.unwrap_or(0) as u32, pose)
    }
}

/// The scale of every keyframe given all.
fn smoothed(notes: impl DoubleEndedIterator<Item = ScaleNote>, tied: &[bool]) -> Vec<f64> {
    let notes: Vec<ScaleNote> = notes.collect();
    let mut scales: Vec<f64> = notes.iter().map(|note| note.mean).collect();
    for k in (0..notes.len().saturating_sub(1)).rev() {
        let drift = notes[k + 1].drift;
        let one_unit = tied.get(k).copied().unwrap_or(false) || drift <= 0.0;
        scales[k] = if one_unit {
            scales[k + 1]
        } else {
            let gain = notes[k].variance / (notes[k].variance + drift);
            scales[k] + gain * (scales[k + 1] - scales[k])
        };
    }
    scales
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::filter::metric::MetricState;
    use crate::filter::particle::Keyframe;
    use crate::filter::tests::common::{normal, planar_carrier, pose, rig, rng};

    /// A scale that walks, noted as a filter of one noisy reading a keyframe knows it: (truth, notes).
    fn walk(seed: u64, steps: usize) -> (Vec<f64>, Vec<ScaleNote>) {
        const DRIFT: f64 = 4e-4;
        const READING: f64 = 2.5e-3;
        let mut rng = rng(seed);
        let (mut truth, mut notes) = (vec![1.0], vec![ScaleNote::METRE]);
        for _ in 0..steps {
            let s: f64 = truth[truth.len() - 1] + normal(&mut rng) * DRIFT.sqrt();
            let before = notes[notes.len() - 1];
            let predicted = before.variance + DRIFT;
            let gain = predicted / (predicted + READING);
            let reading = s + normal(&mut rng) * READING.sqrt();
            truth.push(s);
            notes.push(ScaleNote {
                mean: before.mean + gain * (reading - before.mean),
                variance: (1.0 - gain) * predicted,
                drift: DRIFT,
            });
        }
        (truth, notes)
    }

    /// The batch over the same readings is the oracle: the scale that minimises all squares at once.
    #[test]
    fn the_scale_given_all_keyframes_is_that_of_the_batch() {
        let (_, notes) = walk(3, 12);
        let n = notes.len();
        // Information of the readings is the news of each note; the walk ties neighbours.
        let mut information = nalgebra::DMatrix::<f64>::zeros(n, n);
        let mut vector = nalgebra::DVector::<f64>::zeros(n);
        information[(0, 0)] = 1e12;
        vector[0] = 1e12;
        for k in 1..n {
            let predicted = notes[k - 1].variance + notes[k].drift;
            let news = 1.0 / notes[k].variance - 1.0 / predicted;
            let reading =
                (notes[k].mean / notes[k].variance - notes[k - 1].mean / predicted) / news;
            information[(k, k)] += news;
            vector[k] += news * reading;
            let walk = 1.0 / notes[k].drift;
            for (i, j, sign) in [
                (k, k, 1.0),
                (k - 1, k - 1, 1.0),
                (k, k - 1, -1.0),
                (k - 1, k, -1.0),
            ] {
                information[(i, j)] += sign * walk;
            }
        }
        let batch = information.cholesky().unwrap().solve(&vector);
        for (k, scale) in smoothed(notes.into_iter(), &[]).into_iter().enumerate() {
            assert!((scale - batch[k]).abs() < 1e-9, "{k}: {scale} {}", batch[k]);
        }
    }

    #[test]
    fn all_keyframes_know_more_of_a_scale_than_those_before_it_and_than_the_last() {
        let mut sums = [0.0; 3];
        for seed in 0..20 {
            let (truth, notes) = walk(seed, 100);
            let last = notes[notes.len() - 1].mean;
            let given_all = smoothed(notes.iter().copied(), &[]);
            for ((s, note), smooth) in truth.iter().zip(&notes).zip(given_all) {
                sums[0] += (smooth - s).powi(2);
                sums[1] += (note.mean - s).powi(2);
                sums[2] += (last - s).powi(2);
            }
        }
        // With these noises the steady variance is 8.2e-4 for the filter and 4.9e-4 for the smoother.
        assert!(sums[0] < 0.75 * sums[1], "{sums:?}");
        assert!(sums[1] < 0.2 * sums[2], "{sums:?}");
    }

    #[test]
    fn tied_keyframes_have_one_scale() {
        let (_, notes) = walk(7, 10);
        let mut tied = vec![false; 10];
        tied[3..7].fill(true);
        let scales = smoothed(notes.iter().copied(), &tied);
        assert!(scales[3..8].iter().all(|s| *s == scales[7]), "{scales:?}");
        assert!(scales[2] != scales[3] && scales[8] != scales[7]);
    }

    /// A camera drives 20 steps of one metre while its unit grows from 1 to 0.8 metres.
    fn stretched() -> Particle {
        let mut particle = Particle::new(pose(0.0, 0.0, 0.0), MetricState::new(&planar_carrier()));
        let (mut x, mut before) = (0.0, 1.0);
        for k in 0..=20 {
            let scale = 1.0 - 0.01 * f64::from(k);
            if k > 0 {
                x += 1.0 / scale;
            }
            let at = pose(x, 0.0, 0.0);
            particle.path.push(Keyframe {
                pose: at,
                camera: at.place(&rig()),
                scale: ScaleNote {
                    mean: scale,
                    variance: 1e-12,
                    drift: f64::powi(scale - before, 2),
                },
            });
            before = scale;
        }
        particle
    }

    /// A map of a street had one scale for all of it, and its beginning was a tenth too short.
    #[test]
    fn regress_a_path_whose_unit_drifts_is_as_long_as_it_was_driven() {
        let particle = stretched();
        let path = MetricPath::new(&particle, Vector2::zeros(), &[]);
        for (k, keyframe) in particle.path.iter().enumerate() {
            let body = path.body(k as u32, &keyframe.pose);
            assert!((body.x - k as f64).abs() < 1e-6, "{k}: {}", body.x);
        }
        // The world about a keyframe has its scale.
        let ahead = particle.path.get(10).unwrap().camera.centre + Vector3::new(2.0, 1.0, 0.5);
        let expected = Vector3::new(10.0 + 1.8, 0.9, 0.45);
        assert!((path.position(10, &ahead) - expected).norm() < 1e-6);
        // Tied throughout, it is the world of the last scale.
        let one = MetricPath::new(&particle, Vector2::zeros(), &[true; 20]);
        let last = particle.path.last().unwrap().camera.centre.x;
        assert!((one.position(20, &Vector3::zeros()).x).abs() < 1e-12);
        assert!((one.body(20, &particle.path.last().unwrap().pose).x - 0.8 * last).abs() < 1e-9);
    }
}
