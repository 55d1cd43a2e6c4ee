//! The vector type that inner loops are written for, and how they are handed over.

/// The number of lanes in a vector.
pub(crate) const LANES: usize = 16;

/// The values of one vector in memory.
pub(crate) type Run = [f32; LANES];

/// The inner loops of a stage. `run` must be `#[inline(always)]`, as must all it calls that uses `L`, and `L` must not be used
/// in closures (nor through `array::map` and the like): only then is the code compiled for the level.
pub(crate) trait Body {
    type Output;

    fn run<L: Lanes>(self) -> Self::Output;
}

/// Sixteen `f32` side by side, and the IEEE operations on them.
pub(crate) trait Lanes: Copy {
    /// One truth value for each lane.
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
    /// The largest integer not above the value, for `|x| < 2^22`; a zero may have either sign.
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
