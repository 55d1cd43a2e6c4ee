//! The search for another turn or another direction of travel that fits the images better than what was stated.
//!
//! A hypothesis is a direction of travel, a factor of all turns, and a roll of the camera. For every pair of frames
//! and direction the agreement is tabulated over turns once; a factor then costs a look-up. Hypotheses with a name
//! (another sign, degrees for radians, a mount that was left out) come first: a free one must be clearly better.

use std::f64::consts::{FRAC_PI_2, PI};

use mono_geometry::motion::OdometrySample;
use mono_geometry::{Mount, Pinhole, Se3};
use nalgebra::{Rotation3, Vector3};

use crate::agreement::Agreement;
use crate::finding::{Finding, Support};
use crate::pair::{Claim, FramePair};

/// Turns within this of the claimed one are the claimed one, radians, and as a share of it.
const TURN_WINDOW_RAD: f64 = 0.01;
const TURN_WINDOW_SHARE: f64 = 0.1;
/// Directions of travel that are tried.
const DIRECTIONS: usize = 24;
/// Agreements this near to each other do not tell two hypotheses apart.
const TELLING: f64 = 0.05;
/// Mean gain in agreement, over the pairs that tell, from which a contradiction is believed.
const MIN_GAIN: f64 = 0.15;
/// Agreement below which a hypothesis explains nothing.
const MIN_AGREEMENT: f64 = 0.35;
/// Agreement above which nothing further is tried.
const GOOD_AGREEMENT: f64 = 0.6;
/// Pairs that must tell the two hypotheses apart.
const MIN_PAIRS: usize = 3;
/// Gains must outweigh losses by this factor.
const GAIN_OVER_LOSS: f64 = 4.0;
/// Share of the pairs that must tell the two hypotheses apart.
const MIN_PAIRS_SHARE: f64 = 0.2;
/// Free turns must agree better than any other contradiction by this.
const UNRELATED_MARGIN: f64 = 0.1;
/// A speed this many times the stated one is tried.
const LARGER: f64 = 100.0;
/// A hypothesis of a later rank must agree better by this.
const RANK_MARGIN: f64 = 0.04;

/// The contradiction that explains the images best; `None` where what was stated explains them as well.
pub(crate) fn contradiction(
    pairs: &[&FramePair],
    rows: &[OdometrySample],
    camera: &Pinhole,
    mount: &Mount,
) -> Option<Finding> {
    let claims: Vec<Claim> = pairs
        .iter()
        .map(|pair| Claim::of(rows, pair.from_s, pair.to_s))
        .collect();
    let tables = Tables::of(pairs, &claims, camera, mount);
    let stated = tables.scores(0, 1.0);
    let mut search = Search {
        stated: &stated,
        best: None,
    };
    search.turns_and_directions(&tables);
    // Tables that only a disagreement is worth.
    if mean(&stated) < GOOD_AGREEMENT {
        let farther: Vec<f64> = pairs
            .iter()
            .zip(&claims)
            .map(|(pair, claim)| {
                let claim = Claim {
                    distance_m: LARGER * claim.distance_m,
                    ..*claim
                };
                Agreement::of(pair, &claim, 0.0, camera, mount)
                    .near(claim.turn_rad, window(claim.turn_rad))
            })
            .collect();
        search.offer(&farther, Finding::SpeedTooSmall);
        for angle_rad in [FRAC_PI_2, -FRAC_PI_2, PI] {
            let rolled = rolled(mount, angle_rad);
            let scores: Vec<f64> = pairs
                .iter()
                .zip(&claims)
                .map(|(pair, claim)| {
                    Agreement::of(pair, claim, 0.0, camera, &rolled)
                        .near(claim.turn_rad, window(claim.turn_rad))
                })
                .collect();
            search.offer(&scores, |support| Finding::MountRolled {
                angle_rad,
                support,
            });
        }
    }
    match (search.best, unrelated(&tables, &stated)) {
        (Some((_, before)), Some((unrelated, mean))) if mean > before + UNRELATED_MARGIN => {
            Some(unrelated)
        }
        (Some((finding, _)), _) => Some(finding),
        (None, unrelated) => unrelated.map(|(finding, _)| finding),
    }
}

/// The best contradiction so far, with its mean agreement over all pairs.
struct Search<'a> {
    stated: &'a [f64],
    best: Option<(Finding, f64)>,
}

impl Search<'_> {
    fn offer(&mut self, scores: &[f64], finding: impl FnOnce(Support) -> Finding) {
        if let Some((support, mean)) = support(self.stated, scores)
            && self
                .best
                .is_none_or(|(_, before)| mean > before + RANK_MARGIN)
        {
            self.best = Some((finding(support), mean));
        }
    }

    fn turns_and_directions(&mut self, tables: &Tables<'_>) {
        let half = DIRECTIONS / 2;
        self.offer(&tables.scores(0, -1.0), Finding::TurnSign);
        self.offer(&tables.scores(half, 1.0), Finding::DrivingDirection);
        self.offer(&tables.scores(half, -1.0), Finding::UpsideDown);
        for ratio in [PI / 180.0, 180.0 / PI]
            .into_iter()
            .chain(best_ratio(tables))
        {
            self.offer(&tables.scores(0, ratio), |support| Finding::TurnRatio {
                ratio,
                support,
            });
        }
        // Quarter turns first: mounts are wrong by those.
        let quarter = DIRECTIONS / 4;
        let mut directions: Vec<usize> = vec![quarter, DIRECTIONS - quarter];
        directions.extend((1..DIRECTIONS).filter(|d| d % quarter != 0));
        for mirrored in [false, true] {
            for &direction in &directions {
                let ratio = if mirrored { -1.0 } else { 1.0 };
                self.offer(&tables.scores(direction, ratio), |support| {
                    Finding::MountTurned {
                        angle_rad: direction_rad(direction),
                        mirrored,
                        support,
                    }
                });
            }
        }
    }
}

/// Turns of the images that are no multiple of the odometry's, and their mean agreement.
fn unrelated(tables: &Tables<'_>, stated: &[f64]) -> Option<(Finding, f64)> {
    let free: Vec<(f64, f64)> = tables.by_direction[0].iter().map(Agreement::best).collect();
    let scores: Vec<f64> = free.iter().map(|f| f.1).collect();
    let (support, mean_agreement) = support(stated, &scores)?;
    // A free turn fits every pair at least as well: most of them must tell, and clearly.
    if 2 * support.pairs <= stated.len() || support.stated >= 0.5 * support.found {
        return None;
    }
    let rms = |squares: Vec<f64>| mean(&squares).sqrt();
    let finding = Finding::TurnUnrelated {
        images_rad: rms(free.iter().map(|f| f.0 * f.0).collect()),
        odometry_rad: rms(tables
            .claims
            .iter()
            .map(|c| c.turn_rad * c.turn_rad)
            .collect()),
        support,
    };
    Some((finding, mean_agreement))
}

/// Agreement of every pair, by direction of travel.
struct Tables<'a> {
    claims: &'a [Claim],
    by_direction: Vec<Vec<Agreement>>,
}

impl<'a> Tables<'a> {
    fn of(pairs: &[&FramePair], claims: &'a [Claim], camera: &Pinhole, mount: &Mount) -> Self {
        let by_direction = (0..DIRECTIONS)
            .map(|direction| {
                pairs
                    .iter()
                    .zip(claims)
                    .map(|(pair, claim)| {
                        Agreement::of(pair, claim, direction_rad(direction), camera, mount)
                    })
                    .collect()
            })
            .collect();
        Self {
            claims,
            by_direction,
        }
    }

    /// Agreement of every pair with all turns multiplied by `ratio`.
    fn scores(&self, direction: usize, ratio: f64) -> Vec<f64> {
        self.by_direction[direction]
            .iter()
            .zip(self.claims)
            .map(|(table, claim)| {
                table.near(ratio * claim.turn_rad, window(ratio * claim.turn_rad))
            })
            .collect()
    }
}

/// The evidence for `found` over `stated`, and the mean agreement over all pairs; `None` where it does not suffice.
fn support(stated: &[f64], found: &[f64]) -> Option<(Support, f64)> {
    let telling: Vec<(f64, f64)> = stated
        .iter()
        .copied()
        .zip(found.iter().copied())
        .filter(|(s, f)| (f - s).abs() > TELLING)
        .collect();
    let gain: f64 = telling.iter().map(|(s, f)| (f - s).max(0.0)).sum();
    let loss: f64 = telling.iter().map(|(s, f)| (s - f).max(0.0)).sum();
    let support = Support {
        stated: mean(&telling.iter().map(|t| t.0).collect::<Vec<_>>()),
        found: mean(&telling.iter().map(|t| t.1).collect::<Vec<_>>()),
        pairs: telling.len(),
    };
    let believed = telling.len() >= MIN_PAIRS
        && telling.len() as f64 >= MIN_PAIRS_SHARE * stated.len() as f64
        && support.found - support.stated >= MIN_GAIN
        && support.found >= MIN_AGREEMENT
        && gain >= GAIN_OVER_LOSS * loss;
    believed.then(|| (support, mean(found)))
}

/// Of the factors between -3 and 3 that agree as well as the best one, the one nearest to 1; `None` where that is 1 or so.
///
/// Parallax may stand for a missing turn, so many factors agree alike; the nearest to 1 claims least.
fn best_ratio(tables: &Tables<'_>) -> Option<f64> {
    let agreements: Vec<(f64, f64)> = (-60..=60)
        .map(|step| f64::from(step) * 0.05)
        .map(|ratio| (ratio, mean(&tables.scores(0, ratio))))
        .collect();
    let best = agreements.iter().map(|a| a.1).fold(0.0, f64::max);
    agreements
        .iter()
        .filter(|a| a.1 > best - 0.02)
        .map(|a| a.0)
        .min_by(|a, b| (a - 1.0).abs().total_cmp(&(b - 1.0).abs()))
        .filter(|ratio| (ratio - 1.0).abs() > 0.15)
}

/// Direction of travel number `direction`, radians in (-pi, pi].
fn direction_rad(direction: usize) -> f64 {
    let angle = direction as f64 * 2.0 * PI / DIRECTIONS as f64;
    if angle > PI { angle - 2.0 * PI } else { angle }
}

fn window(turn_rad: f64) -> f64 {
    TURN_WINDOW_RAD + TURN_WINDOW_SHARE * turn_rad.abs()
}

fn rolled(mount: &Mount, angle_rad: f64) -> Mount {
    let about_axis = Rotation3::from_axis_angle(&Vector3::z_axis(), angle_rad);
    Mount {
        body_from_camera: Se3 {
            rotation: mount.body_from_camera.rotation * about_axis,
            translation: mount.body_from_camera.translation,
        },
    }
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}
