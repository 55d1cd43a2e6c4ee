#![doc = include_str!("../README.md")]
//!
//! ## Where to begin
//!
//! [`SimdLevel`], its constructors [`SimdLevel::best`] and [`SimdLevel::available`], and [`Detected`], the proof inside a level.

use std::fmt;

/// A set of vector instructions that this processor has.
///
/// Levels are ordered by the width of their vectors.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum SimdLevel {
    /// The instructions that the build target always has: SSE2 on x86-64, NEON on aarch64.
    Portable,
    /// AVX2, of 256 bits.
    #[cfg(target_arch = "x86_64")]
    Avx2(Detected<256>),
    /// AVX-512 F, VL, DQ, BW and VNNI, of 512 bits.
    #[cfg(target_arch = "x86_64")]
    Avx512(Detected<512>),
}

/// The proof that this processor has the instructions of a level with vectors of `BITS` bits.
///
/// It takes no memory, and nothing outside this crate can make one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Detected<const BITS: usize>(());

impl SimdLevel {
    /// The level with the widest vectors of this processor.
    ///
    /// ```
    /// use simd_level::SimdLevel;
    ///
    /// let best = SimdLevel::best();
    /// assert_eq!(SimdLevel::available().last(), Some(best));
    /// println!("the kernels run on {best}");
    /// ```
    #[must_use]
    pub fn best() -> Self {
        Self::available().last().unwrap_or(Self::Portable)
    }

    /// Every level of this processor, the portable one first and the widest last.
    pub fn available() -> impl Iterator<Item = Self> {
        std::iter::once(Self::Portable).chain(wider().into_iter().flatten())
    }
}

/// The levels above the portable one, where the processor has them.
#[cfg(target_arch = "x86_64")]
fn wider() -> [Option<SimdLevel>; 2] {
    let avx2 = is_x86_feature_detected!("avx2");
    let avx512 = is_x86_feature_detected!("avx512f")
        && is_x86_feature_detected!("avx512vl")
        && is_x86_feature_detected!("avx512dq")
        && is_x86_feature_detected!("avx512bw")
        && is_x86_feature_detected!("avx512vnni");
    [
        avx2.then_some(SimdLevel::Avx2(Detected(()))),
        // Kernels for 512 bits fall back on those for 256 bits in places.
        (avx2 && avx512).then_some(SimdLevel::Avx512(Detected(()))),
    ]
}

/// The levels above the portable one: none on this architecture.
#[cfg(not(target_arch = "x86_64"))]
fn wider() -> [Option<SimdLevel>; 0] {
    []
}

impl fmt::Display for SimdLevel {
    /// `portable`, `avx2` or `avx512`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Portable => "portable",
            #[cfg(target_arch = "x86_64")]
            Self::Avx2(_) => "avx2",
            #[cfg(target_arch = "x86_64")]
            Self::Avx512(_) => "avx512",
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_ascend_from_the_portable_one_to_the_best() {
        let levels: Vec<SimdLevel> = SimdLevel::available().collect();
        assert_eq!(levels[0], SimdLevel::Portable);
        assert!(levels.is_sorted() && levels.last() == Some(&SimdLevel::best()));
        let names: Vec<String> = levels.iter().map(SimdLevel::to_string).collect();
        assert_eq!(names, ["portable", "avx2", "avx512"][..names.len()]);
    }

    /// On a processor of one level the level itself takes none either.
    #[test]
    fn the_proof_takes_no_memory() {
        assert_eq!(size_of::<Detected<256>>(), 0);
        assert!(size_of::<SimdLevel>() <= 1);
    }

    #[cfg(target_arch = "x86_64")]
    #[test]
    fn a_level_exists_exactly_where_the_processor_has_its_instructions() {
        let has = |level: &str| SimdLevel::available().any(|other| other.to_string() == level);
        assert_eq!(has("avx2"), is_x86_feature_detected!("avx2"));
        // Whoever has the byte dot products of 512 bits has the other four sets too.
        assert_eq!(has("avx512"), is_x86_feature_detected!("avx512vnni"));
    }
}
