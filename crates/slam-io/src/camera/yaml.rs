//! A YAML document as the calibration readers need it: keys, numbers and lists, every fault with its line.

use std::borrow::Cow;
use std::path::Path;

use saphyr::{LoadableYamlNode as _, MarkedYaml, Scalar, YamlData};

use super::file::file_fault;
use crate::error::SequenceError;
use crate::text::{line_fault, quoted};

/// The text with a header the YAML standard knows: OpenCV before version 5 writes `%YAML:1.0`. Lines keep their numbers.
pub(super) fn standard_header(text: &str) -> Cow<'_, str> {
    let text = text.trim_start_matches('\u{feff}');
    match text.strip_prefix("%YAML:") {
        Some(rest) => Cow::Owned(spaced_keys(&format!("#{rest}"))),
        None => Cow::Borrowed(text),
    }
}

/// The text with a space behind the colon of every key: OpenCV reads `Viewer.PointSize:2`, YAML does not.
fn spaced_keys(text: &str) -> String {
    let mut spaced = String::with_capacity(text.len());
    for line in text.split_inclusive('\n') {
        let key_end = line.find(':').filter(|&end| {
            let in_key = |byte: u8| byte.is_ascii_alphanumeric() || b"._-".contains(&byte);
            end > 0 && line.as_bytes()[..end].iter().all(|&byte| in_key(byte))
        });
        match key_end.map(|end| line.split_at(end + 1)) {
            Some((key, value)) if !value.starts_with(char::is_whitespace) => {
                spaced.push_str(key);
                spaced.push(' ');
                spaced.push_str(value);
            }
            _ => spaced.push_str(line),
        }
    }
    spaced
}

/// The documents of a text; their first one counts.
pub(super) fn load<'a>(path: &Path, text: &'a str) -> Result<Vec<MarkedYaml<'a>>, SequenceError> {
    MarkedYaml::load_from_str(text).map_err(|error| {
        line_fault(
            path,
            error.marker().line() as u64,
            "YAML",
            error.info().replace('\n', " "),
        )
    })
}

/// A value of the document and how it is called.
#[derive(Clone)]
pub(super) struct Node<'a> {
    path: &'a Path,
    name: String,
    /// Line of the key, of a list's entry its own.
    line: u64,
    value: &'a MarkedYaml<'a>,
}

impl<'a> Node<'a> {
    /// The mapping at the top.
    pub(super) fn root(
        path: &'a Path,
        documents: &'a [MarkedYaml<'a>],
    ) -> Result<Self, SequenceError> {
        documents
            .first()
            .filter(|value| value.is_mapping())
            .map(|value| Self {
                path,
                name: String::new(),
                line: 1,
                value: untagged(value),
            })
            .ok_or_else(|| file_fault(path, "keys with values", "a text without keys"))
    }

    /// The value of a key, if this is a mapping that has it.
    pub(super) fn get(&self, key: &str) -> Option<Self> {
        let YamlData::Mapping(mapping) = &self.value.data else {
            return None;
        };
        let (found, value) = mapping
            .iter()
            .find(|(name, _)| text_of(name).is_some_and(|name| name == key))?;
        Some(Self {
            path: self.path,
            name: if self.name.is_empty() {
                key.to_string()
            } else {
                format!("{key} of {}", self.name)
            },
            line: line_of(found),
            value: untagged(value),
        })
    }

    /// The value of the first of several names of one key.
    pub(super) fn get_any(&self, keys: &[&str]) -> Option<Self> {
        keys.iter().find_map(|key| self.get(key))
    }

    /// As [`Self::get_any`]; without any it is a fault.
    pub(super) fn need(&self, keys: &[&str]) -> Result<Self, SequenceError> {
        self.get_any(keys).ok_or_else(|| {
            // The first name is the usual one; a list of every spelling helps nobody.
            let name = keys.first().copied().unwrap_or_default();
            file_fault(self.path, format!("the key {name}{}", self.place()), "none")
        })
    }

    /// Names of the keys.
    pub(super) fn keys(&self) -> Vec<String> {
        match &self.value.data {
            YamlData::Mapping(mapping) => mapping.keys().filter_map(text_of).collect(),
            _ => Vec::new(),
        }
    }

    /// A word.
    pub(super) fn text(&self) -> Result<String, SequenceError> {
        text_of(self.value).ok_or_else(|| self.fault("a word", "a list or keys"))
    }

    /// A finite number.
    pub(super) fn number(&self) -> Result<f64, SequenceError> {
        let expected = format!("a finite number for {}", self.name);
        match text_of(self.value) {
            Some(text) => match text.parse::<f64>() {
                Ok(value) if value.is_finite() => Ok(value),
                _ => Err(self.at(expected, quoted(&text))),
            },
            None => Err(self.at(expected, "a list or keys")),
        }
    }

    /// A whole number of pixels.
    pub(super) fn pixels(&self) -> Result<u32, SequenceError> {
        let value = self.number()?;
        if value.fract() == 0.0 && (0.0..=f64::from(u32::MAX)).contains(&value) {
            Ok(value as u32)
        } else {
            Err(self.fault("a whole number", value.to_string()))
        }
    }

    /// Width and height.
    pub(super) fn pixel_pair(&self) -> Result<[u32; 2], SequenceError> {
        let [width, height] = self.array()?;
        let whole =
            |value: f64| value.fract() == 0.0 && (0.0..=f64::from(u32::MAX)).contains(&value);
        if whole(width) && whole(height) {
            Ok([width as u32, height as u32])
        } else {
            Err(self.fault("two whole numbers", format!("{width}, {height}")))
        }
    }

    /// The line of the key.
    pub(super) fn line(&self) -> u64 {
        self.line
    }

    /// Where this is, for a message about something missing in it: " in cam0", nothing at the top.
    pub(super) fn place(&self) -> String {
        if self.name.is_empty() {
            String::new()
        } else {
            format!(" in {}", self.name)
        }
    }

    /// The file.
    pub(super) fn path(&self) -> &Path {
        self.path
    }

    /// A list of finite numbers.
    pub(super) fn numbers(&self) -> Result<Vec<f64>, SequenceError> {
        let YamlData::Sequence(entries) = &self.value.data else {
            return Err(self.fault("a list of numbers", "something else"));
        };
        entries
            .iter()
            .map(|entry| self.entry(entry).number())
            .collect()
    }

    /// A list of exactly `COUNT` finite numbers.
    pub(super) fn array<const COUNT: usize>(&self) -> Result<[f64; COUNT], SequenceError> {
        let values = self.numbers()?;
        values.as_slice().try_into().map_err(|_wrong_count| {
            self.fault(&format!("{COUNT} numbers"), values.len().to_string())
        })
    }

    /// The numbers of a matrix written as rows, cols and data, row by row.
    pub(super) fn matrix(&self) -> Result<(usize, usize, Vec<f64>), SequenceError> {
        let rows = self.need(&["rows"])?.pixels()? as usize;
        let columns = self.need(&["cols"])?.pixels()? as usize;
        let data = self.need(&["data"])?;
        let values = data.numbers()?;
        if rows.checked_mul(columns) != Some(values.len()) {
            return Err(data.fault(
                &format!("{rows} x {columns} numbers"),
                values.len().to_string(),
            ));
        }
        Ok((rows, columns, values))
    }

    /// The numbers of a matrix, or of a list, or of a list of lists, row by row.
    fn flat(&self) -> Result<(Option<[usize; 2]>, Vec<f64>), SequenceError> {
        match &self.value.data {
            YamlData::Sequence(entries) if entries.iter().any(|entry| is_list(untagged(entry))) => {
                let mut values = Vec::new();
                for entry in entries {
                    values.extend(self.entry(entry).numbers()?);
                }
                Ok((None, values))
            }
            YamlData::Sequence(_) => Ok((None, self.numbers()?)),
            _ => {
                let (rows, columns, values) = self.matrix()?;
                Ok((Some([rows, columns]), values))
            }
        }
    }

    /// The coefficients of a lens: a matrix of one row or column, or a list.
    pub(super) fn coefficients(&self) -> Result<Vec<f64>, SequenceError> {
        let (shape, values) = self.flat()?;
        match shape {
            Some([rows, columns]) if rows > 1 && columns > 1 => {
                Err(self.fault("one row or one column", format!("{rows} x {columns}")))
            }
            _ => Ok(values),
        }
    }

    /// fx, fy, cx, cy and the skew of a 3x3 camera matrix.
    pub(super) fn camera_matrix(&self) -> Result<[f64; 5], SequenceError> {
        let (shape, values) = self.flat()?;
        match values.as_slice() {
            &[fx, skew, cx, zero, fy, cy, a, b, c] if shape.is_none_or(|shape| shape == [3, 3]) => {
                // A matrix of zeros is that of a camera never calibrated, which is told of its focal length.
                let empty = values.iter().all(|&value| value == 0.0);
                if [zero, a, b, c] == [0.0, 0.0, 0.0, 1.0] || empty {
                    Ok([fx, fy, cx, cy, skew])
                } else {
                    Err(self.fault(
                        "fx 0 cx, 0 fy cy, 0 0 1",
                        format!("{fx} {skew} {cx}, {zero} {fy} {cy}, {a} {b} {c}"),
                    ))
                }
            }
            _ => Err(self.fault(
                "3 x 3 numbers",
                match shape {
                    Some([rows, columns]) => format!("{rows} x {columns}"),
                    None => values.len().to_string(),
                },
            )),
        }
    }

    /// An entry of this list.
    fn entry(&self, entry: &'a MarkedYaml<'a>) -> Self {
        Self {
            path: self.path,
            name: self.name.clone(),
            line: line_of(entry),
            value: untagged(entry),
        }
    }

    /// A fault of this value.
    pub(super) fn fault(&self, expected: &str, found: impl Into<String>) -> SequenceError {
        self.at(format!("{expected} for {}", self.name), found)
    }

    fn at(&self, expected: String, found: impl Into<String>) -> SequenceError {
        line_fault(self.path, self.line, expected, found)
    }
}

fn line_of(value: &MarkedYaml<'_>) -> u64 {
    value.span.start.line() as u64
}

/// The value behind a tag such as `!!opencv-matrix`.
fn untagged<'a>(value: &'a MarkedYaml<'a>) -> &'a MarkedYaml<'a> {
    match &value.data {
        YamlData::Tagged(_, inner) => untagged(inner),
        _ => value,
    }
}

fn is_list(value: &MarkedYaml<'_>) -> bool {
    matches!(value.data, YamlData::Sequence(_))
}

/// A scalar as text.
fn text_of(value: &MarkedYaml<'_>) -> Option<String> {
    match &value.data {
        YamlData::Value(scalar) => Some(match scalar {
            Scalar::String(text) => text.to_string(),
            Scalar::Integer(value) => value.to_string(),
            // The shortest text of the same bits.
            Scalar::FloatingPoint(value) => value.into_inner().to_string(),
            Scalar::Boolean(value) => value.to_string(),
            Scalar::Null => "nothing".to_string(),
        }),
        _ => None,
    }
}
