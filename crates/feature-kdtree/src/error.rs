//! The errors of insertions, parameters and matching requests.

use thiserror::Error;

/// Why an insertion, a parameter or a matching request was refused.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
#[non_exhaustive]
pub enum IndexError {
    /// The id is in the index already; it must be removed before it can be given again.
    #[error("id {id} is already in the index, ids must be unique")]
    DuplicateId {
        /// The id given twice.
        id: u32,
    },
    /// The ratio of Eq. 21 lies outside its range.
    #[error("ratio {given} given, 0 to 1 required")]
    Ratio {
        /// The ratio given.
        given: f32,
    },
    /// A parameter of an index is below its least value.
    #[error("{name} must be at least {least}, given {given}")]
    ParameterTooSmall {
        /// The name of the field, of [`crate::KdForestParams`] or [`crate::InvertedListsParams`].
        name: &'static str,
        /// The value given.
        given: usize,
        /// The least value allowed.
        least: usize,
    },
    /// A parameter of the forest is above its greatest value.
    #[error("{name} must be at most {most}, given {given}")]
    ParameterTooLarge {
        /// The name of the field of [`crate::KdForestParams`].
        name: &'static str,
        /// The value given.
        given: usize,
        /// The greatest value allowed.
        most: usize,
    },
    /// A component of a float descriptor is NaN or infinite.
    #[error("component {component} of the descriptor is {value}, a finite number required")]
    NotFinite {
        /// The position of the component, from 0.
        component: usize,
        /// Its value.
        value: f32,
    },
    /// A stored index that breaks the named rule.
    #[error("stored index: {0}")]
    Stored(&'static str),
    /// There are more descriptors than the index, or a position of 32 bits, can number.
    #[error("at most {most} descriptors can be numbered, given {given}")]
    TooMany {
        /// The number of descriptors given.
        given: usize,
        /// The greatest number allowed.
        most: usize,
    },
}
