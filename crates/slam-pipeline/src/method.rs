//! The three filters as one table of policies.
//!
//! | policy | `exact` | `paper` | `conventional` |
//! |---|---|---|---|
//! | motion step | exact arc | Eq. 25 as printed | exact arc |
//! | carrier | tilt, height, open scale | strictly planar | strictly planar |
//! | descriptor search | landmarks in view | k-d forest over the whole map | landmarks in view |
//! | proposal | unscented | unscented | odometry |
//! | likelihood | Gaussian with outliers | Eq. 29 and 30 as printed | Gaussian with outliers |
//! | weight | likelihood, prior, proposal | likelihood (Eq. 31) | likelihood |
//! | resampling | N_eff below the threshold | N_eff below the threshold | every step |
//! | evolution | Metropolis-Hastings moves | Eq. 17 to 19 | none |
//! | start of a landmark | second sighting | two views with parallax | two views with parallax |
//! | sigma points of landmarks | default set | printed set | default set |
//! | reported covariance | particles and common drift | particles | particles |
//! | old places | move the path, find a lost robot | no | no |
//!
//! Nothing else in the crate asks which method runs.

use serde::{Deserialize, Serialize};
use ukf::SigmaPoints;

use crate::ablation::Ablation;
use crate::config::{Config, Method};

/// How odometry rows move the body.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) enum MotionStep {
    /// The arc of constant speed and turn rate.
    ExactArc,
    /// The one-sided Euler step that the paper prints.
    PrintedEuler,
}

/// Which freedoms the carrier has beside its planar pose.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum CarrierFreedom {
    /// Roll, pitch, height and the metric scale are estimated.
    TiltHeightScale,
    /// The carrier is strictly planar and the scale of odometry is taken as right.
    Planar,
}

/// Where the descriptor of a keypoint is searched.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum DescriptorSearch {
    /// Exactly, among the landmarks that are predicted in view; gates guide the rest.
    InView,
    /// In a k-d forest over the whole map, as the paper does.
    WholeMapForest,
}

/// Distribution that poses are drawn from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum ProposalKind {
    /// The odometry prior.
    Motion,
    /// The unscented posterior given all matches.
    Unscented {
        /// Number of linearisations.
        iterations: usize,
    },
    /// The posterior of one first-order update given all matches (ablation only).
    FirstOrder,
}

/// Form of the observation likelihood.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum LikelihoodForm {
    /// Gaussian with pixel noise, determinant and a uniform share of wrong matches.
    Exact,
    /// Eq. 29 and 30 as printed.
    Printed,
}

/// Form of the importance weight.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum WeightForm {
    /// Likelihood times prior over proposal.
    Importance,
    /// The likelihood alone (Eq. 31).
    LikelihoodOnly,
}

/// Moves of the poses after a resampling.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Evolution {
    /// Metropolis-Hastings moves that leave the posterior invariant.
    MetropolisHastings,
    /// The printed operators (Eq. 17 to 19).
    Printed,
    /// None.
    Off,
}

/// When a feature becomes a landmark of the map.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum LandmarkStart {
    /// At its second sighting, as an anchored inverse depth.
    SecondSighting,
    /// As a point from two views, once their rays enclose this angle.
    TwoViews {
        /// Least parallax, radians.
        min_parallax: f64,
    },
}

/// Which covariance is reported.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum ReportedCovariance {
    /// Spread of the particles, covered by the drift of the path they share.
    SpreadAndDrift,
    /// Spread of the particles alone.
    Spread,
}

/// One filter: what it does at every place where the methods differ.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Policies {
    pub(crate) motion_step: MotionStep,
    pub(crate) carrier: CarrierFreedom,
    pub(crate) search: DescriptorSearch,
    pub(crate) proposal: ProposalKind,
    pub(crate) likelihood: LikelihoodForm,
    pub(crate) weight: WeightForm,
    /// Whether a weight is carried from keyframe to keyframe.
    pub(crate) carries_weights: bool,
    /// Share of N below which N_eff makes the filter resample.
    pub(crate) resampling_threshold: f64,
    pub(crate) evolution: Evolution,
    pub(crate) landmark_start: LandmarkStart,
    pub(crate) landmark_points: SigmaPoints<3>,
    pub(crate) reported: ReportedCovariance,
    /// Whether old places move the path, and a robot that is lost is found by them.
    pub(crate) recovers: bool,
}

impl Policies {
    /// The column of the table that `config` names, with its numbers.
    pub(crate) fn of(config: &Config) -> Self {
        let unscented = ProposalKind::Unscented {
            iterations: config.filter.iterations as usize,
        };
        let two_views = LandmarkStart::TwoViews {
            min_parallax: config.mapping.min_parallax,
        };
        match config.filter.method {
            Method::Exact => Self {
                motion_step: MotionStep::ExactArc,
                carrier: CarrierFreedom::TiltHeightScale,
                search: DescriptorSearch::InView,
                proposal: unscented,
                likelihood: LikelihoodForm::Exact,
                weight: WeightForm::Importance,
                carries_weights: true,
                resampling_threshold: config.filter.resampling_threshold,
                evolution: Evolution::MetropolisHastings,
                landmark_start: LandmarkStart::SecondSighting,
                landmark_points: SigmaPoints::default(),
                reported: ReportedCovariance::SpreadAndDrift,
                recovers: true,
            },
            Method::Paper => Self {
                motion_step: MotionStep::PrintedEuler,
                carrier: CarrierFreedom::Planar,
                search: DescriptorSearch::WholeMapForest,
                proposal: unscented,
                likelihood: LikelihoodForm::Printed,
                weight: WeightForm::LikelihoodOnly,
                carries_weights: true,
                resampling_threshold: config.filter.resampling_threshold,
                evolution: Evolution::Printed,
                landmark_start: two_views,
                landmark_points: SigmaPoints::paper(),
                reported: ReportedCovariance::Spread,
                recovers: false,
            },
            Method::Conventional => Self {
                motion_step: MotionStep::ExactArc,
                carrier: CarrierFreedom::Planar,
                search: DescriptorSearch::InView,
                proposal: ProposalKind::Motion,
                likelihood: LikelihoodForm::Exact,
                weight: WeightForm::LikelihoodOnly,
                carries_weights: true,
                resampling_threshold: 1.0,
                evolution: Evolution::Off,
                landmark_start: two_views,
                landmark_points: SigmaPoints::default(),
                reported: ReportedCovariance::Spread,
                recovers: false,
            },
        }
    }
}

impl Policies {
    /// The same filter without one of its parts.
    pub(crate) fn without(self, config: &Config, part: Ablation) -> Self {
        match part {
            Ablation::NoEvolution => Self {
                evolution: Evolution::Off,
                ..self
            },
            Ablation::NoUnscented => Self {
                proposal: ProposalKind::Motion,
                ..self
            },
            Ablation::ResampleAlways => Self {
                resampling_threshold: 1.0,
                ..self
            },
            Ablation::DelayedStarts => Self {
                landmark_start: LandmarkStart::TwoViews {
                    min_parallax: config.mapping.min_parallax,
                },
                ..self
            },
            Ablation::LikelihoodOnly => Self {
                weight: WeightForm::LikelihoodOnly,
                ..self
            },
            Ablation::WeightsNotCarried => Self {
                carries_weights: false,
                ..self
            },
            Ablation::FirstOrderProposal => Self {
                proposal: ProposalKind::FirstOrder,
                ..self
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn policies(method: Method) -> Policies {
        let mut config = Config::default();
        config.filter.method = method;
        Policies::of(&config)
    }

    #[test]
    fn the_conventional_filter_resamples_at_every_step() {
        assert_eq!(policies(Method::Conventional).resampling_threshold, 1.0);
        for method in [Method::Exact, Method::Paper] {
            assert_eq!(policies(method).resampling_threshold, 0.6);
        }
    }

    #[test]
    fn only_the_exact_filter_weighs_with_prior_and_proposal() {
        assert_eq!(policies(Method::Exact).weight, WeightForm::Importance);
        assert_eq!(policies(Method::Paper).weight, WeightForm::LikelihoodOnly);
    }

    #[test]
    fn an_ablation_takes_away_one_part_and_no_two_take_the_same() {
        let config = Config::default();
        let whole = Policies::of(&config);
        let parts = [
            Ablation::NoEvolution,
            Ablation::NoUnscented,
            Ablation::ResampleAlways,
            Ablation::DelayedStarts,
            Ablation::LikelihoodOnly,
            Ablation::WeightsNotCarried,
            Ablation::FirstOrderProposal,
        ];
        for (index, part) in parts.into_iter().enumerate() {
            let ablated = whole.without(&config, part);
            assert_ne!(ablated, whole, "{part:?}");
            for other in &parts[..index] {
                assert_ne!(ablated, whole.without(&config, *other), "{part:?}");
            }
        }
    }
}
