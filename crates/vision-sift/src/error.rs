//! The error type of the crate.
//!
//! Every variant carries the value given and the bound that it broke. A picture without any keypoint is not an error.

/// Why an image or a parameter was refused.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SiftError {
    /// One side of the image is shorter than 16 pixels.
    #[error("image is {width}x{height} pixels, at least {minimum}x{minimum} needed")]
    ImageTooSmall {
        /// Width given, pixels.
        width: usize,
        /// Height given, pixels.
        height: usize,
        /// Smallest side accepted, pixels.
        minimum: usize,
    },
    /// One side of the image is longer than 32 767 pixels.
    #[error("image is {width}x{height} pixels, at most {maximum}x{maximum} accepted")]
    ImageTooLarge {
        /// Width given, pixels.
        width: usize,
        /// Height given, pixels.
        height: usize,
        /// Longest side accepted, pixels.
        maximum: usize,
    },
    /// Rows would overlap: the stride is less than the width.
    #[error("row stride is {stride} pixels, at least the width {width} needed")]
    StrideTooSmall {
        /// Stride given, pixels from row to row.
        stride: usize,
        /// Width given, pixels.
        width: usize,
    },
    /// The buffer ends before the last pixel.
    #[error("pixel buffer has {length} pixels, {required} needed")]
    BufferTooShort {
        /// Length given, pixels.
        length: usize,
        /// Length needed, pixels.
        required: usize,
    },
    /// A grey value is NaN or infinite.
    #[error("pixel ({x}, {y}) is {value}, a finite number needed")]
    PixelNotFinite {
        /// Column of the pixel.
        x: usize,
        /// Row of the pixel.
        y: usize,
        /// Its value.
        value: f32,
    },
    /// Colours of three bytes do not fill the buffer.
    #[error("{length} bytes are no whole number of colours, 3 bytes each")]
    ColourCount {
        /// Number of bytes given.
        length: usize,
    },
    /// The region has another size than the image.
    #[error("region is {}x{} pixels, the image {}x{}", given.0, given.1, needed.0, needed.1)]
    RegionSize {
        /// Width and height given, pixels.
        given: (usize, usize),
        /// Width and height of the image, pixels.
        needed: (usize, usize),
    },
    /// A parameter is outside its range (or not a number).
    #[error("parameter {name} is {value}, {}", range(*minimum, *maximum))]
    ParameterOutOfRange {
        /// Name of the field of [`crate::SiftParams`].
        name: &'static str,
        /// Value given.
        value: f64,
        /// Smallest value accepted.
        minimum: f64,
        /// Largest value accepted.
        maximum: f64,
    },
}

/// A range as a person writes it: the bounds of single precision with the digits they were written with.
fn range(minimum: f64, maximum: f64) -> String {
    let (least, most) = (minimum as f32, maximum as f32);
    if maximum == f64::MAX {
        format!("at least {least} required")
    } else {
        format!("{least} to {most} required")
    }
}

#[cfg(test)]
mod tests {
    use crate::params::SiftParams;

    #[test]
    fn ranges_read_as_a_person_writes_them() {
        let told = |change: fn(&mut SiftParams)| {
            let mut params = SiftParams::default();
            change(&mut params);
            params.check().unwrap_err().to_string()
        };
        assert_eq!(
            told(|p| p.camera_sigma = 0.75),
            "parameter camera_sigma is 0.75, 0 to 0.55 required"
        );
        assert_eq!(
            told(|p| p.contrast_threshold = 0.0),
            "parameter contrast_threshold is 0, 0.0001 to 1 required"
        );
        assert_eq!(
            told(|p| p.max_features = Some(0)),
            "parameter max_features is 0, at least 1 required"
        );
    }
}
