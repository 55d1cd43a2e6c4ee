//! The error type of the crate.
//!
//! Every variant carries the value given and the bound that it broke. A picture without any keypoint is not an error.

/// Why an image or a parameter was refused.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SiftError {
    /// One side of the image is shorter than 16 pixels.
    #[error("image is {width}x{height} pixels, at least {minimum}x{minimum} needed")]
    ImageTooSmall {
        /// Width given, pixels.
        width: usize,
        /// Height given, pixels.
        height: usize,
        /// Smallest side accepted, pixels.
        minimum: usize,
    },
    /// One side of the image is longer than 32 767 pixels.
    #[error("image is {width}x{height} pixels, at most {maximum}x{maximum} accepted")]
    ImageTooLarge {
        /// Width given, pixels.
        width: usize,
        /// Height given, pixels.
        height: usize,
        /// Longest side accepted, pixels.
        maximum: usize,
    },
    /// Rows would overlap: the stride is less than the width.
    #[error("row stride is {stride} bytes, at least the width {width} needed")]
    StrideTooSmall {
        /// Stride given, bytes from row to row.
        stride: usize,
        /// Width given, pixels.
        width: usize,
    },
    /// The buffer ends before the last pixel.
    #[error("pixel buffer has {length} bytes, {required} needed")]
    BufferTooShort {
        /// Length given, bytes.
        length: usize,
        /// Length needed, bytes.
        required: usize,
    },
    /// The region has another size than the image.
    #[error("region is {}x{} pixels, the image {}x{}", given.0, given.1, needed.0, needed.1)]
    RegionSize {
        /// Width and height given, pixels.
        given: (usize, usize),
        /// Width and height of the image, pixels.
        needed: (usize, usize),
    },
    /// A parameter is outside its range (or not a number).
    #[error("parameter {name} is {value}, must lie in [{minimum}, {maximum}]")]
    ParameterOutOfRange {
        /// Name of the field of [`crate::SiftParams`].
        name: &'static str,
        /// Value given.
        value: f64,
        /// Smallest value accepted.
        minimum: f64,
        /// Largest value accepted.
        maximum: f64,
    },
}
