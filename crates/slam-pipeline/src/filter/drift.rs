//! The drift of the whole estimate, which the spread of the particles does not show.
//!
//! After some resamplings all particles share one ancestor, and their spread
//! says nothing about the error of the common path. That error is propagated
//! here in closed form, beside the filter. Let e_t = (dx, dy, dphi) be the error of
//! keyframe t. Landmarks anchored at keyframe a carry e_a with them, so with
//! Lambda_a the information that group gives about pose t, and Lambda the total,
//!
//! e_t = sum_a Lambda^-1 Lambda_a T_ta e_a + (rest) T_{t,t-1} e_{t-1} + w_t,
//!
//! T_ta moves a rigid error from a to t, the rest is odometry. The surviving
//! path is a draw from the posterior around a mean that is itself in error by as
//! much: w_t ~ N(0, 2 Lambda^-1). Keyframes that are smoothed with their window have the errors of its Gaussian instead
//! ([`Drift::settle`]). The joint covariance of all e is kept, so a
//! closed loop ties the present to its old anchors. Calibration errors and
//! landmarks that share later keyframes are not in it.

mod recent;
mod settled;
mod support;

use mono_geometry::Se2;
use nalgebra::{Matrix3, Vector2, Vector3};
use serde::{Deserialize, Serialize};

use super::focal::rate_between;
use crate::known_map::{KnownErrors, KnownKeyframe};
use recent::Recent;
pub(crate) use support::Support;

/// Number of keyframes whose joint covariance a map keeps.
const SAVED: usize = 128;

fn position(body: &Se2) -> Vector2<f64> {
    Vector2::new(body.x, body.y)
}

/// The map from a rigid error at `from` to the error that it causes at `to`.
pub(crate) fn transport(from: &Vector2<f64>, to: &Vector2<f64>) -> Matrix3<f64> {
    let d = to - from;
    Matrix3::new(1.0, 0.0, -d.y, 0.0, 1.0, d.x, 0.0, 0.0, 1.0)
}

/// The smallest covariance that is at least `spread` and at least `drift` in every direction.
///
/// While the particles still differ, their spread and the drift describe the same
/// error; adding them would count it twice. In coordinates in which `spread` is
/// the identity, the directions where `drift` is larger are taken from it.
#[must_use]
pub(crate) fn cover(spread: &Matrix3<f64>, drift: &Matrix3<f64>) -> Matrix3<f64> {
    // A spread that has collapsed is regularised far below any real error.
    let floor = Matrix3::identity() * (1e-9 * (spread.trace() + drift.trace()) + 1e-18);
    let Some(factor) = (spread + floor).cholesky().map(|c| c.l()) else {
        return spread + drift;
    };
    let Some(inverse) = factor.solve_lower_triangular(&Matrix3::identity()) else {
        return spread + drift;
    };
    let lacking = (inverse * (drift - spread) * inverse.transpose()).symmetric_eigen();
    let kept = Matrix3::from_diagonal(&lacking.eigenvalues.map(|v| v.max(0.0)));
    let basis = factor * lacking.eigenvectors;
    let covered = spread + basis * kept * basis.transpose();
    (covered + covered.transpose()) * 0.5
}

/// Joint covariance of the errors of some keyframes: the latest ones, and thinned out more and more, the older ones.
///
/// Another anchor counts as the kept one that is nearest to it. The memory is 36 bytes times the square of their number.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct Drift {
    /// Most keyframes that are kept.
    limit: u32,
    /// Index of the next keyframe.
    next: u32,
    /// The keyframes that are kept, ascending.
    kept: Vec<u32>,
    /// Their body poses, metres.
    bodies: Vec<Se2>,
    /// d e / d (relative error of the angles that the camera sees).
    focal_rates: Vec<Vector3<f64>>,
    /// The part of the reported covariance of each that is beyond the one kept here.
    excesses: Vec<Matrix3<f64>>,
    /// Lower triangle by rows: row i holds cov(e_i, e_0) ... cov(e_i, e_i).
    rows: Vec<Vec<Matrix3<f64>>>,
    /// The keyframes of the window.
    recent: Recent,
}

/// Whether the pose of a keyframe stays as it was drawn.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Draw {
    /// It does.
    Final,
    /// It is smoothed with its window ([`Drift::settle`]).
    Smoothed {
        /// Covariance of the body that each particle leaves open.
        open: Matrix3<f64>,
    },
}

impl Drift {
    /// No keyframe yet; of at most `limit` keyframes the joint covariance is kept.
    #[must_use]
    pub(crate) const fn keeping(limit: u32) -> Self {
        Self {
            limit,
            next: 0,
            kept: Vec::new(),
            bodies: Vec::new(),
            focal_rates: Vec::new(),
            excesses: Vec::new(),
            rows: Vec::new(),
            recent: Recent::after(0),
        }
    }

    /// The errors of the keyframes of a known map; `keyframes` are all of them, and the indices of `errors` are among them.
    /// `added(body)` is the part of the covariance of a keyframe that every report adds anew. An error of the focal length
    /// counts from the map on.
    #[must_use]
    pub(crate) fn of_map(
        keyframes: &[KnownKeyframe],
        errors: &KnownErrors,
        limit: u32,
        added: impl Fn(&Se2) -> Matrix3<f64>,
    ) -> Self {
        let known = || errors.keyframes.iter().map(|k| &keyframes[*k as usize]);
        let mut drift = Self {
            limit,
            next: keyframes.len() as u32,
            kept: errors.keyframes.clone(),
            bodies: known().map(|k| k.body).collect(),
            focal_rates: vec![Vector3::zeros(); errors.keyframes.len()],
            excesses: known()
                .zip(&errors.rows)
                .map(|(k, row)| {
                    let own = row.last().copied().unwrap_or_else(Matrix3::zeros);
                    cover(&own, &(k.covariance - added(&k.body))) - own
                })
                .collect(),
            rows: errors.rows.clone(),
            recent: Recent::after(keyframes.len() as u32),
        };
        drift.thin_to(limit as usize);
        drift
    }

    /// The errors as a map keeps them: those of at most [`SAVED`] keyframes.
    #[must_use]
    pub(crate) fn errors(&self) -> KnownErrors {
        let mut thinned = self.clone();
        thinned.thin_to(SAVED);
        KnownErrors {
            keyframes: thinned.kept,
            rows: thinned.rows,
        }
    }

    /// Most keyframes that are kept.
    pub(crate) const fn limit(&self) -> u32 {
        self.limit
    }

    /// Bytes on the heap.
    pub(crate) fn memory_usage(&self) -> usize {
        let blocks: usize = self.rows.iter().map(Vec::len).sum();
        blocks * size_of::<Matrix3<f64>>() + self.recent.memory_usage()
    }

    /// Whether there is a row for every keyframe, each one entry longer than the one before.
    pub(crate) fn is_whole(&self) -> bool {
        self.kept.len() == self.bodies.len()
            && self.focal_rates.len() == self.bodies.len()
            && self.excesses.len() == self.bodies.len()
            && self.rows.len() == self.bodies.len()
            && self.kept.windows(2).all(|pair| pair[0] < pair[1])
            && self.kept.last().is_none_or(|last| *last < self.next)
            && self
                .rows
                .iter()
                .enumerate()
                .all(|(i, row)| row.len() == i + 1)
            && self.recent.is_whole(self.next)
    }

    /// Adds the next keyframe with the body at `body` (metres) and returns the covariance of its error: cov(e_t, e_t) and what
    /// was reported beyond it at the keyframes that the pose leans on.
    ///
    /// `support` is `None` at the first keyframe, which has no error by
    /// definition, and after a frame whose support could not be computed; then
    /// `odometry` alone carries the error on. Time O(window x anchors + window^2).
    pub(crate) fn push(
        &mut self,
        body: &Se2,
        support: Option<&Support>,
        odometry: &Matrix3<f64>,
        draw: &Draw,
    ) -> Matrix3<f64> {
        let count = self.bodies.len();
        let here = position(body);
        let mut gains: Vec<(usize, Matrix3<f64>)> = Vec::new();
        let mut fresh = Matrix3::zeros();
        let mut focal_rate = Vector3::zeros();
        if let Some(last) = self.bodies.last() {
            let mut rest = Matrix3::identity();
            if let Some(support) = support {
                fresh = match draw {
                    // The path that survives is one draw.
                    Draw::Final => support.covariance * 2.0,
                    Draw::Smoothed { .. } => support.covariance,
                };
                for (anchor, gain) in &support.gains {
                    let slot = self.slot(*anchor);
                    let from = &self.bodies[slot];
                    gains.push((slot, gain * transport(&position(from), &here)));
                    focal_rate += gain * rate_between(from, body);
                    rest -= gain;
                }
            } else {
                fresh = *odometry;
            }
            gains.push((count - 1, rest * transport(&position(last), &here)));
        }
        for (slot, gain) in &gains {
            focal_rate += gain * self.focal_rates[*slot];
        }
        let inherited = self.inherited_excess(&here, &gains);
        let mut row = self.inherited(count, &gains);
        row[count] += fresh;
        let own = row[count];
        let leave_here = match draw {
            Draw::Final => true,
            Draw::Smoothed { open } => {
                let gains = gains.iter().map(|(slot, g)| (self.kept[*slot], *g));
                self.recent.push(gains.collect(), *open, &fresh);
                false
            }
        };
        self.rows.push(row);
        self.bodies.push(*body);
        self.focal_rates.push(focal_rate);
        self.excesses.push(inherited);
        self.kept.push(self.next);
        self.next += 1;
        if leave_here {
            self.recent = Recent::after(self.next);
        }
        self.thin_to(self.limit as usize);
        own + inherited
    }

    /// Takes down that the covariance `reported` was reported of the error of the last keyframe.
    pub(crate) fn note_reported(&mut self, reported: &Matrix3<f64>) {
        if let (Some(row), Some(excess)) = (self.rows.last(), self.excesses.last_mut()) {
            let own = row[row.len() - 1];
            *excess = cover(&own, reported) - own;
        }
    }

    /// The covariance of the error that keyframe `keyframe` at `position` has, with what was reported beyond it.
    #[must_use]
    pub(crate) fn covariance_of(&self, keyframe: u32, position: &Vector2<f64>) -> Matrix3<f64> {
        if self.kept.is_empty() {
            return Matrix3::zeros();
        }
        let slot = self.slot(keyframe);
        let t = transport(&self.position(slot), position);
        t * (self.block(slot, slot) + self.excesses[slot]) * t.transpose()
    }

    /// The derivative of the error of keyframe `keyframe` with the body at `body` by the relative error of all angles that
    /// the camera sees.
    #[must_use]
    pub(crate) fn focal_rate(&self, keyframe: u32, body: &Se2) -> Vector3<f64> {
        if self.kept.is_empty() {
            return Vector3::zeros();
        }
        let slot = self.slot(keyframe);
        transport(&self.position(slot), &position(body)) * self.focal_rates[slot]
    }

    /// Forgets the closest neighbours of the older half until `limit` are left; never the first.
    fn thin_to(&mut self, limit: usize) {
        while self.kept.len() > limit {
            let gap = |i: usize| self.kept[i + 1] - self.kept[i - 1];
            let Some(slot) = (1..limit / 2).min_by_key(|&i| gap(i)) else {
                return;
            };
            self.kept.remove(slot);
            self.bodies.remove(slot);
            self.focal_rates.remove(slot);
            self.excesses.remove(slot);
            self.rows.remove(slot);
            for row in &mut self.rows[slot..] {
                row.remove(slot);
            }
        }
    }

    /// The place of the kept keyframe nearest to `keyframe`, by index.
    pub(super) fn slot(&self, keyframe: u32) -> usize {
        let after = self.kept.partition_point(|&k| k < keyframe);
        let last = self.kept.len() - 1;
        match after {
            0 => 0,
            after if after > last => last,
            after if keyframe - self.kept[after - 1] <= self.kept[after] - keyframe => after - 1,
            after => after,
        }
    }

    /// The kept keyframes, ascending.
    pub(super) fn kept(&self) -> &[u32] {
        &self.kept
    }

    /// Body poses of the kept keyframes, metres.
    pub(super) fn bodies(&self) -> &[Se2] {
        &self.bodies
    }

    /// The derivatives of the errors of the kept keyframes by the relative error of all angles that the camera sees.
    pub(super) fn focal_rates(&self) -> &[Vector3<f64>] {
        &self.focal_rates
    }

    fn position(&self, slot: usize) -> Vector2<f64> {
        position(&self.bodies[slot])
    }

    /// Length of the path of kept keyframes from `keyframe` to the last one and on to `here`, metres.
    #[must_use]
    pub(crate) fn length_since(&self, keyframe: u32, here: &Vector2<f64>) -> f64 {
        if self.kept.is_empty() {
            return 0.0;
        }
        let from: Vec<Vector2<f64>> = self.bodies[self.slot(keyframe)..]
            .iter()
            .map(position)
            .collect();
        let on = from.iter().skip(1).chain([here]);
        from.iter().zip(on).map(|(a, b)| (b - a).norm()).sum()
    }

    /// The first `count` recent keyframes stay where they were drawn.
    pub(super) fn leave(&mut self, count: usize) {
        for i in 0..count {
            let Some(row) = self.place(i) else { continue };
            for j in 0..=i {
                if let Some(column) = self.place(j) {
                    self.rows[row][column] += self.recent.steps[i].own[j];
                }
            }
        }
        self.recent.forget(count);
    }

    /// All recent keyframes stay where they were drawn.
    pub(super) fn leave_all(&mut self) {
        self.leave(self.recent.steps.len());
    }

    /// The place of a recent keyframe among those kept.
    fn place(&self, i: usize) -> Option<usize> {
        self.kept
            .binary_search(&(self.recent.first + i as u32))
            .ok()
    }

    /// The row of a keyframe at `slot` that makes no error of its own.
    pub(super) fn inherited(
        &self,
        slot: usize,
        gains: &[(usize, Matrix3<f64>)],
    ) -> Vec<Matrix3<f64>> {
        let mut row: Vec<Matrix3<f64>> = (0..slot)
            .map(|b| gains.iter().map(|(a, g)| g * self.block(*a, b)).sum())
            .collect();
        let own = gains
            .iter()
            .map(|(a, g)| row[*a] * g.transpose())
            .sum::<Matrix3<f64>>();
        row.push((own + own.transpose()) * 0.5);
        row
    }

    /// The covariance that was reported of the keyframes a pose at `here` leans on, beyond that of their errors.
    pub(super) fn inherited_excess(
        &self,
        here: &Vector2<f64>,
        gains: &[(usize, Matrix3<f64>)],
    ) -> Matrix3<f64> {
        let share = |gain: &Matrix3<f64>| gain.trace().max(0.0);
        let shares = gains.iter().map(|(_, gain)| share(gain)).sum::<f64>();
        gains
            .iter()
            .map(|(slot, gain)| {
                let moved = transport(&self.position(*slot), here);
                moved
                    * self.excesses[*slot]
                    * moved.transpose()
                    * (share(gain) / shares.max(f64::MIN_POSITIVE))
            })
            .sum()
    }

    /// Takes `by(i, j)`, a positive semi-definite matrix by blocks that is nowhere larger, from the joint covariance, and
    /// `rate(i)` from the derivative of each error.
    pub(super) fn lower(
        &mut self,
        by: impl Fn(usize, usize) -> Matrix3<f64>,
        rate: impl Fn(usize) -> Vector3<f64>,
    ) {
        self.leave_all();
        for (i, focal_rate) in self.focal_rates.iter_mut().enumerate() {
            *focal_rate -= rate(i);
        }
        for (i, row) in self.rows.iter_mut().enumerate() {
            let before = row[i].trace();
            for (j, block) in row.iter_mut().enumerate() {
                *block -= by(i, j);
            }
            row[i] = (row[i] + row[i].transpose()) * 0.5;
            // What is not in the covariance falls as it does.
            if before > 0.0 {
                self.excesses[i] *= (row[i].trace() / before).clamp(0.0, 1.0);
            }
        }
    }

    /// Moves the kept keyframes.
    pub(crate) fn move_bodies(&mut self, to: impl Fn(u32, &Se2) -> Se2) {
        for (keyframe, body) in self.kept.iter().zip(&mut self.bodies) {
            *body = to(*keyframe, body);
        }
    }

    /// The place of the kept keyframe nearest to `keyframe`, the matrix that moves its error to `here`, and `weight`.
    pub(crate) fn error_at(
        &self,
        keyframe: u32,
        here: &Vector2<f64>,
        weight: f64,
    ) -> (usize, Matrix3<f64>, f64) {
        let slot = self.slot(keyframe);
        (slot, transport(&self.position(slot), here), weight)
    }

    /// cov(e_a, e_b) of two kept keyframes by their places.
    pub(crate) fn block(&self, a: usize, b: usize) -> Matrix3<f64> {
        if a >= b {
            self.rows[a][b]
        } else {
            self.rows[b][a].transpose()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;

    const WINDOW: u32 = 256;

    fn support(anchor: u32, gain: f64, sigma: f64) -> Support {
        Support {
            gains: BTreeMap::from([(anchor, Matrix3::identity() * gain)]),
            covariance: Matrix3::identity() * (sigma * sigma),
        }
    }

    #[test]
    fn pure_odometry_is_a_random_walk_with_its_lever() {
        let mut drift = Drift::keeping(WINDOW);
        let noise = Matrix3::from_diagonal(&Vector3::new(0.0, 0.0, 1e-4));
        drift.push(&Se2::identity(), None, &noise, &Draw::Final);
        drift.push(&Se2::new(1.0, 0.0, 0.0), None, &noise, &Draw::Final);
        let c = drift.push(&Se2::new(3.0, 0.0, 0.0), None, &noise, &Draw::Final);
        // Heading error of the first step (made at x = 1) swings two metres.
        assert!((c[(2, 2)] - 2e-4).abs() < 1e-18);
        assert!((c[(1, 1)] - 4e-4).abs() < 1e-18);
    }

    #[test]
    fn an_anchor_in_the_first_keyframe_bounds_the_error() {
        let mut drift = Drift::keeping(WINDOW);
        let none = Matrix3::zeros();
        drift.push(&Se2::identity(), None, &none, &Draw::Final);
        let mut last = none;
        for _ in 0..50 {
            last = drift.push(
                &Se2::identity(),
                Some(&support(0, 1.0, 0.01)),
                &none,
                &Draw::Final,
            );
        }
        assert!(
            (last[(0, 0)] - 2e-4).abs() < 1e-15,
            "no accumulation: {last}"
        );
        // The same leaning on the previous keyframe accumulates.
        let mut drift = Drift::keeping(WINDOW);
        drift.push(&Se2::identity(), None, &none, &Draw::Final);
        for k in 0..50 {
            last = drift.push(
                &Se2::identity(),
                Some(&support(k, 1.0, 0.01)),
                &none,
                &Draw::Final,
            );
        }
        assert!((last[(0, 0)] - 50.0 * 2e-4).abs() < 1e-12);
    }

    #[test]
    fn cover_is_the_larger_of_the_two_in_every_direction() {
        let small = Matrix3::from_diagonal(&Vector3::new(1e-6, 4e-4, 1e-8));
        let large = Matrix3::from_diagonal(&Vector3::new(9e-6, 1e-4, 4e-6));
        let both = Matrix3::from_diagonal(&Vector3::new(9e-6, 4e-4, 4e-6));
        assert!((cover(&small, &large) - both).amax() < 1e-12);
        assert!((cover(&large, &small) - both).amax() < 1e-12);
        assert!(
            (cover(&small, &small) - small).amax() < 1e-12,
            "not counted twice"
        );
        // Nothing is lost where the axes differ, and a collapsed spread is no obstacle.
        let turn = Matrix3::new(0.8, -0.6, 0.0, 0.6, 0.8, 0.0, 0.0, 0.0, 1.0);
        let turned = turn * large * turn.transpose();
        for covered in [cover(&small, &turned), cover(&Matrix3::zeros(), &turned)] {
            let rest = (covered - turned).symmetric_eigenvalues();
            assert!(rest.min() > -1e-12, "{rest}");
        }
    }

    #[test]
    fn joint_covariance_stays_positive_past_the_window() {
        let mut drift = Drift::keeping(WINDOW);
        let none = Matrix3::zeros();
        drift.push(&Se2::identity(), None, &none, &Draw::Final);
        for k in 1..(WINDOW + 40) {
            let anchor = k.saturating_sub(3);
            let c = drift.push(
                &Se2::new(0.1 * f64::from(k), 0.0, 0.0),
                Some(&support(anchor, 0.7, 0.001)),
                &none,
                &Draw::Final,
            );
            assert!(c.cholesky().is_some(), "keyframe {k}");
        }
    }
}
