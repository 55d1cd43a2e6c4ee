//! The epipolar constraint between two views with known poses.
//!
//! A point seen at p1 in the first view lies in the second on the line F p1, with F = `K^-T [t]x R K^-1` of the motion
//! second_from_first = (R, t). The paper scores a match by the sum of the two point-to-line distances (Eq. 30),
//! [`EpipolarPair::symmetric_distance_px`]: linear, without a sigma, twice the same information. The Sampson distance
//! (first-order distance of the pair from the manifold p2^T F p1 = 0; Sampson 1982, Hartley and Zisserman 11.4.3) is one
//! number with a known standard deviation: [`EpipolarPair::sampson`].
//!
//! Degenerate: without a baseline there is no constraint and no matrix (`None`, not zeros: a zero matrix accepts
//! everything). At an epipole the line is undefined. A baseline of rounding size counts as none; whether one of a
//! centimetre is worth scoring is for the caller, who knows the uncertainty of its poses.
//!
//! From matches to matrices and poses: [`FivePoint`], [`EightPoint`], [`PlanarTwoPoint`], [`ArcOnePoint`], [`FourPoint`]
//! (minimal solvers), [`SampsonScorer`] (for RANSAC), [`choose_pose`] (which of the four poses), [`refine`] (least squares
//! with covariance), [`plane_poses`] (homographies).

mod eight_point;
mod five_point;
mod four_point;
mod pair;
mod planar_motion;
mod plane_pose;
mod real_roots;
mod refine;
mod relative_pose;
mod scorer;

pub use eight_point::{
    EightPoint, LinearFundamental, NoFundamental, essential_from_points, fundamental_from_points,
};
pub use five_point::{FivePoint, essential_from_five};
pub use four_point::{FourPoint, HomographyScorer};
pub use pair::{Correspondence, EpipolarPair, Sampson, essential, fundamental};
pub use planar_motion::{ArcOnePoint, PlanarMotion, PlanarTwoPoint, arc_from_one, planar_from_two};
pub use plane_pose::{PlanePose, plane_poses};
pub use refine::{Freedom, Refined, refine, refine_narrowed};
pub use relative_pose::{
    Candidate, PoseChoice, RelativePose, Undecided, candidates, choose_pose, in_front,
};
pub use scorer::{EpipolarModel, SampsonScorer};
