//! The errors of the keyframes of the window.
//!
//! When a window of the path is solved anew (page 13), the errors that its keyframes make of their own are those of the
//! window's Gaussian, with covariance P, and no longer the sum of those of single keyframes: all sightings of a landmark tell of
//! it together. With e_i what keyframe i inherits from those before the window, by the gains of [`super::Support`],
//!
//! cov(e_i, e_j) = J_i cov(e, e) J_j^T + P_ij.
//!
//! A keyframe that leaves the window stays at the mean, so P counts once, and all that follows inherits it. Where no window
//! settled, it stays where it was drawn: the draw is another error with the same covariance.

use mono_geometry::Se2;
use nalgebra::{DMatrix, Matrix3};

use super::{Drift, cover, position};

impl Drift {
    /// The window from keyframe `first` on was solved again: from `window`, the covariance of its body poses (metres, rad) given
    /// its beginning, three rows each, where it settled. Its first `gone` keyframes then leave it. `spread` is the covariance
    /// between particles of a keyframe's body, as it is now. O(keyframes kept x keyframes of the window x anchors).
    pub(crate) fn settle(
        &mut self,
        first: u32,
        window: Option<&DMatrix<f64>>,
        gone: usize,
        spread: impl Fn(u32) -> Matrix3<f64>,
    ) {
        self.leave(self.recent_before(first));
        let left = self.recent_before(first + gone as u32);
        let Some(window) = window else {
            self.leave(left);
            return self.carry_on(spread);
        };
        let start = self.recent.first;
        let row = |i: usize| {
            (start + i as u32)
                .checked_sub(first)
                .map(|k| 3 * k as usize)
        };
        for (i, step) in self.recent.steps.iter_mut().enumerate() {
            for (j, own) in step.own.iter_mut().enumerate() {
                if let (Some(i), Some(j)) = (row(i), row(j))
                    && i + 3 <= window.nrows()
                {
                    *own = window.fixed_view::<3, 3>(i, j).into_owned();
                }
            }
        }
        self.carry_on(spread);
        self.recent.forget(left);
    }

    /// How many of the recent keyframes come before `keyframe`.
    fn recent_before(&self, keyframe: u32) -> usize {
        let count = keyframe.saturating_sub(self.recent.first) as usize;
        count.min(self.recent.steps.len())
    }

    /// Derives the errors of the recent keyframes from those before them.
    fn carry_on(&mut self, spread: impl Fn(u32) -> Matrix3<f64>) {
        for i in 0..self.recent.steps.len() {
            let Some(slot) = self.place(i) else { continue };
            let row = self.inherited(slot, &self.gains_of(i, slot));
            self.rows[slot] = row;
        }
        for i in 0..self.recent.steps.len() {
            let Some(row) = self.place(i) else { continue };
            for j in 0..=i {
                if let Some(column) = self.place(j) {
                    self.rows[row][column] += self.recent.steps[i].own[j];
                }
            }
        }
        // Beyond the covariance there is what was reported beyond that of the others, and what the particles leave open still.
        for i in 0..self.recent.steps.len() {
            let Some(slot) = self.place(i) else { continue };
            let here = position(&self.bodies[slot]);
            let inherited = self.inherited_excess(&here, &self.gains_of(i, slot));
            let own = self.rows[slot][slot];
            let now = spread(self.recent.first + i as u32) + self.recent.steps[i].open;
            self.excesses[slot] = cover(&now, &(own + inherited)) - own;
        }
    }

    /// The covariance of the error of the last keyframe with what the others were reported to have beyond theirs.
    pub(crate) fn last_covariance(&self, body: &Se2) -> Matrix3<f64> {
        let (Some(slot), Some(i)) = (
            self.rows.len().checked_sub(1),
            self.recent.steps.len().checked_sub(1),
        ) else {
            return Matrix3::zeros();
        };
        self.rows[slot][slot] + self.inherited_excess(&position(body), &self.gains_of(i, slot))
    }

    /// The gains of a recent keyframe by places before its own.
    fn gains_of(&self, i: usize, slot: usize) -> Vec<(usize, Matrix3<f64>)> {
        self.recent.steps[i]
            .gains
            .iter()
            .filter(|_| slot > 0)
            .map(|(keyframe, gain)| (self.slot(*keyframe).min(slot - 1), *gain))
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Draw, Support, transport};
    use super::*;
    use nalgebra::Vector2;
    use std::collections::BTreeMap;

    const SMOOTHED: Draw = Draw::Smoothed {
        open: Matrix3::new(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    };

    fn none(_keyframe: u32) -> Matrix3<f64> {
        Matrix3::zeros()
    }

    /// A robot that leans on the keyframe before with all matches, a metre further each time.
    fn driven(count: u32) -> Drift {
        let mut drift = Drift::keeping(64);
        drift.push(&Se2::identity(), None, &Matrix3::zeros(), &SMOOTHED);
        for k in 1..count {
            step(&mut drift, k);
        }
        drift
    }

    fn step(drift: &mut Drift, k: u32) -> Matrix3<f64> {
        let support = Support {
            gains: BTreeMap::from([(k - 1, Matrix3::identity())]),
            covariance: Matrix3::identity() * 1e-4,
        };
        let body = Se2::new(f64::from(k), 0.0, 0.0);
        drift.push(&body, Some(&support), &Matrix3::zeros(), &SMOOTHED)
    }

    /// Any covariance of a window, entries of different sizes.
    fn window(keyframes: usize, seed: u32) -> DMatrix<f64> {
        let root = DMatrix::from_fn(3 * keyframes, 3 * keyframes, |i, j| {
            (f64::from(seed) + 1.7 * i as f64 + 0.6 * (j * j) as f64).sin() * 1e-2
        });
        &root * root.transpose()
    }

    fn close(found: &Matrix3<f64>, expected: &Matrix3<f64>) {
        let error = (found - expected).amax();
        assert!(
            error < 1e-12 * expected.amax().max(1.0),
            "{found} {expected}"
        );
    }

    #[test]
    fn before_a_window_settles_each_keyframe_adds_its_own_error_once() {
        let drift = driven(4);
        let expected = 3.0 * 1e-4;
        assert!((drift.block(3, 3)[(2, 2)] - expected).abs() < 1e-15);
    }

    #[test]
    fn a_settled_window_has_its_own_covariance_and_the_start_beside_it() {
        let mut drift = driven(6);
        let p = window(5, 1);
        drift.settle(1, Some(&p), 0, none);
        for i in 1..6 {
            for j in 1..=i {
                let block = p.fixed_view::<3, 3>(3 * (i - 1), 3 * (j - 1)).into_owned();
                close(&drift.block(i, j), &block);
            }
        }
        assert!(drift.is_whole());
        // What comes next leans on it until it is in a window itself.
        let next = step(&mut drift, 6);
        let swing = transport(&Vector2::new(5.0, 0.0), &Vector2::new(6.0, 0.0));
        let before = drift.block(5, 5);
        close(
            &next,
            &(swing * before * swing.transpose() + Matrix3::identity() * 1e-4),
        );
    }

    /// A keyframe that leaves has the error of the mean, once, and those that follow carry it on.
    #[test]
    fn a_keyframe_that_leaves_stays_at_the_mean() {
        let mut drift = driven(6);
        let first = window(5, 1);
        drift.settle(1, Some(&first), 2, none);
        let second = window(3, 2);
        drift.settle(3, Some(&second), 0, none);
        let of =
            |m: &DMatrix<f64>, i: usize, j: usize| m.fixed_view::<3, 3>(3 * i, 3 * j).into_owned();
        for (i, j) in [(1, 1), (2, 1), (2, 2)] {
            close(&drift.block(i, j), &of(&first, i - 1, j - 1));
        }
        let at = |k: f64| Vector2::new(k, 0.0);
        for i in 3..6 {
            let swing = transport(&at(2.0), &at(i as f64));
            let carried = swing * drift.block(2, 2) * swing.transpose();
            close(&drift.block(i, i), &(carried + of(&second, i - 3, i - 3)));
            close(&drift.block(i, 2), &(swing * drift.block(2, 2)));
        }
        assert!(drift.is_whole());
    }

    /// An unsettled window leaves the sum of the errors of single keyframes, draws included once they stay.
    #[test]
    fn an_unsettled_window_keeps_the_sum_of_single_errors() {
        let mut drift = driven(6);
        drift.settle(1, None, 3, none);
        let heading = |k: usize| drift.block(k, k)[(2, 2)];
        assert!((heading(3) - 6e-4).abs() < 1e-15);
        assert!((heading(5) - 8e-4).abs() < 1e-15);
    }

    /// The excess of a keyframe that was new, when the particles still differed, is gone once they agree on it.
    #[test]
    fn what_was_reported_of_a_new_keyframe_does_not_outlive_its_window() {
        let wide = Matrix3::identity() * 1e-2;
        let mut drift = driven(6);
        drift.note_reported(&wide);
        let at = Vector2::new(5.0, 0.0);
        close(&drift.covariance_of(5, &at), &wide);
        let p = window(5, 1);
        drift.settle(1, Some(&p), 0, none);
        close(
            &drift.covariance_of(5, &at),
            &p.fixed_view::<3, 3>(12, 12).into_owned(),
        );
        drift.settle(1, Some(&p), 0, |_| wide);
        let covered = drift.covariance_of(5, &at) - wide;
        assert!(covered.symmetric_eigenvalues().min() > -1e-12);
    }

    #[test]
    fn the_joint_covariance_stays_positive_through_windows_and_revisits() {
        let mut drift = driven(2);
        for k in 2..40 {
            step(&mut drift, k);
            if k % 3 == 0 {
                let first = k.saturating_sub(8).max(1);
                let p = window((k + 1 - first) as usize, k);
                let gone = (k + 3).saturating_sub(8).max(1) - first;
                drift.settle(first, Some(&p), gone as usize, none);
            }
            if k % 10 == 0 {
                // Everything is known to be half as far off.
                let before = drift.clone();
                drift.lower(
                    |i, j| before.block(i, j) * 0.75,
                    |_| nalgebra::Vector3::zeros(),
                );
            }
            let count = drift.kept().len();
            let joint = DMatrix::from_fn(3 * count, 3 * count, |i, j| {
                drift.block(i / 3, j / 3)[(i % 3, j % 3)]
            });
            let values = joint.symmetric_eigenvalues();
            assert!(
                values.min() > -1e-9 * values.max(),
                "keyframe {k}: {}",
                values.min()
            );
            assert!(drift.is_whole());
        }
    }
}
