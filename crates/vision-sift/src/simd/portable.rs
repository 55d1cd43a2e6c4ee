//! Lanes as a plain array: the compiler makes SSE2 of it on any x86-64 and NEON on any aarch64.
//!
//! It is also the reference that the other levels are tested against.

use super::lanes::{LANES, Lanes, Run};

/// Sixteen lanes in an array.
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
