//! Distances of descriptors of any length: plain loops, compiled once more for each level of vector instructions.
//!
//! The loops are written so that the compiler vectorises them: integers in any order, floats in sixteen lanes that are
//! added in pairs at the end, so that all levels round alike. Nothing contracts a multiplication with an addition.

/// The lanes in which floats are summed.
const LANES: usize = 16;

#[inline(always)]
pub(super) fn squared_of_bytes<const N: usize>(
    query: &[u8; N],
    rows: &[[u8; N]],
    out: &mut Vec<u32>,
) {
    out.extend(rows.iter().map(|row| {
        let mut sum = 0_u32;
        for (a, b) in query.iter().zip(row) {
            let difference = i32::from(*a) - i32::from(*b);
            sum = sum.wrapping_add((difference * difference).cast_unsigned());
        }
        sum
    }));
}

#[inline(always)]
pub(super) fn squared_of_floats<const N: usize>(
    query: &[f32; N],
    rows: &[[f32; N]],
    out: &mut Vec<f32>,
) {
    let (whole, rest) = query.as_chunks::<LANES>();
    out.extend(rows.iter().map(|row| {
        let mut lanes = [0.0_f32; LANES];
        let (row_whole, row_rest) = row.as_chunks::<LANES>();
        for (a, b) in whole.iter().zip(row_whole) {
            for lane in 0..LANES {
                let difference = a[lane] - b[lane];
                lanes[lane] += difference * difference;
            }
        }
        for ((a, b), lane) in rest.iter().zip(row_rest).zip(&mut lanes) {
            *lane += (a - b) * (a - b);
        }
        let mut width = LANES / 2;
        while width > 0 {
            for lane in 0..width {
                lanes[lane] += lanes[lane + width];
            }
            width /= 2;
        }
        lanes[0]
    }));
}

#[inline(always)]
pub(super) fn differing_bits<const N: usize>(
    query: &[u8; N],
    rows: &[[u8; N]],
    out: &mut Vec<u32>,
) {
    let (whole, rest) = query.as_chunks::<8>();
    out.extend(rows.iter().map(|row| {
        let (row_whole, row_rest) = row.as_chunks::<8>();
        let mut bits = 0;
        for (a, b) in whole.iter().zip(row_whole) {
            bits += (u64::from_ne_bytes(*a) ^ u64::from_ne_bytes(*b)).count_ones();
        }
        for (a, b) in rest.iter().zip(row_rest) {
            bits += (a ^ b).count_ones();
        }
        bits
    }));
}

/// The same loops with wider instructions.
#[cfg(target_arch = "x86_64")]
macro_rules! compiled_for {
    ($level:ident, $features:literal) => {
        pub(super) mod $level {
            use crate::simd::any_length as plain;

            #[target_feature(enable = $features)]
            pub(in super::super) fn squared_of_bytes<const N: usize>(
                query: &[u8; N],
                rows: &[[u8; N]],
                out: &mut Vec<u32>,
            ) {
                plain::squared_of_bytes(query, rows, out);
            }

            #[target_feature(enable = $features)]
            pub(in super::super) fn squared_of_floats<const N: usize>(
                query: &[f32; N],
                rows: &[[f32; N]],
                out: &mut Vec<f32>,
            ) {
                plain::squared_of_floats(query, rows, out);
            }

            #[target_feature(enable = $features)]
            pub(in super::super) fn differing_bits<const N: usize>(
                query: &[u8; N],
                rows: &[[u8; N]],
                out: &mut Vec<u32>,
            ) {
                plain::differing_bits(query, rows, out);
            }
        }
    };
}

#[cfg(target_arch = "x86_64")]
compiled_for!(avx2, "avx2");
#[cfg(target_arch = "x86_64")]
compiled_for!(avx512, "avx512f,avx512vl,avx512dq,avx512bw,avx512vnni");
