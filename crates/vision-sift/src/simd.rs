//! Sixteen `f32` lanes and the instruction set that runs them, chosen at run time.
//!
//! A stage writes its inner loops once, generic over [`Lanes`], as a [`Body`]; [`SimdLevel::run`] compiles it for each
//! instruction set and calls the one the processor has. All levels do the same IEEE operations on the same lanes in the
//! same order and none contracts a product and a sum into one rounding, so their results are equal bit for bit.
//!
//! [`Portable`] is plain arrays: the compiler makes SSE2 of it on any x86-64 and NEON on any aarch64. It is also the
//! oracle of the tests of the other levels.

#[cfg(target_arch = "x86_64")]
mod x86;

/// Lanes of one vector.
pub(crate) const LANES: usize = 16;

/// The values of one vector in memory.
pub(crate) type Run = [f32; LANES];

/// Instruction set of the inner loops. The results do not depend on it.
///
/// Only levels this processor has can be made, by [`SimdLevel::best`] or [`SimdLevel::available`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SimdLevel(Level);

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Level {
    Portable,
    #[cfg(target_arch = "x86_64")]
    Avx2,
    #[cfg(target_arch = "x86_64")]
    Avx512,
}

impl SimdLevel {
    /// What the build target always has: SSE2 on x86-64, NEON on aarch64.
    pub const PORTABLE: Self = Self(Level::Portable);

    /// The levels this processor has, the widest last.
    pub fn available() -> impl Iterator<Item = Self> {
        #[cfg(target_arch = "x86_64")]
        let wider = [
            x86::has_avx2().then_some(Self(Level::Avx2)),
            x86::has_avx512().then_some(Self(Level::Avx512)),
        ];
        #[cfg(not(target_arch = "x86_64"))]
        let wider: [Option<Self>; 0] = [];
        std::iter::once(Self::PORTABLE).chain(wider.into_iter().flatten())
    }

    /// The widest level this processor has.
    #[must_use]
    pub fn best() -> Self {
        Self::available().last().unwrap_or(Self::PORTABLE)
    }

    /// Runs `body` compiled for this level.
    #[inline]
    pub(crate) fn run<B: Body>(self, body: B) -> B::Output {
        match self.0 {
            Level::Portable => body.run::<Portable>(),
            #[cfg(target_arch = "x86_64")]
            Level::Avx2 => x86::run_avx2(body),
            #[cfg(target_arch = "x86_64")]
            Level::Avx512 => x86::run_avx512(body),
        }
    }
}

impl std::fmt::Display for SimdLevel {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self.0 {
            Level::Portable => "portable",
            #[cfg(target_arch = "x86_64")]
            Level::Avx2 => "AVX2",
            #[cfg(target_arch = "x86_64")]
            Level::Avx512 => "AVX-512",
        })
    }
}

/// A stage's inner loops. `run` must be `#[inline(always)]`, as must all it calls that uses `L`, and `L` must not be used
/// in closures (nor through `array::map` and the like): only then is the code compiled for the level.
pub(crate) trait Body {
    type Output;

    fn run<L: Lanes>(self) -> Self::Output;
}

/// Sixteen `f32` side by side.
pub(crate) trait Lanes: Copy {
    /// One truth value a lane.
    type Mask: Copy;

    fn splat(value: f32) -> Self;
    fn load(values: &Run) -> Self;
    fn store(self, values: &mut Run);
    fn add(self, other: Self) -> Self;
    fn sub(self, other: Self) -> Self;
    fn mul(self, other: Self) -> Self;
    fn div(self, other: Self) -> Self;
    fn sqrt(self) -> Self;
    /// `self < other ? self : other`.
    fn min(self, other: Self) -> Self;
    /// `self > other ? self : other`.
    fn max(self, other: Self) -> Self;
    fn abs(self) -> Self;
    /// The largest integer not above, for `|x| < 2^22`; a zero may have either sign.
    fn floor(self) -> Self;
    fn greater(self, other: Self) -> Self::Mask;
    fn greater_or_equal(self, other: Self) -> Self::Mask;
    fn and(a: Self::Mask, b: Self::Mask) -> Self::Mask;
    fn or(a: Self::Mask, b: Self::Mask) -> Self::Mask;
    /// `mask ? self : other`.
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self;
    /// Bit `i` is lane `i`.
    fn bits(mask: Self::Mask) -> u16;
    /// `rows[lane][k] = columns[k][lane]`.
    fn transpose(columns: [Self; 8], rows: &mut [[f32; 8]; LANES]);
}

/// Asks for the cache line of the first of `samples`, where the processor takes such hints; changes no value.
#[inline(always)]
pub(crate) fn prefetch(samples: &[f32]) {
    #[cfg(target_arch = "x86_64")]
    x86::prefetch(samples);
    #[cfg(not(target_arch = "x86_64"))]
    let _ = samples;
}

/// Lanes in an array.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Portable(Run);

/// A method of [`Portable`] lane by lane. Loops, not closures: closures are functions of their own, which the compiler
/// need not inline into vector code.
macro_rules! each_lane {
    ($(#[$doc:meta])* $name:ident($a:ident $(, $b:ident)?) -> $result:ty, $empty:expr, $value:expr) => {
        $(#[$doc])*
        #[inline(always)]
        fn $name(self $(, $b: Self)?) -> $result {
            let mut out = $empty;
            for i in 0..LANES {
                let $a = self.0[i];
                $(let $b = $b.0[i];)?
                out[i] = $value;
            }
            out.into()
        }
    };
}

impl From<Run> for Portable {
    #[inline(always)]
    fn from(values: Run) -> Self {
        Self(values)
    }
}

impl Lanes for Portable {
    type Mask = [bool; LANES];

    each_lane!(add(a, b) -> Self, [0.0; LANES], a + b);
    each_lane!(sub(a, b) -> Self, [0.0; LANES], a - b);
    each_lane!(mul(a, b) -> Self, [0.0; LANES], a * b);
    each_lane!(div(a, b) -> Self, [0.0; LANES], a / b);
    each_lane!(sqrt(a) -> Self, [0.0; LANES], a.sqrt());
    each_lane!(min(a, b) -> Self, [0.0; LANES], if a < b { a } else { b });
    each_lane!(max(a, b) -> Self, [0.0; LANES], if a > b { a } else { b });
    each_lane!(abs(a) -> Self, [0.0; LANES], a.abs());
    each_lane!(
        /// Adding `1.5 * 2^23` rounds to the nearest integer; one less where that is above. Unlike `f32::floor` this
        /// needs no library call on processors without a rounding instruction.
        floor(a) -> Self, [0.0; LANES], {
            let nearest = (a + 12_582_912.0) - 12_582_912.0;
            nearest - if nearest > a { 1.0 } else { 0.0 }
        }
    );
    each_lane!(greater(a, b) -> Self::Mask, [false; LANES], a > b);
    each_lane!(greater_or_equal(a, b) -> Self::Mask, [false; LANES], a >= b);

    #[inline(always)]
    fn splat(value: f32) -> Self {
        Self([value; LANES])
    }

    #[inline(always)]
    fn load(values: &Run) -> Self {
        Self(*values)
    }

    #[inline(always)]
    fn store(self, values: &mut Run) {
        *values = self.0;
    }

    #[inline(always)]
    fn and(a: Self::Mask, b: Self::Mask) -> Self::Mask {
        let mut out = a;
        for i in 0..LANES {
            out[i] &= b[i];
        }
        out
    }

    #[inline(always)]
    fn or(a: Self::Mask, b: Self::Mask) -> Self::Mask {
        let mut out = a;
        for i in 0..LANES {
            out[i] |= b[i];
        }
        out
    }

    #[inline(always)]
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self {
        let mut out = no;
        for i in 0..LANES {
            out.0[i] = if mask[i] { yes.0[i] } else { no.0[i] };
        }
        out
    }

    #[inline(always)]
    fn bits(mask: Self::Mask) -> u16 {
        let mut bits = 0;
        for (i, bit) in mask.iter().enumerate() {
            bits |= u16::from(*bit) << i;
        }
        bits
    }

    #[inline(always)]
    fn transpose(columns: [Self; 8], rows: &mut [[f32; 8]; LANES]) {
        for (lane, row) in rows.iter_mut().enumerate() {
            for (value, column) in row.iter_mut().zip(&columns) {
                *value = column.0[lane];
            }
        }
    }
}

/// The vector at `from` of a slice.
///
/// # Panics
/// If fewer than [`LANES`] values follow.
#[inline(always)]
pub(crate) fn load<L: Lanes>(values: &[f32], from: usize) -> L {
    L::load(run_at(&values[from..]))
}

/// Writes the vector at `from` of a slice.
///
/// # Panics
/// If fewer than [`LANES`] values follow.
#[inline(always)]
pub(crate) fn store<L: Lanes>(vector: L, values: &mut [f32], from: usize) {
    vector.store(
        values[from..]
            .first_chunk_mut()
            .expect("a run lies inside its slice"),
    );
}

#[inline(always)]
fn run_at(values: &[f32]) -> &Run {
    values.first_chunk().expect("a run lies inside its slice")
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
            let expected = SimdLevel::PORTABLE.run(Everything { a, b });
            for level in SimdLevel::available() {
                let got = level.run(Everything { a, b });
                let differs = got.iter().zip(&expected).position(|(g, e)| g != e);
                assert_eq!(differs, None, "{level}: {a:?} {b:?}");
            }
        }
    }

    #[test]
    fn portable_operations_are_those_of_one_value() {
        for (a, b) in inputs() {
            let (x, y) = (Portable(a), Portable(b));
            for i in 0..LANES {
                assert_eq!(x.floor().0[i], a[i].floor());
                assert_eq!(x.min(y).0[i], a[i].min(b[i]));
                assert_eq!(x.max(y).0[i], a[i].max(b[i]));
                assert_eq!(x.div(y).0[i].to_bits(), (a[i] / b[i]).to_bits());
                let bit = Portable::bits(x.greater(y)) >> i & 1;
                assert_eq!(bit == 1, a[i] > b[i]);
            }
        }
    }

    #[test]
    fn the_best_level_is_the_last_available() {
        assert_eq!(Some(SimdLevel::best()), SimdLevel::available().last());
        assert_eq!(
            SimdLevel::available().next(),
            Some(SimdLevel::PORTABLE),
            "{}",
            SimdLevel::best()
        );
    }
}
