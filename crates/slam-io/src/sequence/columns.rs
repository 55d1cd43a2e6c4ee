//! Tables of numbers whose columns are found by their names.
//!
//! Robots write their logs with a header of their own: other capitals, another order, tabs, quotes, columns that nobody
//! asked for. The header names every column, so none of this is a fault. It may stand behind a `#`. A name without a unit
//! (`v`, `omega`, `theta`) is taken for the SI one; a name with another unit is not in the lists and is not read.

use std::path::Path;

use super::stamps::{TimeUnit, median_step, refuse_other_units};
use crate::error::SequenceError;
use crate::text::{content_lines, finite, line_fault, quoted, read_text};

/// Rows whose times tell their unit.
const TIMES_LOOKED_AT: usize = 50;

/// A quantity and the names that headers give it, all in lower case; the first is the name of this program's own files.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Column {
    names: &'static [&'static str],
}

impl Column {
    pub(crate) const fn new(names: &'static [&'static str]) -> Self {
        Self { names }
    }

    /// Its own name.
    pub(crate) fn name(&self) -> &'static str {
        self.names.first().copied().unwrap_or_default()
    }
}

/// Time, seconds.
pub(crate) const TIME: Column = Column::new(&[
    "t_s",
    "t",
    "time",
    "time_s",
    "timestamp",
    "timestamp_s",
    "stamp",
    "secs",
    "seconds",
]);
/// Forward speed, metres per second.
pub(crate) const SPEED: Column = Column::new(&[
    "v_mps",
    "v",
    "speed",
    "speed_mps",
    "velocity",
    "vx",
    "v_x",
    "vx_mps",
    "linear_x",
    "linear.x",
]);
/// Turn rate, radians per second.
pub(crate) const TURN_RATE: Column = Column::new(&[
    "omega_radps",
    "omega",
    "w",
    "w_radps",
    "wz",
    "wz_radps",
    "omega_z",
    "yaw_rate",
    "yaw_rate_radps",
    "yawrate",
    "turn_rate",
    "angular_z",
    "angular.z",
]);
/// Position ahead, metres.
pub(crate) const X: Column = Column::new(&["x_m", "x", "pos_x", "position_x"]);
/// Position to the left, metres.
pub(crate) const Y: Column = Column::new(&["y_m", "y", "pos_y", "position_y"]);
/// Heading, radians.
pub(crate) const HEADING: Column = Column::new(&[
    "phi_rad",
    "phi",
    "theta",
    "theta_rad",
    "yaw",
    "yaw_rad",
    "heading",
    "heading_rad",
]);
/// Steering angle, radians.
pub(crate) const STEERING: Column = Column::new(&[
    "steering_rad",
    "steering",
    "steering_angle",
    "steering_angle_rad",
    "delta",
    "delta_rad",
]);
/// Steering angle, degrees.
pub(crate) const STEERING_DEGREES: Column = Column::new(&[
    "steering_deg",
    "steering_angle_deg",
    "steering_wheel_deg",
    "delta_deg",
]);
/// Count of the left wheel's encoder.
pub(crate) const LEFT: Column = Column::new(&[
    "left_ticks",
    "left",
    "left_count",
    "left_counts",
    "left_encoder",
    "ticks_left",
    "encoder_left",
]);
/// Count of the right wheel's encoder.
pub(crate) const RIGHT: Column = Column::new(&[
    "right_ticks",
    "right",
    "right_count",
    "right_counts",
    "right_encoder",
    "ticks_right",
    "encoder_right",
]);

/// Signs that may separate cells, in the order in which they are looked for in the header.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Separator {
    Sign(char),
    Blanks,
}

impl Separator {
    fn of(header: &str) -> Self {
        [',', '\t', ';']
            .into_iter()
            .find(|&sign| header.contains(sign))
            .map_or(Self::Blanks, Self::Sign)
    }

    /// The cells of a line, without blanks and quotes around them.
    fn cells(self, line: &str) -> impl Iterator<Item = &str> {
        let by_sign = match self {
            Self::Sign(sign) => Some(line.split(sign)),
            Self::Blanks => None,
        };
        let by_blanks = match self {
            Self::Sign(_) => None,
            Self::Blanks => Some(line.split_whitespace()),
        };
        by_sign
            .into_iter()
            .flatten()
            .chain(by_blanks.into_iter().flatten())
            .map(|cell| cell.trim().trim_matches('"').trim())
    }
}

/// A file whose header has been read.
#[derive(Debug)]
pub(crate) struct Table<'a> {
    path: &'a Path,
    text: String,
    /// Names in lower case.
    header: Vec<String>,
    header_line: u64,
    separator: Separator,
}

/// Columns of a table, found in its header.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Selection<const N: usize> {
    indices: [usize; N],
}

impl<'a> Table<'a> {
    /// Reads the file; `expected` is its usual header, for messages.
    ///
    /// A first line of numbers has a header only where the comment before it is one: a comment that contains `key`.
    pub(crate) fn open(
        path: &'a Path,
        key: &Column,
        expected: &str,
    ) -> Result<Self, SequenceError> {
        let text = read_text(path)?;
        let (line, first) = match content_lines(&text).next() {
            Some((line, first)) => (line, first.to_owned()),
            None => {
                return Err(SequenceError::File {
                    path: path.to_path_buf(),
                    expected: format!("the header {expected} and at least one row"),
                    found: "an empty file".into(),
                });
            }
        };
        let named = |line: &str| -> (Separator, Vec<String>) {
            let separator = Separator::of(line);
            let names = separator.cells(line).map(str::to_lowercase).collect();
            (separator, names)
        };
        let (separator, header) = named(&first);
        if header.iter().any(|name| name.parse::<f64>().is_err()) {
            return Ok(Self {
                path,
                text,
                header,
                header_line: line,
                separator,
            });
        }
        let commented = text
            .trim_start_matches('\u{feff}')
            .lines()
            .zip(1_u64..)
            .take_while(|&(_, number)| number < line)
            .filter_map(|(comment, number)| {
                let (separator, names) = named(comment.trim().trim_start_matches('#').trim());
                let known = names.iter().any(|name| key.names.contains(&name.as_str()));
                known.then_some((separator, names, number))
            })
            .last();
        match commented {
            Some((separator, header, header_line)) => Ok(Self {
                path,
                header,
                header_line,
                separator,
                text,
            }),
            None => Err(line_fault(
                path,
                line,
                format!("the header {expected}"),
                quoted(&first),
            )),
        }
    }

    /// The columns asked for, or `None` where one is missing.
    pub(crate) fn select<const N: usize>(&self, columns: [&Column; N]) -> Option<Selection<N>> {
        let mut indices = [0; N];
        for (index, column) in indices.iter_mut().zip(columns) {
            // The first name of the list that the header has, so that `v_mps` goes before `v`.
            *index = column
                .names
                .iter()
                .find_map(|name| self.header.iter().position(|found| found == name))?;
        }
        Some(Selection { indices })
    }

    /// The fault of a header without the columns `expected`.
    pub(crate) fn header_fault(&self, expected: &str) -> SequenceError {
        let sign = match self.separator {
            Separator::Sign(sign) => sign.to_string(),
            Separator::Blanks => " ".into(),
        };
        line_fault(
            self.path,
            self.header_line,
            format!("the header {expected}"),
            quoted(&self.header.join(&sign)),
        )
    }

    /// How the selection departs from this program's own header: names taken for others, columns not read; `None` where
    /// it does not.
    pub(crate) fn departure<const N: usize>(
        &self,
        selection: &Selection<N>,
        columns: [&Column; N],
    ) -> Option<String> {
        let renamed: Vec<String> = selection
            .indices
            .iter()
            .zip(columns)
            .filter(|&(&index, column)| self.header[index] != column.name())
            .map(|(&index, column)| format!("{} is read as {}", self.header[index], column.name()))
            .collect();
        let ignored: Vec<&str> = self
            .header
            .iter()
            .enumerate()
            .filter(|(index, _)| !selection.indices.contains(index))
            .map(|(_, name)| name.as_str())
            .collect();
        let ignored = (!ignored.is_empty()).then(|| format!("not read: {}", ignored.join(", ")));
        let unit = self.time_unit(selection);
        let unit = (unit != TimeUnit::Seconds)
            .then(|| format!("the times are {} since 1970", unit.name()));
        let parts: Vec<String> = renamed.into_iter().chain(ignored).chain(unit).collect();
        (!parts.is_empty()).then(|| parts.join("; "))
    }

    /// The unit of the selection's first column, the time, by its first rows.
    fn time_unit<const N: usize>(&self, selection: &Selection<N>) -> TimeUnit {
        let Some(&index) = selection.indices.first() else {
            return TimeUnit::Seconds;
        };
        let times: Vec<f64> = content_lines(&self.text)
            .filter(|&(line, _)| line > self.header_line)
            .take(TIMES_LOOKED_AT)
            .filter_map(|(_, content)| {
                let cell = self.separator.cells(content).nth(index)?;
                cell.parse().ok()
            })
            .collect();
        times
            .first()
            .and_then(|&first| TimeUnit::since_1970(first, median_step(&times)))
            .unwrap_or(TimeUnit::Seconds)
    }

    /// The rows, (line number, values in the order of the selection, the first of which is the time); at least one.
    /// O(length of the text).
    pub(crate) fn rows<const N: usize>(
        &self,
        selection: &Selection<N>,
    ) -> Result<Vec<(u64, [f64; N])>, SequenceError> {
        let unit = self.time_unit(selection);
        let mut rows = Vec::new();
        let mut cells: Vec<&str> = Vec::with_capacity(self.header.len());
        for (line, content) in content_lines(&self.text) {
            if line <= self.header_line {
                continue;
            }
            cells.clear();
            cells.extend(self.separator.cells(content));
            if cells.len() != self.header.len() {
                return Err(line_fault(
                    self.path,
                    line,
                    format!("{} values", self.header.len()),
                    cells.len().to_string(),
                ));
            }
            let mut values = [0.0; N];
            for (value, &index) in values.iter_mut().zip(&selection.indices) {
                *value = finite(self.path, line, &self.header[index], cells[index])?;
            }
            if let (Some(time_s), Some(&index)) = (values.first_mut(), selection.indices.first()) {
                *time_s = unit.seconds(cells[index], *time_s);
            }
            rows.push((line, values));
        }
        if rows.is_empty() {
            return Err(SequenceError::File {
                path: self.path.to_path_buf(),
                expected: format!("the header {} and at least one row", self.header.join(",")),
                found: "the header alone".into(),
            });
        }
        let times_s: Vec<f64> = rows
            .iter()
            .filter_map(|(_, values): &(u64, [f64; N])| values.first().copied())
            .collect();
        refuse_other_units(self.path, "rows", &times_s)?;
        Ok(rows)
    }
}
