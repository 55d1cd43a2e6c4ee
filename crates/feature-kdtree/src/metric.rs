//! How descriptors of other kinds than SIFT's are compared: the metrics of [`crate::LinearScan`].
//!
//! [`SquaredEuclidean`] compares bytes (`[u8; N]`) and floats (`[f32; N]`), [`Hamming`] the bits of binary descriptors such
//! as ORB's (`[u8; 32]`). A metric computes the distances of one query to many rows, so that the compiler can keep whole
//! vectors busy. Sums of floats are taken in sixteen lanes whatever the instructions, so that every level gives the same
//! bits.

use std::fmt::Debug;

use simd_level::SimdLevel;

use crate::error::IndexError;
use crate::simd;

/// A distance between descriptors of one type, for the rows of a [`crate::LinearScan`].
pub trait Metric<D> {
    /// The distance; not negative.
    type Distance: Distance;
    /// Whether the distance is the square of the one that ratios are meant for.
    const SQUARED: bool;

    /// Appends the distance of the query to each row.
    fn distances(level: SimdLevel, query: &D, rows: &[D], out: &mut Vec<Self::Distance>);

    /// Refuses a descriptor that has no distance.
    ///
    /// # Errors
    /// [`IndexError::NotFinite`].
    fn check(descriptor: &D) -> Result<(), IndexError>;
}

/// A number that distances are: `u32` or `f32`.
pub trait Distance: Copy + Debug + PartialOrd + Into<f64> + Send + Sync + sealed::Sealed {
    /// The distance as a number of 32 bits that is ordered alike.
    #[doc(hidden)]
    fn key(self) -> u32;

    /// The distance of a key.
    #[doc(hidden)]
    fn of_key(key: u32) -> Self;
}

mod sealed {
    /// Only the numbers here can be distances.
    pub trait Sealed {}
    impl Sealed for u32 {}
    impl Sealed for f32 {}
}

impl Distance for u32 {
    fn key(self) -> u32 {
        self
    }

    fn of_key(key: u32) -> Self {
        key
    }
}

/// The bits of floats that are not negative are ordered as the floats are.
impl Distance for f32 {
    fn key(self) -> u32 {
        self.to_bits()
    }

    fn of_key(key: u32) -> Self {
        Self::from_bits(key)
    }
}

/// The squared Euclidean distance of `[u8; N]` (exact, `u32`) or `[f32; N]`.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct SquaredEuclidean;

/// The number of bits in which two `[u8; N]` differ.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Hamming;

impl<const N: usize> Metric<[u8; N]> for SquaredEuclidean {
    type Distance = u32;
    const SQUARED: bool = true;

    fn distances(level: SimdLevel, query: &[u8; N], rows: &[[u8; N]], out: &mut Vec<u32>) {
        const {
            // 66 051 squares of 255 are the most that 32 bits hold.
            assert!(N <= 1 << 16, "a descriptor has at most 65 536 bytes");
        }
        simd::squared_of_bytes(level, query, rows, out);
    }

    fn check(_: &[u8; N]) -> Result<(), IndexError> {
        Ok(())
    }
}

impl<const N: usize> Metric<[f32; N]> for SquaredEuclidean {
    type Distance = f32;
    const SQUARED: bool = true;

    fn distances(level: SimdLevel, query: &[f32; N], rows: &[[f32; N]], out: &mut Vec<f32>) {
        simd::squared_of_floats(level, query, rows, out);
    }

    fn check(descriptor: &[f32; N]) -> Result<(), IndexError> {
        match descriptor.iter().position(|value| !value.is_finite()) {
            None => Ok(()),
            Some(component) => Err(IndexError::NotFinite {
                component,
                value: descriptor[component],
            }),
        }
    }
}

impl<const N: usize> Metric<[u8; N]> for Hamming {
    type Distance = u32;
    const SQUARED: bool = false;

    fn distances(level: SimdLevel, query: &[u8; N], rows: &[[u8; N]], out: &mut Vec<u32>) {
        simd::differing_bits(level, query, rows, out);
    }

    fn check(_: &[u8; N]) -> Result<(), IndexError> {
        Ok(())
    }
}
