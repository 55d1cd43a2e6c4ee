//! Numbers in messages, as a person writes them.
//!
//! `{}` of Rust writes every digit of a number and never an exponent: the largest double takes 309 characters, and the
//! result of a computation 17. [`Readable`] writes what can be read: a number of at most nine digits as it is, one of more rounded
//! to six, with an exponent where it would begin with four zeros or run to eight digits before the point.

use core::fmt::{self, Write};

/// A number to be read: `Readable(f64::MAX)` is "1.79769e308", `Readable(0.1 + 0.2)` is "0.3".
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Readable(pub f64);

/// Digits that are written as they are; more come from a computation.
const EXACT_DIGITS: usize = 9;
/// Digits after the first to which longer numbers are rounded.
const DECIMALS: usize = 5;
/// Largest number of digits before the point.
const WHOLE_DIGITS: i32 = 7;
/// Least exponent without one being written.
const SMALLEST_EXPONENT: i32 = -4;

impl fmt::Display for Readable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let value = self.0;
        if value == 0.0 || !value.is_finite() {
            // 0 for both zeros
            return write!(f, "{}", if value == 0.0 { 0.0 } else { value });
        }
        let mut text = Buffer::default();
        write!(text, "{value:e}")?;
        let (mantissa, _) = text.parts();
        if mantissa.bytes().filter(u8::is_ascii_digit).count() > EXACT_DIGITS {
            text = Buffer::default();
            write!(text, "{value:.DECIMALS$e}")?;
        }
        let (mantissa, exponent) = text.parts();
        let mantissa = trimmed(mantissa);
        if !(SMALLEST_EXPONENT..WHOLE_DIGITS).contains(&exponent) {
            return write!(f, "{mantissa}e{exponent}");
        }
        let digits = mantissa.bytes().filter(u8::is_ascii_digit).count();
        let shown = i32::try_from(digits).unwrap_or(0) - 1 - exponent;
        let decimals = usize::try_from(shown).unwrap_or(0);
        write!(f, "{value:.decimals$}")
    }
}

/// Without the zeros at the end, and without a point at the end.
fn trimmed(mantissa: &str) -> &str {
    if mantissa.contains('.') {
        mantissa.trim_end_matches('0').trim_end_matches('.')
    } else {
        mantissa
    }
}

/// Room for a number with an exponent.
#[derive(Default)]
struct Buffer {
    bytes: [u8; 32],
    length: usize,
}

impl Buffer {
    /// Mantissa and exponent.
    fn parts(&self) -> (&str, i32) {
        let text = core::str::from_utf8(&self.bytes[..self.length]).unwrap_or("");
        let (mantissa, exponent) = text.split_once('e').unwrap_or((text, "0"));
        (mantissa, exponent.parse().unwrap_or(0))
    }
}

impl Write for Buffer {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        let end = self.length + text.len();
        let room = self.bytes.get_mut(self.length..end).ok_or(fmt::Error)?;
        room.copy_from_slice(text.as_bytes());
        self.length = end;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use std::string::ToString;

    #[test]
    fn numbers_read_as_a_person_writes_them() {
        for (value, text) in [
            (0.0, "0"),
            (-0.0, "0"),
            (1.0, "1"),
            (-3.5, "-3.5"),
            (0.1 + 0.2, "0.3"),
            (1.0 / 3.0, "0.333333"),
            (0.999_999_9, "0.9999999"),
            (2.0 / 3.0 * 1e-3, "0.000666667"),
            (1.25e-7, "1.25e-7"),
            (1e-4, "0.0001"),
            (1e-5, "1e-5"),
            (120.0, "120"),
            (4096.5, "4096.5"),
            (1e6, "1000000"),
            (1e7, "1e7"),
            (12_345_678.9, "1.23456789e7"),
            (f64::MAX, "1.79769e308"),
            (f64::MIN_POSITIVE, "2.22507e-308"),
            (5e-324, "5e-324"),
            (core::f64::consts::PI, "3.14159"),
            (99.999_999_999_9, "100"),
            (f64::INFINITY, "inf"),
            (f64::NEG_INFINITY, "-inf"),
        ] {
            assert_eq!(Readable(value).to_string(), text);
        }
        assert_eq!(Readable(f64::NAN).to_string(), "NaN");
    }
}
