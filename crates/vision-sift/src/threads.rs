//! Loops over independent items, on several threads when the feature `parallel` is on.
//!
//! Each item is computed from shared, unchanging input and written to its own place, so the values cannot depend on the
//! number of threads or on the order of the work.

/// Calls `run(index, item)` for every item.
#[cfg(feature = "parallel")]
pub(crate) fn for_each_indexed<T: Send>(
    items: &mut [T],
    run: impl Fn(usize, &mut T) + Send + Sync,
) {
    use rayon::prelude::*;
    items
        .par_iter_mut()
        .enumerate()
        .for_each(|(i, item)| run(i, item));
}

/// Calls `run(index, item)` for every item.
#[cfg(not(feature = "parallel"))]
pub(crate) fn for_each_indexed<T>(items: &mut [T], run: impl Fn(usize, &mut T)) {
    for (i, item) in items.iter_mut().enumerate() {
        run(i, item);
    }
}

/// Calls `run(index, item, scratch)` for every item, with a scratch on whose contents the result must not depend.
#[cfg(feature = "parallel")]
pub(crate) fn for_each_with_scratch<T: Send, S>(
    items: &mut [T],
    scratch: impl Fn() -> S + Send + Sync,
    run: impl Fn(usize, &mut T, &mut S) + Send + Sync,
) {
    use rayon::prelude::*;
    items
        .par_iter_mut()
        .enumerate()
        .for_each_init(scratch, |scratch, (i, item)| run(i, item, scratch));
}

/// Calls `run(index, item, scratch)` for every item, with a scratch on whose contents the result must not depend.
#[cfg(not(feature = "parallel"))]
pub(crate) fn for_each_with_scratch<T, S>(
    items: &mut [T],
    scratch: impl Fn() -> S,
    run: impl Fn(usize, &mut T, &mut S),
) {
    let mut scratch = scratch();
    for (i, item) in items.iter_mut().enumerate() {
        run(i, item, &mut scratch);
    }
}

/// Calls `run(index, block, scratch)` for every block of `length` items (the last may be shorter), each with its own
/// part of the scratch.
#[cfg(feature = "parallel")]
pub(crate) fn for_each_block<T: Send>(
    items: &mut [T],
    length: usize,
    scratch: &mut [T],
    scratch_length: usize,
    run: impl Fn(usize, &mut [T], &mut [T]) + Send + Sync,
) {
    use rayon::prelude::*;
    items
        .par_chunks_mut(length)
        .zip(scratch.par_chunks_mut(scratch_length))
        .enumerate()
        .for_each(|(i, (block, scratch))| run(i, block, scratch));
}

/// Calls `run(index, block, scratch)` for every block of `length` items (the last may be shorter), each with its own
/// part of the scratch.
#[cfg(not(feature = "parallel"))]
pub(crate) fn for_each_block<T>(
    items: &mut [T],
    length: usize,
    scratch: &mut [T],
    scratch_length: usize,
    run: impl Fn(usize, &mut [T], &mut [T]),
) {
    let blocks = items
        .chunks_mut(length)
        .zip(scratch.chunks_mut(scratch_length));
    for (i, (block, scratch)) in blocks.enumerate() {
        run(i, block, scratch);
    }
}
