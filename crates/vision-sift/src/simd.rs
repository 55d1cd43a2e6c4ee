//! Sixteen `f32` lanes and the instruction set that runs them, chosen at run time.
//!
//! A stage writes its inner loops once, generic over [`Lanes`], as a [`Body`]; [`run`] compiles it for each level of
//! instructions and calls the one wanted. All levels do the same IEEE operations on the same lanes in the same order, and
//! none contracts a product and a sum into one rounding, so their results are equal bit for bit.

mod lanes;
mod portable;
#[cfg(target_arch = "x86_64")]
mod x86;

use simd_level::SimdLevel;

pub(crate) use lanes::{Body, LANES, Lanes, Run, load, store};
pub(crate) use portable::Portable;

/// Runs `body` compiled for `level`.
#[inline]
pub(crate) fn run<B: Body>(level: SimdLevel, body: B) -> B::Output {
    match level {
        SimdLevel::Portable => body.run::<Portable>(),
        #[cfg(target_arch = "x86_64")]
        SimdLevel::Avx2(detected) => x86::run_avx2(detected, body),
        #[cfg(target_arch = "x86_64")]
        SimdLevel::Avx512(detected) => x86::run_avx512(detected, body),
    }
}

/// Asks for the cache line of the first of `samples`, where the processor takes such hints; changes no value.
#[inline(always)]
pub(crate) fn prefetch(samples: &[f32]) {
    #[cfg(target_arch = "x86_64")]
    x86::prefetch(samples);
    #[cfg(not(target_arch = "x86_64"))]
    let _ = samples;
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every operation of the trait on one pair of runs, as bits.
    struct Everything {
        a: Run,
        b: Run,
    }

    impl Body for Everything {
        type Output = Vec<u32>;

        #[inline(always)]
        fn run<L: Lanes>(self) -> Vec<u32> {
            let (a, b) = (L::load(&self.a), L::load(&self.b));
            let (gt, ge) = (a.greater(b), a.greater_or_equal(b));
            let vectors = [
                L::splat(self.a[3]),
                a.add(b),
                a.sub(b),
                a.mul(b),
                a.div(b),
                a.abs().sqrt(),
                a.min(b),
                a.max(b),
                a.abs(),
                a.floor().add(L::splat(0.0)),
                b.floor().add(L::splat(0.0)),
                L::select(gt, a, b),
                L::select(ge, a, b),
                L::select(L::and(ge, b.greater(a)), a, b),
                L::select(L::or(ge, b.greater(a)), a, b),
            ];
            let mut out = vec![u32::from(L::bits(gt)), u32::from(L::bits(ge))];
            for vector in vectors {
                let mut run = [0.0; LANES];
                vector.store(&mut run);
                out.extend(run.map(f32::to_bits));
            }
            let columns = std::array::from_fn(|k| vectors[k]);
            let mut rows = [[0.0; 8]; LANES];
            L::transpose(columns, &mut rows);
            out.extend(rows.iter().flatten().map(|v| v.to_bits()));
            out
        }
    }

    fn inputs() -> Vec<(Run, Run)> {
        let mut state = 1_u32;
        let mut next = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            ((state >> 8) as f32 / (1 << 24) as f32 - 0.5) * 64.0
        };
        let mut runs: Vec<(Run, Run)> = (0..200)
            .map(|_| {
                (
                    std::array::from_fn(|_| next()),
                    std::array::from_fn(|_| next()),
                )
            })
            .collect();
        // Integers, halves, ties, zeros of both signs.
        let nasty: Run = std::array::from_fn(|i| (i as f32 - 8.0) * 0.5);
        let mut other = nasty;
        other.rotate_left(3);
        other[7] = -0.0;
        runs.extend([(nasty, nasty), (nasty, other), (other, nasty)]);
        runs
    }

    #[test]
    fn every_level_equals_the_portable_one_bit_for_bit() {
        for (a, b) in inputs() {
            let expected = run(SimdLevel::Portable, Everything { a, b });
            for level in SimdLevel::available() {
                let got = run(level, Everything { a, b });
                let differs = got.iter().zip(&expected).position(|(g, e)| g != e);
                assert_eq!(differs, None, "{level}: {a:?} {b:?}");
            }
        }
    }

    #[test]
    fn portable_operations_are_those_of_one_value() {
        let stored = |vector: Portable| {
            let mut run = [0.0; LANES];
            vector.store(&mut run);
            run
        };
        for (a, b) in inputs() {
            let (x, y) = (Portable::load(&a), Portable::load(&b));
            let (floor, quotient) = (stored(x.floor()), stored(x.div(y)));
            let (least, most) = (stored(x.min(y)), stored(x.max(y)));
            let greater = Portable::bits(x.greater(y));
            for i in 0..LANES {
                assert_eq!(floor[i], a[i].floor());
                assert_eq!(least[i], a[i].min(b[i]));
                assert_eq!(most[i], a[i].max(b[i]));
                assert_eq!(quotient[i].to_bits(), (a[i] / b[i]).to_bits());
                assert_eq!(greater >> i & 1 == 1, a[i] > b[i]);
            }
        }
    }
}
