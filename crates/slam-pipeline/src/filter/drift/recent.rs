//! The keyframes of the window: their gains, and the errors that they make of their own.

use nalgebra::Matrix3;
use serde::{Deserialize, Serialize};

/// The last keyframes, as long as they are smoothed.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Recent {
    /// Index of the first.
    pub(super) first: u32,
    pub(super) steps: Vec<Step>,
}

/// One of them.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Step {
    /// The matrices by which its error takes over those of others, by their index.
    pub(super) gains: Vec<(u32, Matrix3<f64>)>,
    /// Covariance that was open in each particle when the keyframe was new.
    pub(super) open: Matrix3<f64>,
    /// Covariance of the errors made in the window, of this keyframe with each up to itself.
    pub(super) own: Vec<Matrix3<f64>>,
}

impl Recent {
    /// None yet, before keyframe `next`.
    pub(super) const fn after(next: u32) -> Self {
        Self {
            first: next,
            steps: Vec::new(),
        }
    }

    /// One more keyframe. `fresh` is the covariance of the error it makes of its own.
    pub(super) fn push(
        &mut self,
        gains: Vec<(u32, Matrix3<f64>)>,
        open: Matrix3<f64>,
        fresh: &Matrix3<f64>,
    ) {
        let count = self.steps.len();
        let inside: Vec<(usize, Matrix3<f64>)> = gains
            .iter()
            .filter_map(|(k, g)| Some((k.checked_sub(self.first)? as usize, *g)))
            .filter(|(i, _)| *i < count)
            .collect();
        let mut own: Vec<Matrix3<f64>> = (0..count)
            .map(|j| inside.iter().map(|(i, g)| g * self.own(*i, j)).sum())
            .collect();
        let last = inside
            .iter()
            .map(|(i, g)| own[*i] * g.transpose())
            .sum::<Matrix3<f64>>()
            + fresh;
        own.push((last + last.transpose()) * 0.5);
        self.steps.push(Step { gains, open, own });
    }

    fn own(&self, i: usize, j: usize) -> Matrix3<f64> {
        if i >= j {
            self.steps[i].own[j]
        } else {
            self.steps[j].own[i].transpose()
        }
    }

    /// Forgets the first `count` keyframes; the errors of the others are from now on those given where the last of them
    /// stays.
    pub(super) fn forget(&mut self, count: usize) {
        let known = count.checked_sub(1).and_then(|k| {
            let inverse = self.own(k, k).cholesky()?;
            let by: Vec<_> = (count..self.steps.len()).map(|i| self.own(i, k)).collect();
            Some((inverse, by))
        });
        self.steps.drain(..count);
        self.first += count as u32;
        for (i, step) in self.steps.iter_mut().enumerate() {
            step.own.drain(..count);
            if let Some((inverse, by)) = &known {
                for (j, own) in step.own.iter_mut().enumerate() {
                    *own -= by[i] * inverse.solve(&by[j].transpose());
                }
            }
        }
    }

    /// Whether the steps end at keyframe `next` and lean on keyframes before them alone.
    pub(super) fn is_whole(&self, next: u32) -> bool {
        self.first.checked_add(self.steps.len() as u32) == Some(next)
            && self.steps.iter().enumerate().all(|(i, step)| {
                step.own.len() == i + 1
                    && step.gains.iter().all(|(k, _)| *k < self.first + i as u32)
            })
    }

    /// Bytes on the heap.
    pub(super) fn memory_usage(&self) -> usize {
        let blocks: usize = self.steps.iter().map(|s| s.own.len() + s.gains.len()).sum();
        blocks * size_of::<Matrix3<f64>>() + size_of_val(&*self.steps)
    }
}
