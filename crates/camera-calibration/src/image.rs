//! The one kind of image that this crate looks at.

/// A view of an 8-bit grey image, row by row from the top left.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct GreyView<'a> {
    /// Number of columns.
    pub width: usize,
    /// Number of rows.
    pub height: usize,
    /// `width * height` grey levels, row by row.
    pub pixels: &'a [u8],
}
