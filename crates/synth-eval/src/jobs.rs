//! Independent jobs on all cores, each on one thread, results in the order of the jobs.
//!
//! The library's own parallel loops would take rayon's threads from each other and blur the
//! times: each job runs inside a pool of one thread instead. The most expensive job starts first.

use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Runs `job` on every item; `cost` orders the starts and nothing else.
///
/// # Errors
/// The first failed item's error, in the order of the items.
pub(crate) fn run<T: Sync, R: Send>(
    items: &[T],
    cost: impl Fn(&T) -> u32,
    job: impl Fn(&T) -> anyhow::Result<R> + Sync,
) -> anyhow::Result<Vec<R>> {
    let mut order: Vec<usize> = (0..items.len()).collect();
    order.sort_by_key(|&index| std::cmp::Reverse(cost(&items[index])));
    let workers = std::thread::available_parallelism().map_or(1, usize::from);
    let pools = (0..workers.min(items.len()))
        .map(|_| rayon::ThreadPoolBuilder::new().num_threads(1).build())
        .collect::<Result<Vec<_>, _>>()?;
    let next = AtomicUsize::new(0);
    let done = Mutex::new(Vec::with_capacity(items.len()));
    std::thread::scope(|scope| {
        for pool in &pools {
            scope.spawn(|| {
                while let Some(&index) = order.get(next.fetch_add(1, Ordering::Relaxed)) {
                    let result = pool.install(|| job(&items[index]));
                    done.lock()
                        .unwrap_or_else(std::sync::PoisonError::into_inner)
                        .push((index, result));
                }
            });
        }
    });
    let mut done = done
        .into_inner()
        .unwrap_or_else(std::sync::PoisonError::into_inner);
    done.sort_by_key(|(index, _)| *index);
    done.into_iter().map(|(_, result)| result).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use anyhow::ensure;

    #[test]
    fn results_keep_the_order_of_the_items_whatever_their_cost() {
        let items: Vec<u32> = (0..50).collect();
        let cost = |&item: &u32| item * 17 % 23;
        let doubled = run(&items, cost, |&item| Ok(2 * item)).unwrap();
        assert_eq!(doubled, (0..50).map(|item| 2 * item).collect::<Vec<_>>());
        assert!(run(&[], cost, |&item| Ok(item)).unwrap().is_empty());
    }

    #[test]
    fn a_job_has_one_thread_and_the_first_failed_item_is_told() {
        let threads = run(&[()], |()| 1, |()| Ok(rayon::current_num_threads())).unwrap();
        assert_eq!(threads, [1]);
        let failed = run(
            &[0, 1, 2, 3],
            |&item| item,
            |&item| {
                ensure!(item % 2 == 0, "item {item}");
                Ok(item)
            },
        );
        assert_eq!(failed.unwrap_err().to_string(), "item 1");
    }
}
