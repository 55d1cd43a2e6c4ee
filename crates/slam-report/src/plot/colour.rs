//! Colours that follow the page: CSS variables with fallbacks for files of their own.

use std::fmt;

/// A colour of the palette, or a place on the uncertainty scale.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Colour {
    /// Text and strong lines.
    Ink,
    /// Quiet lines.
    Grey,
    /// The estimate.
    Blue,
    /// Dead reckoning, warnings.
    Orange,
    /// The reference, things that went well.
    Green,
    /// Rejected, wrong.
    Red,
    /// Second quantity in a plot.
    Purple,
    /// Third quantity in a plot.
    Teal,
    /// Fourth quantity in a plot.
    Yellow,
    /// Uncertainty from 0 (certain, teal) to 1 (uncertain, red).
    Scale(f64),
}

/// Stops of the uncertainty scale.
const SCALE: [[f64; 3]; 4] = [
    [13.0, 148.0, 136.0],
    [101.0, 163.0, 63.0],
    [234.0, 168.0, 40.0],
    [220.0, 60.0, 50.0],
];

impl fmt::Display for Colour {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (name, fallback) = match self {
            Colour::Ink => ("ink", "#1b2430"),
            Colour::Grey => ("grey", "#8a94a3"),
            Colour::Blue => ("blue", "#2563eb"),
            Colour::Orange => ("orange", "#e07b1a"),
            Colour::Green => ("green", "#15935f"),
            Colour::Red => ("red", "#d6344a"),
            Colour::Purple => ("purple", "#7c4ddb"),
            Colour::Teal => ("teal", "#0d9aa5"),
            Colour::Yellow => ("yellow", "#d9a400"),
            Colour::Scale(share) => {
                let place = share.clamp(0.0, 1.0) * (SCALE.len() - 1) as f64;
                let from = (place as usize).min(SCALE.len() - 2);
                let blend = place - from as f64;
                let channel = |index: usize| {
                    (SCALE[from][index] * (1.0 - blend) + SCALE[from + 1][index] * blend).round()
                        as u8
                };
                return write!(
                    formatter,
                    "#{:02x}{:02x}{:02x}",
                    channel(0),
                    channel(1),
                    channel(2)
                );
            }
        };
        write!(formatter, "var(--{name},{fallback})")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_are_css() {
        assert_eq!(Colour::Blue.to_string(), "var(--blue,#2563eb)");
        assert_eq!(Colour::Scale(0.0).to_string(), "#0d9488");
        assert_eq!(Colour::Scale(1.0).to_string(), "#dc3c32");
        assert_eq!(Colour::Scale(7.0).to_string(), "#dc3c32");
        assert_eq!(Colour::Scale(f64::NAN).to_string().len(), 7);
    }
}
