//! Why a request is refused.

use estimation_base::Readable;
use feature_kdtree::IndexError;

/// The refusal of an option or of a landmark.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PlaceError {
    /// An option is outside its range, or not a number.
    #[error("{name} is {}, required: {required}", Readable(*.given))]
    Option {
        /// Name of the option.
        name: &'static str,
        /// The value given.
        given: f64,
        /// The values accepted, in words.
        required: &'static str,
    },
    /// The keypoints of an image and their descriptors do not go together.
    #[error("{pixels} pixels and {descriptors} descriptors, required: one descriptor a pixel")]
    Lengths {
        /// Number of pixels.
        pixels: usize,
        /// Number of descriptors.
        descriptors: usize,
    },
    /// The index of descriptors refused.
    #[error(transparent)]
    Index(#[from] IndexError),
}

/// Refuses a value outside `range`, NaN among them.
pub(crate) fn in_range(
    name: &'static str,
    given: f64,
    range: std::ops::RangeInclusive<f64>,
    required: &'static str,
) -> Result<(), PlaceError> {
    if range.contains(&given) {
        Ok(())
    } else {
        Err(PlaceError::Option {
            name,
            given,
            required,
        })
    }
}
