//! Pixels of an image message in one of three plain layouts.
//!
//! The encodings are those of `sensor_msgs/image_encodings.h`. Colour filters (`bayer_*`) become colour by the mean of
//! the nearest samples of each colour; of YUV images the luma is taken; an alpha channel is dropped.

use crate::message::Image;

/// Pixels row by row from the top left, without gaps.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Pixels {
    /// One byte a pixel.
    Grey8(Vec<u8>),
    /// One number a pixel.
    Grey16(Vec<u16>),
    /// Red, green, blue.
    Rgb8(Vec<u8>),
}

/// Why an image message has no pixels.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum PixelError {
    /// An encoding that is not read.
    #[error(
        "expected an image encoded as mono8, mono16, rgb8, bgr8, rgba8, bgra8, 8UC1, 8UC3, 8UC4, 16UC1, bayer_*8, \
         bayer_*16 or yuv422, found {found:?}"
    )]
    Encoding {
        /// The name in the message.
        found: String,
    },
    /// Fewer bytes than width, height and step ask for.
    #[error(
        "expected a {width}x{height} image ({encoding}) in rows of {step} bytes, found {found} bytes"
    )]
    Size {
        /// Columns.
        width: u32,
        /// Rows.
        height: u32,
        /// Name of the encoding.
        encoding: String,
        /// Bytes from one row to the next.
        step: u32,
        /// Bytes in the message.
        found: usize,
    },
}

/// The arrangement of the samples of a pixel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Layout {
    Grey8,
    Grey16,
    /// Bytes a pixel, then the places of red, green and blue in it.
    Colour(usize, [usize; 3]),
    /// Column and row parity of red; whether samples have two bytes.
    Bayer(usize, usize, bool),
    /// Two bytes a pixel; place of the luma.
    Yuv(usize),
}

impl Layout {
    fn of(encoding: &str) -> Option<Self> {
        Some(match encoding {
            "mono8" | "8UC1" => Self::Grey8,
            "mono16" | "16UC1" => Self::Grey16,
            "rgb8" => Self::Colour(3, [0, 1, 2]),
            "bgr8" | "8UC3" => Self::Colour(3, [2, 1, 0]),
            "rgba8" => Self::Colour(4, [0, 1, 2]),
            "bgra8" | "8UC4" => Self::Colour(4, [2, 1, 0]),
            "yuv422" | "uyvy" => Self::Yuv(1),
            "yuv422_yuy2" | "yuyv" => Self::Yuv(0),
            other => {
                let pattern = other.strip_prefix("bayer_")?;
                let (pattern, wide) = match pattern.strip_suffix("16") {
                    Some(pattern) => (pattern, true),
                    None => (pattern.strip_suffix('8')?, false),
                };
                match pattern {
                    "rggb" => Self::Bayer(0, 0, wide),
                    "grbg" => Self::Bayer(1, 0, wide),
                    "gbrg" => Self::Bayer(0, 1, wide),
                    "bggr" => Self::Bayer(1, 1, wide),
                    _ => return None,
                }
            }
        })
    }

    fn pixel_bytes(self) -> usize {
        match self {
            Self::Grey8 | Self::Bayer(.., false) => 1,
            Self::Grey16 | Self::Yuv(_) | Self::Bayer(.., true) => 2,
            Self::Colour(bytes, _) => bytes,
        }
    }
}

impl Image {
    /// The pixels, `width * height` of them. Time O(pixels).
    ///
    /// # Errors
    /// [`PixelError`] when the encoding is not read or the message holds fewer bytes than its size asks for.
    pub fn pixels(&self) -> Result<Pixels, PixelError> {
        let layout = Layout::of(&self.encoding).ok_or_else(|| PixelError::Encoding {
            found: self.encoding.chars().take(40).collect(),
        })?;
        let rows = self.rows(layout).ok_or_else(|| PixelError::Size {
            width: self.width,
            height: self.height,
            encoding: self.encoding.clone(),
            step: self.step,
            found: self.data.len(),
        })?;
        Ok(match layout {
            Layout::Grey8 => Pixels::Grey8(rows.concat()),
            Layout::Grey16 => Pixels::Grey16(
                rows.iter()
                    .flat_map(|row| row.chunks_exact(2))
                    .map(|pair| self.wide(pair))
                    .collect(),
            ),
            Layout::Colour(bytes, places) => Pixels::Rgb8(
                rows.iter()
                    .flat_map(|row| row.chunks_exact(bytes))
                    .flat_map(|pixel| places.map(|place| pixel[place]))
                    .collect(),
            ),
            Layout::Yuv(luma) => Pixels::Grey8(
                rows.iter()
                    .flat_map(|row| row.chunks_exact(2))
                    .map(|pixel| pixel[luma])
                    .collect(),
            ),
            Layout::Bayer(column, row, false) => Pixels::Rgb8(demosaic(&rows, column, row)),
            Layout::Bayer(column, row, true) => {
                // The high bytes keep the pattern; the eye and the detector lose nothing by it.
                let high: Vec<Vec<u8>> = rows
                    .iter()
                    .map(|row| {
                        row.chunks_exact(2)
                            .map(|pair| self.wide(pair).to_be_bytes()[0])
                            .collect()
                    })
                    .collect();
                let rows: Vec<&[u8]> = high.iter().map(Vec::as_slice).collect();
                Pixels::Rgb8(demosaic(&rows, column, row))
            }
        })
    }

    /// The rows without the bytes behind their last pixel; `None` where the data are too short.
    fn rows(&self, layout: Layout) -> Option<Vec<&[u8]>> {
        let (width, height) = (
            usize::try_from(self.width).ok()?,
            usize::try_from(self.height).ok()?,
        );
        let used = width.checked_mul(layout.pixel_bytes())?;
        let step = match usize::try_from(self.step).ok()? {
            // Some drivers leave it out.
            0 => used,
            step => step,
        };
        let needed = step
            .checked_mul(height.checked_sub(1)?)?
            .checked_add(used)?;
        if used == 0 || step < used || needed > self.data.len() {
            return None;
        }
        Some(
            self.data
                .chunks(step)
                .take(height)
                .map(|row| &row[..used])
                .collect(),
        )
    }

    fn wide(&self, pair: &[u8]) -> u16 {
        if self.big_endian {
            u16::from_be_bytes([pair[0], pair[1]])
        } else {
            u16::from_le_bytes([pair[0], pair[1]])
        }
    }
}

/// Red, green and blue of every pixel: its own sample, of the other colours the mean of those among its eight neighbours.
fn demosaic(rows: &[&[u8]], red_column: usize, red_row: usize) -> Vec<u8> {
    let (height, width) = (rows.len(), rows.first().map_or(0, |row| row.len()));
    // 0 red, 1 green, 2 blue.
    let colour = |x: usize, y: usize| (x + red_column) % 2 + (y + red_row) % 2;
    let mut out = Vec::with_capacity(3 * width * height);
    for y in 0..height {
        for x in 0..width {
            let own = colour(x, y);
            let (mut sums, mut counts) = ([0_u32; 3], [0_u32; 3]);
            for row in y.saturating_sub(1)..(y + 2).min(height) {
                for column in x.saturating_sub(1)..(x + 2).min(width) {
                    let at = colour(column, row);
                    sums[at] += u32::from(rows[row][column]);
                    counts[at] += 1;
                }
            }
            for channel in 0..3 {
                let value = if channel == own {
                    u32::from(rows[y][x])
                } else {
                    // Only an image of one row or column lacks a colour.
                    (sums[channel] + counts[channel] / 2) / counts[channel].max(1)
                };
                out.push(u8::try_from(value).unwrap_or(u8::MAX));
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::message::Header;

    fn image(encoding: &str, width: u32, step: u32, data: &[u8]) -> Image {
        Image {
            header: Header::default(),
            height: u32::try_from(data.len()).unwrap() / step,
            width,
            encoding: encoding.into(),
            big_endian: false,
            step,
            data: data.to_vec(),
        }
    }

    #[test]
    fn rows_lose_their_padding_and_colours_come_into_order() {
        assert_eq!(
            image("mono8", 2, 3, &[1, 2, 99, 3, 4, 99]).pixels(),
            Ok(Pixels::Grey8(vec![1, 2, 3, 4]))
        );
        let rgb = Ok(Pixels::Rgb8(vec![1, 2, 3]));
        assert_eq!(image("rgb8", 1, 3, &[1, 2, 3]).pixels(), rgb);
        assert_eq!(image("bgr8", 1, 3, &[3, 2, 1]).pixels(), rgb);
        assert_eq!(image("rgba8", 1, 4, &[1, 2, 3, 9]).pixels(), rgb);
        assert_eq!(image("bgra8", 1, 4, &[3, 2, 1, 9]).pixels(), rgb);
        assert_eq!(
            image("yuv422", 2, 4, &[128, 10, 128, 20]).pixels(),
            Ok(Pixels::Grey8(vec![10, 20]))
        );
        let mut wide = image("mono16", 1, 2, &[1, 2]);
        assert_eq!(wide.pixels(), Ok(Pixels::Grey16(vec![0x0201])));
        wide.big_endian = true;
        assert_eq!(wide.pixels(), Ok(Pixels::Grey16(vec![0x0102])));
    }

    #[test]
    fn a_filtered_image_of_one_colour_becomes_that_colour() {
        // Orange behind each of the four filters.
        let sample = [200, 100, 50];
        for (name, first) in [
            ("rggb", [0, 1, 1, 2]),
            ("grbg", [1, 0, 2, 1]),
            ("gbrg", [1, 2, 0, 1]),
            ("bggr", [2, 1, 1, 0]),
        ] {
            let data: Vec<u8> = (0..16)
                .map(|index| sample[first[index % 2 + 2 * (index / 4 % 2)]])
                .collect();
            let expected = Pixels::Rgb8(sample.repeat(16));
            assert_eq!(
                image(&format!("bayer_{name}8"), 4, 4, &data).pixels(),
                Ok(expected),
                "{name}"
            );
        }
    }

    #[test]
    fn fewer_bytes_than_the_size_asks_for_are_an_error() {
        let mut short = image("rgb8", 2, 6, &[0; 12]);
        short.height = 3;
        assert_eq!(
            short.pixels().unwrap_err().to_string(),
            "expected a 2x3 image (rgb8) in rows of 6 bytes, found 12 bytes"
        );
        short.width = u32::MAX;
        short.height = u32::MAX;
        assert!(short.pixels().is_err());
        let unknown = image("32FC1", 1, 4, &[0; 4]).pixels();
        assert!(
            unknown
                .unwrap_err()
                .to_string()
                .ends_with("found \"32FC1\"")
        );
    }
}
