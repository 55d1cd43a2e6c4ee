//! A row of a table: types first, then values.

use crate::error::Mismatch;

/// A row, or its beginning.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Row {
    pub(crate) rowid: i64,
    /// Bytes of the whole record.
    pub(crate) length: usize,
    /// The record, or as much of it as was asked for.
    pub(crate) bytes: Vec<u8>,
}

/// A value of a row.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Value {
    /// Nothing, or a number with a fraction, which no recorder writes.
    Other,
    Integer(i64),
    Text(String),
    /// Place of the bytes in the record; their end may lie behind what was read of it.
    Blob {
        start: usize,
        length: usize,
    },
}

impl Row {
    /// The values, as far as their places lie in the bytes that were read; a last blob may reach beyond.
    pub(crate) fn values(&self) -> Result<Vec<Value>, Mismatch> {
        let mut at = 0;
        let header = varint(&self.bytes, &mut at)?;
        let header = usize::try_from(header)
            .ok()
            .filter(|&end| end <= self.bytes.len() && end >= at)
            .ok_or_else(|| {
                Mismatch::new(
                    format!("a row header of at most {} bytes", self.bytes.len()),
                    header.to_string(),
                )
            })?;
        let mut values = Vec::new();
        let mut start = header;
        while at < header {
            let kind = varint(&self.bytes, &mut at)?;
            let length = match kind {
                0 | 8 | 9 => 0,
                1..=4 => kind,
                5 => 6,
                6 | 7 => 8,
                10 | 11 => {
                    return Err(Mismatch::new("a type of the file format", kind.to_string()));
                }
                _ => (kind - 12) / 2,
            };
            let length = usize::try_from(length)
                .ok()
                .filter(|&length| length <= self.length.saturating_sub(start))
                .ok_or_else(|| {
                    Mismatch::new(
                        format!("values within the {} bytes of a row", self.length),
                        format!("one of {length} bytes"),
                    )
                })?;
            let bytes = self.bytes.get(start..start + length);
            values.push(match (kind, bytes) {
                (8 | 9, _) => Value::Integer(kind.cast_signed() - 8),
                (1..=6, Some(bytes)) => Value::Integer(integer(bytes)),
                (13.., Some(bytes)) if kind % 2 == 1 => {
                    Value::Text(String::from_utf8_lossy(bytes).into_owned())
                }
                (12.., _) if kind % 2 == 0 => Value::Blob { start, length },
                (0 | 7, _) => Value::Other,
                _ => {
                    return Err(Mismatch::new(
                        "the short values of a row before its long ones",
                        "the end of what is read of it",
                    ));
                }
            });
            start += length;
        }
        Ok(values)
    }
}

/// A number with a sign, its highest byte first.
fn integer(bytes: &[u8]) -> i64 {
    let negative = bytes.first().is_some_and(|&byte| byte >= 128);
    bytes
        .iter()
        .fold(if negative { -1 } else { 0 }, |value: i64, &byte| {
            (value << 8) | i64::from(byte)
        })
}

/// A number of one to nine bytes of seven bits each, the ninth of eight.
pub(crate) fn varint(bytes: &[u8], at: &mut usize) -> Result<u64, Mismatch> {
    let mut value = 0_u64;
    for index in 0..9 {
        let byte = *bytes
            .get(*at)
            .ok_or_else(|| Mismatch::new("one more byte of a number", "the end of its page"))?;
        *at += 1;
        if index == 8 {
            return Ok((value << 8) | u64::from(byte));
        }
        value = (value << 7) | u64::from(byte & 0x7f);
        if byte < 128 {
            break;
        }
    }
    Ok(value)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_one_to_nine_bytes() {
        for (bytes, value) in [
            (&[0x7f][..], 127),
            (&[0x81, 0x00], 128),
            (&[0xff; 9], u64::MAX),
            (&[0x80, 0x80, 0x01], 1),
        ] {
            let mut at = 0;
            assert_eq!(varint(bytes, &mut at), Ok(value));
            assert_eq!(at, bytes.len());
        }
        assert!(varint(&[0x80], &mut 0).is_err());
        assert_eq!(integer(&[0xff, 0xfe]), -2);
        assert_eq!(integer(&[0x01, 0x00, 0x00]), 65536);
    }

    #[test]
    fn a_value_longer_than_its_row_is_refused() {
        // Header of two bytes, one blob of 50 bytes, in a record of 10.
        let row = Row {
            rowid: 1,
            length: 10,
            bytes: vec![2, 112, 0, 0],
        };
        assert!(row.values().is_err());
        let row = Row { length: 52, ..row };
        assert_eq!(
            row.values(),
            Ok(vec![Value::Blob {
                start: 2,
                length: 50
            }])
        );
    }
}
