//! Ticks at round numbers.

/// Round numbers (1, 2 or 5 times a power of ten apart) inside `[low, high]`, about `wanted` of them.
///
/// Empty when the range is not a finite interval of positive length.
pub(super) fn nice_ticks(low: f64, high: f64, wanted: usize) -> Vec<f64> {
    let span = high - low;
    if !(span.is_finite() && span > 0.0) || wanted == 0 {
        return Vec::new();
    }
    let raw = span / wanted as f64;
    let power = 10_f64.powf(raw.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0]
        .into_iter()
        .map(|factor| factor * power)
        .find(|&step| step >= raw * 0.999)
        .unwrap_or(10.0 * power);
    let (first, last) = ((low / step - 1e-9).ceil(), (high / step + 1e-9).floor());
    // A range far from zero and narrower than its rounding has no distinct ticks.
    let steps = last - first;
    if step <= 0.0 || !steps.is_finite() || steps > 1000.0 {
        return Vec::new();
    }
    let count = (last - first).max(-1.0) as i64;
    (0..=count)
        .map(|index| (first + index as f64) * step)
        .collect()
}

/// A tick in as few digits as tell it from its neighbours `step` away.
pub(super) fn tick_label(value: f64, step: f64) -> String {
    if value.abs() < 1e-9 * step.abs() {
        return "0".into();
    }
    let decimals = (-(step.abs() * 1.0001).log10().floor()).clamp(0.0, 12.0) as usize;
    let text = format!("{value:.decimals$}");
    if text.len() > 9 {
        format!("{value:.2e}")
    } else {
        text.replace('-', "\u{2212}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_inside() {
        assert_eq!(nice_ticks(0.0, 10.0, 5), [0.0, 2.0, 4.0, 6.0, 8.0, 10.0]);
        assert_eq!(nice_ticks(-0.3, 0.3, 3), [-0.2, 0.0, 0.2]);
        assert_eq!(nice_ticks(97.0, 311.0, 4), [100.0, 200.0, 300.0]);
        for range in [
            (1.0, 1.0),
            (2.0, 1.0),
            (f64::NAN, 1.0),
            (0.0, f64::INFINITY),
        ] {
            assert!(nice_ticks(range.0, range.1, 5).is_empty());
        }
        assert!(nice_ticks(0.0, 1e-300, 5).len() < 20);
        assert!(nice_ticks(1e16, 1e16 + 4.0, 5).len() < 20);
    }

    #[test]
    fn labels_are_short() {
        assert_eq!(tick_label(0.2, 0.1), "0.2");
        assert_eq!(tick_label(-2.0, 1.0), "\u{2212}2");
        assert_eq!(tick_label(0.05, 0.05), "0.05");
        assert_eq!(tick_label(3e-17, 0.5), "0");
        assert_eq!(tick_label(1500.0, 500.0), "1500");
    }
}
