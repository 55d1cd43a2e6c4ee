//! Numbers as people read them.

/// A length in millimetres below a metre, in metres above, with three digits.
pub(super) fn length(metres: f64) -> String {
    let size = metres.abs();
    if !size.is_finite() {
        "not finite".into()
    } else if size < 0.9995 {
        format!("{} mm", three_digits(1000.0 * metres))
    } else {
        format!("{} m", three_digits(metres))
    }
}

/// An angle in degrees with three digits.
pub(super) fn angle(radians: f64) -> String {
    format!("{}°", three_digits(radians.to_degrees()))
}

/// A duration in milliseconds, seconds or minutes.
pub(super) fn duration(seconds: f64) -> String {
    if seconds < 0.9995 {
        format!("{} ms", three_digits(1000.0 * seconds))
    } else if seconds < 120.0 {
        format!("{} s", three_digits(seconds))
    } else {
        format!(
            "{:.0} min {:02.0} s",
            (seconds / 60.0).floor(),
            (seconds % 60.0).floor()
        )
    }
}

/// Three significant digits without an exponent.
pub(super) fn three_digits(value: f64) -> String {
    let size = value.abs();
    if !size.is_finite() {
        return "not finite".into();
    }
    let decimals = if size >= 99.95 {
        0
    } else if size >= 9.995 {
        1
    } else if size >= 0.9995 || size == 0.0 {
        2
    } else {
        3
    };
    format!("{value:.decimals$}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_digits_are_kept() {
        assert_eq!(length(0.0274), "27.4 mm");
        assert_eq!(length(0.9999), "1.00 m");
        assert_eq!(length(12.345), "12.3 m");
        assert_eq!(length(f64::NAN), "not finite");
        assert_eq!(angle(std::f64::consts::PI), "180°");
        assert_eq!(duration(0.0351), "35.1 ms");
        assert_eq!(duration(59.0), "59.0 s");
        assert_eq!(duration(185.0), "3 min 05 s");
        assert_eq!(three_digits(0.0), "0.00");
    }
}
