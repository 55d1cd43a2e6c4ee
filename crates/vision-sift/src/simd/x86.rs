//! AVX2 and AVX-512 forms of [`Lanes`], and the two calls that enter code compiled for them.
//!
//! Safety of the whole module: the intrinsics need a processor that has them. The types here are private to it and only
//! reach a [`Body`] through [`run_avx2`] and [`run_avx512`], which take the proof that the instructions were found at run
//! time. Loads and stores go through references to arrays of the right length. The tests of the parent module compare every
//! operation with the portable form.
#![expect(unsafe_code, reason = "vector instructions found at run time")]

use std::arch::x86_64::*;

use simd_level::Detected;

use super::lanes::{Body, LANES, Lanes, Run};

/// Asks for the cache line of `samples[0]`; every x86-64 processor can.
#[inline(always)]
pub(super) fn prefetch(samples: &[f32]) {
    // SAFETY: a prefetch reads nothing and faults on no address; the instruction is SSE, part of x86-64.
    unsafe { _mm_prefetch::<_MM_HINT_T0>(samples.as_ptr().cast()) };
}

/// Runs `body` with AVX2.
#[inline]
pub(super) fn run_avx2<B: Body>(_: Detected<256>, body: B) -> B::Output {
    #[target_feature(enable = "avx2")]
    fn inner<B: Body>(body: B) -> B::Output {
        body.run::<Avx2>()
    }
    // SAFETY: `Detected<256>` exists only where the processor has AVX2.
    unsafe { inner(body) }
}

/// Runs `body` with AVX-512.
#[inline]
pub(super) fn run_avx512<B: Body>(_: Detected<512>, body: B) -> B::Output {
    #[target_feature(enable = "avx512f,avx512vl,avx512dq,avx512bw")]
    fn inner<B: Body>(body: B) -> B::Output {
        body.run::<Avx512>()
    }
    // SAFETY: `Detected<512>` exists only where the processor has these sets of AVX-512.
    unsafe { inner(body) }
}

/// Two registers of eight lanes.
#[derive(Clone, Copy)]
struct Avx2(__m256, __m256);

/// One register of sixteen lanes.
#[derive(Clone, Copy)]
struct Avx512(__m512);

/// A method of [`Avx2`] that does the same to both registers.
macro_rules! both {
    ($name:ident($a:ident $(, $b:ident)?) $intrinsic:expr) => {
        #[inline(always)]
        fn $name(self $(, $b: Self)?) -> Self {
            let $a = self;
            // SAFETY: see the module.
            unsafe { Self($intrinsic($a.0 $(, $b.0)?), $intrinsic($a.1 $(, $b.1)?)) }
        }
    };
}

impl Lanes for Avx2 {
    type Mask = (__m256, __m256);

    both!(add(a, b) _mm256_add_ps);
    both!(sub(a, b) _mm256_sub_ps);
    both!(mul(a, b) _mm256_mul_ps);
    both!(div(a, b) _mm256_div_ps);
    both!(sqrt(a) _mm256_sqrt_ps);
    both!(min(a, b) _mm256_min_ps);
    both!(max(a, b) _mm256_max_ps);
    both!(floor(a) _mm256_floor_ps);

    #[inline(always)]
    fn splat(value: f32) -> Self {
        // SAFETY: see the module.
        let register = unsafe { _mm256_set1_ps(value) };
        Self(register, register)
    }

    #[inline(always)]
    fn load(values: &Run) -> Self {
        let (low, high) = values.split_at(8);
        // SAFETY: see the module; both halves hold eight values.
        unsafe {
            Self(
                _mm256_loadu_ps(low.as_ptr()),
                _mm256_loadu_ps(high.as_ptr()),
            )
        }
    }

    #[inline(always)]
    fn store(self, values: &mut Run) {
        let (low, high) = values.split_at_mut(8);
        // SAFETY: see the module; both halves hold eight values.
        unsafe {
            _mm256_storeu_ps(low.as_mut_ptr(), self.0);
            _mm256_storeu_ps(high.as_mut_ptr(), self.1);
        }
    }

    #[inline(always)]
    fn abs(self) -> Self {
        // SAFETY: see the module.
        unsafe {
            let sign = _mm256_set1_ps(-0.0);
            Self(
                _mm256_andnot_ps(sign, self.0),
                _mm256_andnot_ps(sign, self.1),
            )
        }
    }

    #[inline(always)]
    fn greater(self, other: Self) -> Self::Mask {
        // SAFETY: see the module.
        unsafe {
            (
                _mm256_cmp_ps::<_CMP_GT_OQ>(self.0, other.0),
                _mm256_cmp_ps::<_CMP_GT_OQ>(self.1, other.1),
            )
        }
    }

    #[inline(always)]
    fn greater_or_equal(self, other: Self) -> Self::Mask {
        // SAFETY: see the module.
        unsafe {
            (
                _mm256_cmp_ps::<_CMP_GE_OQ>(self.0, other.0),
                _mm256_cmp_ps::<_CMP_GE_OQ>(self.1, other.1),
            )
        }
    }

    #[inline(always)]
    fn and(a: Self::Mask, b: Self::Mask) -> Self::Mask {
        // SAFETY: see the module.
        unsafe { (_mm256_and_ps(a.0, b.0), _mm256_and_ps(a.1, b.1)) }
    }

    #[inline(always)]
    fn or(a: Self::Mask, b: Self::Mask) -> Self::Mask {
        // SAFETY: see the module.
        unsafe { (_mm256_or_ps(a.0, b.0), _mm256_or_ps(a.1, b.1)) }
    }

    #[inline(always)]
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self {
        // SAFETY: see the module.
        unsafe {
            Self(
                _mm256_blendv_ps(no.0, yes.0, mask.0),
                _mm256_blendv_ps(no.1, yes.1, mask.1),
            )
        }
    }

    #[inline(always)]
    fn bits(mask: Self::Mask) -> u16 {
        // SAFETY: see the module.
        let (low, high) = unsafe { (_mm256_movemask_ps(mask.0), _mm256_movemask_ps(mask.1)) };
        (low | high << 8) as u16
    }

    #[inline(always)]
    fn transpose(columns: [Self; 8], rows: &mut [[f32; 8]; LANES]) {
        let (low, high) = rows.split_at_mut(8);
        // SAFETY: see the module; each row holds eight values.
        unsafe {
            let [a, b, c, d, e, f, g, h] = columns;
            let registers = transposed([a.0, b.0, c.0, d.0, e.0, f.0, g.0, h.0]);
            for (row, register) in low.iter_mut().zip(registers) {
                _mm256_storeu_ps(row.as_mut_ptr(), register);
            }
            let registers = transposed([a.1, b.1, c.1, d.1, e.1, f.1, g.1, h.1]);
            for (row, register) in high.iter_mut().zip(registers) {
                _mm256_storeu_ps(row.as_mut_ptr(), register);
            }
        }
    }
}

/// The transpose of eight rows of eight: pairs, then fours, then halves are exchanged.
///
/// # Safety
/// Needs AVX.
#[inline(always)]
unsafe fn transposed(r: [__m256; 8]) -> [__m256; 8] {
    // SAFETY: of the caller.
    unsafe {
        let a0 = _mm256_unpacklo_ps(r[0], r[1]);
        let a1 = _mm256_unpackhi_ps(r[0], r[1]);
        let b0 = _mm256_unpacklo_ps(r[2], r[3]);
        let b1 = _mm256_unpackhi_ps(r[2], r[3]);
        let c0 = _mm256_unpacklo_ps(r[4], r[5]);
        let c1 = _mm256_unpackhi_ps(r[4], r[5]);
        let d0 = _mm256_unpacklo_ps(r[6], r[7]);
        let d1 = _mm256_unpackhi_ps(r[6], r[7]);
        let e0 = _mm256_shuffle_ps::<0b01_00_01_00>(a0, b0);
        let e1 = _mm256_shuffle_ps::<0b11_10_11_10>(a0, b0);
        let e2 = _mm256_shuffle_ps::<0b01_00_01_00>(a1, b1);
        let e3 = _mm256_shuffle_ps::<0b11_10_11_10>(a1, b1);
        let f0 = _mm256_shuffle_ps::<0b01_00_01_00>(c0, d0);
        let f1 = _mm256_shuffle_ps::<0b11_10_11_10>(c0, d0);
        let f2 = _mm256_shuffle_ps::<0b01_00_01_00>(c1, d1);
        let f3 = _mm256_shuffle_ps::<0b11_10_11_10>(c1, d1);
        [
            _mm256_permute2f128_ps::<0x20>(e0, f0),
            _mm256_permute2f128_ps::<0x20>(e1, f1),
            _mm256_permute2f128_ps::<0x20>(e2, f2),
            _mm256_permute2f128_ps::<0x20>(e3, f3),
            _mm256_permute2f128_ps::<0x31>(e0, f0),
            _mm256_permute2f128_ps::<0x31>(e1, f1),
            _mm256_permute2f128_ps::<0x31>(e2, f2),
            _mm256_permute2f128_ps::<0x31>(e3, f3),
        ]
    }
}

/// A method of [`Avx512`] that is one intrinsic.
macro_rules! one {
    ($name:ident($a:ident $(, $b:ident)?) $intrinsic:expr) => {
        #[inline(always)]
        fn $name(self $(, $b: Self)?) -> Self {
            let $a = self;
            // SAFETY: see the module.
            unsafe { Self($intrinsic($a.0 $(, $b.0)?)) }
        }
    };
}

impl Lanes for Avx512 {
    type Mask = __mmask16;

    one!(add(a, b) _mm512_add_ps);
    one!(sub(a, b) _mm512_sub_ps);
    one!(mul(a, b) _mm512_mul_ps);
    one!(div(a, b) _mm512_div_ps);
    one!(sqrt(a) _mm512_sqrt_ps);
    one!(min(a, b) _mm512_min_ps);
    one!(max(a, b) _mm512_max_ps);
    one!(abs(a) _mm512_abs_ps);
    one!(floor(a) _mm512_roundscale_ps::<{ _MM_FROUND_TO_NEG_INF | _MM_FROUND_NO_EXC }>);

    #[inline(always)]
    fn splat(value: f32) -> Self {
        // SAFETY: see the module.
        unsafe { Self(_mm512_set1_ps(value)) }
    }

    #[inline(always)]
    fn load(values: &Run) -> Self {
        // SAFETY: see the module.
        unsafe { Self(_mm512_loadu_ps(values.as_ptr())) }
    }

    #[inline(always)]
    fn store(self, values: &mut Run) {
        // SAFETY: see the module.
        unsafe { _mm512_storeu_ps(values.as_mut_ptr(), self.0) }
    }

    #[inline(always)]
    fn greater(self, other: Self) -> Self::Mask {
        // SAFETY: see the module.
        unsafe { _mm512_cmp_ps_mask::<_CMP_GT_OQ>(self.0, other.0) }
    }

    #[inline(always)]
    fn greater_or_equal(self, other: Self) -> Self::Mask {
        // SAFETY: see the module.
        unsafe { _mm512_cmp_ps_mask::<_CMP_GE_OQ>(self.0, other.0) }
    }

    #[inline(always)]
    fn and(a: Self::Mask, b: Self::Mask) -> Self::Mask {
        a & b
    }

    #[inline(always)]
    fn or(a: Self::Mask, b: Self::Mask) -> Self::Mask {
        a | b
    }

    #[inline(always)]
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self {
        // SAFETY: see the module.
        unsafe { Self(_mm512_mask_blend_ps(mask, no.0, yes.0)) }
    }

    #[inline(always)]
    fn bits(mask: Self::Mask) -> u16 {
        mask
    }

    #[inline(always)]
    fn transpose(columns: [Self; 8], rows: &mut [[f32; 8]; LANES]) {
        let [a, b, c, d, e, f, g, h] = columns;
        let halves = [
            a.halves(),
            b.halves(),
            c.halves(),
            d.halves(),
            e.halves(),
            f.halves(),
            g.halves(),
            h.halves(),
        ];
        Avx2::transpose(halves, rows);
    }
}

impl Avx512 {
    #[inline(always)]
    fn halves(self) -> Avx2 {
        // SAFETY: see the module.
        unsafe {
            Avx2(
                _mm512_castps512_ps256(self.0),
                _mm512_extractf32x8_ps::<1>(self.0),
            )
        }
    }
}
