//! Fields of ROS messages in the two serialisations.
//!
//! ROS 1 packs little-endian fields without gaps. ROS 2 writes CDR: four bytes of encapsulation, whose second one tells
//! the byte order, then fields that begin at multiples of their size, counted from behind the encapsulation (XCDR1; in
//! XCDR2 at most at multiples of four); a text ends in a zero that its length counts. Source: OMG DDS-XTypes 1.3,
//! section 7.4.

use crate::bytes::Cursor;
use crate::contents::Serialisation;
use crate::error::Mismatch;

/// The next field of a message.
#[derive(Debug)]
pub(crate) struct Wire<'a> {
    cursor: Cursor<'a>,
    serialisation: Serialisation,
    big_endian: bool,
    /// Largest alignment; 1 without gaps.
    alignment: usize,
}

impl<'a> Wire<'a> {
    /// The beginning of a message.
    pub(crate) fn new(bytes: &'a [u8], serialisation: Serialisation) -> Result<Self, Mismatch> {
        if serialisation == Serialisation::Ros1 {
            return Ok(Self {
                cursor: Cursor::new(bytes),
                serialisation,
                big_endian: false,
                alignment: 1,
            });
        }
        let (big_endian, alignment) = match bytes {
            [0, 0, _, _, ..] => (true, 8),
            [0, 1, _, _, ..] => (false, 8),
            [0, 6, _, _, ..] => (true, 4),
            [0, 7, _, _, ..] => (false, 4),
            _ => {
                return Err(Mismatch::new(
                    "plain CDR (encapsulation 0, 1, 6 or 7)",
                    format!("the bytes {:?}", &bytes[..bytes.len().min(4)]),
                ));
            }
        };
        Ok(Self {
            cursor: Cursor::new(&bytes[4..]),
            serialisation,
            big_endian,
            alignment,
        })
    }

    /// Whether this is ROS 1, whose headers have one field more.
    pub(crate) fn is_ros1(&self) -> bool {
        self.serialisation == Serialisation::Ros1
    }

    fn number<const N: usize>(&mut self) -> Result<[u8; N], Mismatch> {
        let alignment = N.min(self.alignment);
        let gap = (alignment - self.cursor.position() % alignment) % alignment;
        self.cursor.take(gap)?;
        let mut bytes = [0; N];
        bytes.copy_from_slice(self.cursor.take(N)?);
        if self.big_endian {
            bytes.reverse();
        }
        Ok(bytes)
    }

    pub(crate) fn u8(&mut self) -> Result<u8, Mismatch> {
        self.cursor.u8()
    }

    pub(crate) fn u32(&mut self) -> Result<u32, Mismatch> {
        Ok(u32::from_le_bytes(self.number()?))
    }

    pub(crate) fn i32(&mut self) -> Result<i32, Mismatch> {
        Ok(i32::from_le_bytes(self.number()?))
    }

    pub(crate) fn f64(&mut self) -> Result<f64, Mismatch> {
        Ok(f64::from_le_bytes(self.number()?))
    }

    /// `N` numbers without a length before them.
    pub(crate) fn f64s<const N: usize>(&mut self) -> Result<[f64; N], Mismatch> {
        let mut values = [0.0; N];
        for value in &mut values {
            *value = self.f64()?;
        }
        Ok(values)
    }

    /// Number of elements of a list whose elements have at least `element` bytes each.
    pub(crate) fn count(&mut self, element: usize) -> Result<usize, Mismatch> {
        let count = usize::try_from(self.u32()?).unwrap_or(usize::MAX);
        if count.saturating_mul(element) > self.cursor.left() {
            return Err(Mismatch::new(
                format!("{count} elements of at least {element} bytes"),
                format!("{} bytes left", self.cursor.left()),
            ));
        }
        Ok(count)
    }

    /// A list of numbers.
    pub(crate) fn f64_list(&mut self) -> Result<Vec<f64>, Mismatch> {
        let count = self.count(8)?;
        (0..count).map(|_| self.f64()).collect()
    }

    /// A list of bytes.
    pub(crate) fn bytes(&mut self) -> Result<&'a [u8], Mismatch> {
        let count = self.count(1)?;
        self.cursor.take(count)
    }

    /// A text; bytes that are no UTF-8 are replaced.
    pub(crate) fn text(&mut self) -> Result<String, Mismatch> {
        let mut bytes = self.bytes()?;
        if let [head @ .., 0] = bytes
            && !self.is_ros1()
        {
            bytes = head;
        }
        Ok(String::from_utf8_lossy(bytes).into_owned())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_aligned_from_behind_the_encapsulation() {
        // u8 7, then an f64 at byte 8 of XCDR1 or byte 4 of XCDR2; packed in ROS 1.
        let value = 1.5_f64;
        for (head, gap, bytes) in [
            (&[0, 1, 0, 0][..], 7, value.to_le_bytes()),
            (&[0, 0, 0, 0], 7, value.to_be_bytes()),
            (&[0, 7, 0, 0], 3, value.to_le_bytes()),
            (&[], 0, value.to_le_bytes()),
        ] {
            let mut message = head.to_vec();
            message.push(7);
            message.extend(vec![0; gap]);
            message.extend(bytes);
            let kind = if head.is_empty() {
                Serialisation::Ros1
            } else {
                Serialisation::Cdr
            };
            let mut wire = Wire::new(&message, kind).unwrap();
            assert_eq!((wire.u8(), wire.f64()), (Ok(7), Ok(value)), "{head:?}");
            assert!(wire.u8().is_err());
        }
    }

    #[test]
    fn a_list_longer_than_the_message_is_refused() {
        let mut wire = Wire::new(&[0, 1, 0, 0, 255, 255, 255, 127], Serialisation::Cdr).unwrap();
        assert_eq!(
            wire.f64_list(),
            Err(Mismatch::new(
                "2147483647 elements of at least 8 bytes",
                "0 bytes left"
            ))
        );
        assert!(
            Wire::new(&[0, 3, 0, 0], Serialisation::Cdr).is_err(),
            "a parameter list"
        );
    }
}
