//! One loop over independent items, on several threads when the feature `parallel` is on.
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
