//! What can be wrong with an insertion, a parameter or a matching request.

use thiserror::Error;

/// Errors of this crate.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
#[non_exhaustive]
pub enum IndexError {
    /// The id is in the index already; remove it first.
    #[error("id {id} is already in the index, ids must be unique")]
    DuplicateId {
        /// The id given twice.
        id: u32,
    },
    /// The ratio of Eq. 21 lies outside its range.
    #[error("ratio must lie in 0..=1, given {given}")]
    Ratio {
        /// The ratio given.
        given: f32,
    },
    /// A parameter of the forest is below its least value.
    #[error("{name} must be at least {least}, given {given}")]
    ParameterTooSmall {
        /// Field of [`crate::KdForestParams`].
        name: &'static str,
        /// The value given.
        given: usize,
        /// The least value allowed.
        least: usize,
    },
    /// A parameter of the forest is above its greatest value.
    #[error("{name} must be at most {most}, given {given}")]
    ParameterTooLarge {
        /// Field of [`crate::KdForestParams`].
        name: &'static str,
        /// The value given.
        given: usize,
        /// The greatest value allowed.
        most: usize,
    },
    /// More descriptors than positions or slots can be numbered by a `u32`.
    #[error("at most {most} descriptors can be numbered, given {given}")]
    TooMany {
        /// Number of descriptors given.
        given: usize,
        /// The greatest number allowed.
        most: usize,
    },
}
