//! Images: which files of a folder they are and in which order, whether they are whole, their pixels in grey.

mod grey;
mod levels;
mod list;
mod small;
mod source;
mod whole;

pub use grey::{GreyImage, read_grey};
pub use list::image_files;
pub use source::Images;

pub(crate) use grey::decoded_in_memory;
pub(crate) use list::{IMAGE_ENDINGS, listed_images, what_lies_there};
pub(crate) use source::{ImageFiles, ImageSource};
pub(crate) use whole::{WholeFiles, whole_files};
