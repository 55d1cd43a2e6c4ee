//! Numbers in and out of little-endian bytes.

use nalgebra::{Matrix3, Vector3};

/// A fault of a file's bytes: what was expected and what was found.
#[derive(Debug)]
pub(super) struct Fault {
    pub(super) expected: String,
    pub(super) found: String,
}

impl Fault {
    pub(super) fn new(expected: impl Into<String>, found: impl Into<String>) -> Self {
        Self {
            expected: expected.into(),
            found: found.into(),
        }
    }
}

/// Bytes not yet read.
#[derive(Debug)]
pub(super) struct Bytes<'a>(&'a [u8]);

impl<'a> Bytes<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Self(bytes)
    }

    /// Number of bytes left.
    pub(super) fn left(&self) -> usize {
        self.0.len()
    }

    pub(super) fn take<const N: usize>(&mut self) -> Result<[u8; N], Fault> {
        let Some((head, tail)) = self.0.split_first_chunk::<N>() else {
            return Err(Fault::new(
                format!("{N} more bytes"),
                format!("{} left", self.0.len()),
            ));
        };
        self.0 = tail;
        Ok(*head)
    }

    /// The next `length` bytes; `None` when fewer are left.
    pub(super) fn slice(&mut self, length: u64) -> Option<&'a [u8]> {
        let (head, tail) = self.0.split_at_checked(usize::try_from(length).ok()?)?;
        self.0 = tail;
        Some(head)
    }

    pub(super) fn u16(&mut self) -> Result<u16, Fault> {
        self.take().map(u16::from_le_bytes)
    }

    pub(super) fn u32(&mut self) -> Result<u32, Fault> {
        self.take().map(u32::from_le_bytes)
    }

    pub(super) fn u64(&mut self) -> Result<u64, Fault> {
        self.take().map(u64::from_le_bytes)
    }

    /// A finite number; `what` names it in the fault.
    pub(super) fn f64(&mut self, what: &str) -> Result<f64, Fault> {
        let value = self.take().map(f64::from_le_bytes)?;
        if value.is_finite() {
            Ok(value)
        } else {
            Err(Fault::new(
                format!("a finite number as {what}"),
                value.to_string(),
            ))
        }
    }

    pub(super) fn vector(&mut self, what: &str) -> Result<Vector3<f64>, Fault> {
        Ok(Vector3::new(
            self.f64(what)?,
            self.f64(what)?,
            self.f64(what)?,
        ))
    }

    /// A matrix row by row.
    pub(super) fn matrix(&mut self, what: &str) -> Result<Matrix3<f64>, Fault> {
        let mut matrix = Matrix3::zeros();
        for row in 0..3 {
            for column in 0..3 {
                matrix[(row, column)] = self.f64(what)?;
            }
        }
        Ok(matrix)
    }

    /// A number of things that take at least `least` bytes each; refused when the bytes left cannot hold as many.
    pub(super) fn count(&mut self, what: &str, least: usize) -> Result<usize, Fault> {
        let count = self.u32()? as usize;
        if self.0.len() / least < count {
            return Err(Fault::new(
                format!("{count} {what}"),
                format!("{} bytes left for them", self.0.len()),
            ));
        }
        Ok(count)
    }

    /// Refuses bytes that nothing accounts for.
    pub(super) fn end(&self, what: &str) -> Result<(), Fault> {
        match self.0.len() {
            0 => Ok(()),
            more => Err(Fault::new(
                format!("the end of {what}"),
                format!("{more} more bytes"),
            )),
        }
    }
}

/// Appends numbers.
pub(super) fn put_f64<'a>(bytes: &mut Vec<u8>, values: impl IntoIterator<Item = &'a f64>) {
    for value in values {
        bytes.extend_from_slice(&value.to_le_bytes());
    }
}

/// Appends a matrix row by row.
pub(super) fn put_matrix(bytes: &mut Vec<u8>, matrix: &Matrix3<f64>) {
    // The storage is column by column.
    put_f64(bytes, matrix.transpose().iter());
}

/// Appends a whole number.
pub(super) fn put_u32(bytes: &mut Vec<u8>, value: u32) {
    bytes.extend_from_slice(&value.to_le_bytes());
}
