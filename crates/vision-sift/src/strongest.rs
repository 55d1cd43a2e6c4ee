//! Selection of the strongest of many points.

/// Keeps the `limit` items of strongest response and leaves them sorted by `key`, which also decides between equal
/// responses: the lower key stays. O(n + limit log limit).
pub(crate) fn keep_strongest<T, K: Ord>(
    items: &mut Vec<T>,
    limit: usize,
    response: impl Fn(&T) -> f32,
    key: impl Fn(&T) -> K,
) {
    if items.len() <= limit {
        return;
    }
    items.select_nth_unstable_by(limit, |a, b| {
        response(b)
            .total_cmp(&response(a))
            .then_with(|| key(a).cmp(&key(b)))
    });
    items.truncate(limit);
    items.sort_unstable_by_key(key);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_strongest_stay_in_order_and_ties_go_to_the_lower_key() {
        let mut items = vec![(4, 1.0_f32), (1, 3.0), (3, 2.0), (0, 2.0), (2, 5.0)];
        keep_strongest(&mut items, 3, |item| item.1, |item| item.0);
        assert_eq!(items, [(0, 2.0), (1, 3.0), (2, 5.0)]);
        // A limit that nothing exceeds leaves the order as it was.
        let mut few = vec![(7, 1.0_f32), (5, 2.0)];
        keep_strongest(&mut few, 2, |item| item.1, |item| item.0);
        assert_eq!(few, [(7, 1.0), (5, 2.0)]);
    }
}
