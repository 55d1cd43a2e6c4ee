//! The descriptor and its distance.
//!
//! A SIFT descriptor is 16 cells of 8 gradient orientations, quantised to bytes. Two of them are compared by the Euclidean
//! distance (paper, Eq. 20). Everything here works on the *squared* distance: it is an integer, hence exact, the same in
//! any order of summation, and it orders pairs as the distance itself does.
//! A ratio of distances must be squared before it meets squared distances; see [`crate::match_descriptors`].

/// The number of components of a descriptor.
pub(crate) const DESCRIPTOR_LENGTH: usize = 128;

/// A SIFT descriptor: 128 components quantised to bytes.
pub type Descriptor = [u8; DESCRIPTOR_LENGTH];

/// The largest possible squared distance, between all-zero and all-255 descriptors: 128 * 255^2.
pub(crate) const MAX_DISTANCE_SQUARED: u32 = DESCRIPTOR_LENGTH as u32 * 255 * 255;

/// The squared Euclidean distance of two descriptors (paper, Eq. 20, before the root).
///
/// At most 128 * 255^2 = 8 323 200, so it never overflows. O(128), without branches.
///
/// All differences first, then squares added two by two: the compiler maps the second loop to multiply-add
/// instructions on pairs of 16-bit lanes, which one plain loop does not get. Nothing can wrap; the wrapping
/// operations only keep overflow checks from undoing the vectorisation in development builds.
#[must_use]
#[inline]
pub fn distance_squared(a: &Descriptor, b: &Descriptor) -> u32 {
    part_squared(a, b)
}

#[inline]
fn part_squared<const N: usize>(a: &[u8; N], b: &[u8; N]) -> u32 {
    let mut differences = [0_i16; N];
    for i in 0..N {
        differences[i] = i16::from(a[i]).wrapping_sub(i16::from(b[i]));
    }
    let mut sum = 0_i32;
    for i in 0..N / 2 {
        let even = i32::from(differences[2 * i]);
        let odd = i32::from(differences[2 * i + 1]);
        sum = sum.wrapping_add(even.wrapping_mul(even).wrapping_add(odd.wrapping_mul(odd)));
    }
    sum.cast_unsigned()
}

/// [`distance_squared`], where it is not above `limit`; `None` where it is. Most descriptors show after a part of their
/// components that they are farther. O(128).
#[must_use]
#[inline]
pub fn distance_squared_within(a: &Descriptor, b: &Descriptor, limit: u32) -> Option<u32> {
    const PART: usize = 32;
    let (a, b) = (a.as_chunks::<PART>().0, b.as_chunks::<PART>().0);
    let mut sum = 0;
    for (a, b) in a.iter().zip(b) {
        sum += part_squared(a, b);
        if sum > limit {
            return None;
        }
    }
    Some(sum)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn extremes_are_exact() {
        let zero = [0_u8; DESCRIPTOR_LENGTH];
        let full = [255_u8; DESCRIPTOR_LENGTH];
        assert_eq!(distance_squared(&zero, &zero), 0);
        assert_eq!(distance_squared(&zero, &full), MAX_DISTANCE_SQUARED);
        assert_eq!(distance_squared(&full, &zero), 8_323_200);
    }

    #[test]
    fn a_limit_leaves_out_what_is_above_it_alone() {
        let a: Descriptor = std::array::from_fn(|i| (i * 37 % 251) as u8);
        let b: Descriptor = std::array::from_fn(|i| (i * 91 % 240) as u8);
        let d = distance_squared(&a, &b);
        for limit in [d, d + 1, u32::MAX] {
            assert_eq!(distance_squared_within(&a, &b, limit), Some(d));
        }
        for limit in [d - 1, d / 2, 0] {
            assert_eq!(distance_squared_within(&a, &b, limit), None);
        }
        assert_eq!(distance_squared_within(&a, &a, 0), Some(0));
    }

    #[test]
    fn every_component_counts_once() {
        let zero = [0_u8; DESCRIPTOR_LENGTH];
        for i in 0..DESCRIPTOR_LENGTH {
            let mut one = zero;
            one[i] = 200;
            assert_eq!(distance_squared(&zero, &one), 40_000, "component {i}");
        }
    }
}
