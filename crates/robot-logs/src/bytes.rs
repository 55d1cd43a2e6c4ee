//! Reading little-endian records of untrusted bytes: every length is compared with the bytes left.

use crate::error::Mismatch;

/// A place in a slice of bytes.
#[derive(Debug, Clone)]
pub(crate) struct Cursor<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Cursor<'a> {
    /// The beginning of `bytes`.
    pub(crate) fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0 }
    }

    /// Bytes read so far.
    pub(crate) fn position(&self) -> usize {
        self.at
    }

    /// Bytes not yet read.
    pub(crate) fn left(&self) -> usize {
        self.bytes.len() - self.at
    }

    /// The next `count` bytes.
    pub(crate) fn take(&mut self, count: usize) -> Result<&'a [u8], Mismatch> {
        if count > self.left() {
            return Err(Mismatch::new(
                format!("{count} more bytes"),
                format!("{} left", self.left()),
            ));
        }
        let start = self.at;
        self.at += count;
        Ok(&self.bytes[start..self.at])
    }

    fn array<const N: usize>(&mut self) -> Result<[u8; N], Mismatch> {
        let mut array = [0; N];
        array.copy_from_slice(self.take(N)?);
        Ok(array)
    }

    pub(crate) fn u8(&mut self) -> Result<u8, Mismatch> {
        Ok(self.array::<1>()?[0])
    }

    pub(crate) fn u16(&mut self) -> Result<u16, Mismatch> {
        Ok(u16::from_le_bytes(self.array()?))
    }

    pub(crate) fn u32(&mut self) -> Result<u32, Mismatch> {
        Ok(u32::from_le_bytes(self.array()?))
    }

    pub(crate) fn u64(&mut self) -> Result<u64, Mismatch> {
        Ok(u64::from_le_bytes(self.array()?))
    }

    /// Bytes behind a length of four bytes.
    pub(crate) fn block(&mut self) -> Result<&'a [u8], Mismatch> {
        let count = self.u32()?;
        self.take(usize::try_from(count).unwrap_or(usize::MAX))
    }

    /// Text behind a length of four bytes; bytes that are no UTF-8 are replaced.
    pub(crate) fn text(&mut self) -> Result<String, Mismatch> {
        Ok(String::from_utf8_lossy(self.block()?).into_owned())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_length_beyond_the_end_is_refused_before_anything_is_taken() {
        let mut cursor = Cursor::new(&[255, 255, 255, 255, 1]);
        assert_eq!(
            cursor.block(),
            Err(Mismatch::new("4294967295 more bytes", "1 left"))
        );
        assert_eq!((cursor.position(), cursor.left()), (4, 1));
        assert_eq!(cursor.u8(), Ok(1));
        assert!(cursor.u16().is_err());
    }
}
