//! Proposals of the pose: from the motion model alone, extended, unscented.
//!
//! All return the exact increment of the importance weight,
//!
//! ```text
//! log p(z | s, map) + log p(s | s_prev, u) - log q(s)
//! ```
//!
//! with p(z | s, map) = prod_k N(z_k; z^_k(s), V_k(s) + R), where V_k is the covariance of landmark k as
//! it appears in the measurement. The likelihood alone is right for [`MotionProposal`], where
//! q = p(s | s_prev, u), and wrong for any other: it counts the measurement twice, once in drawing and
//! once in weighting.
//!
//! [`ExtendedProposal`] and [`UnscentedProposal`] take in all landmarks of the frame that the particle
//! holds. Given the pose the measurements are independent, so each adds information,
//!
//! ```text
//! R_k = R + V_k,   Lambda = Q^-1 + sum H_k^T R_k^-1 H_k
//! ```
//!
//! to the motion prior (s^, Q), all in the tangent at s^. Without V_k the proposal is over-confident. In
//! the linear Gaussian case q is the exact posterior, and the increment is log N(z; z^, S) whatever pose
//! is drawn.
//!
//! Landmarks that the particle does not hold are left out. A measurement that cannot be predicted is
//! left out of the proposal, and one that cannot be predicted at the drawn pose makes the weight zero.
//! Multimodal posteriors, such as that of a robot that may be in one of two places, need another
//! proposal.

mod extended;
pub(crate) mod likelihood;
mod motion;
pub(crate) mod prior;
mod unscented;

pub use extended::{ExtendedProposal, Linearisation};
pub use motion::MotionProposal;
pub use unscented::UnscentedProposal;
