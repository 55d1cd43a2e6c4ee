//! Image files: their list, their headers, their pixels in grey.

use std::fs;
use std::path::{Path, PathBuf};

use camera_calibration::GreyView;
use image::{ImageReader, ImageResult};

use crate::camera::CameraFile;
use crate::error::SequenceError;

/// An 8-bit grey image, row by row from the top left.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct GreyImage {
    /// Number of columns.
    pub width: usize,
    /// Number of rows.
    pub height: usize,
    /// `width * height` values, row by row.
    pub pixels: Vec<u8>,
}

impl GreyImage {
    /// The image as the search for checkerboards takes it.
    pub fn view(&self) -> GreyView<'_> {
        GreyView {
            width: self.width,
            height: self.height,
            pixels: &self.pixels,
        }
    }
}

/// Image files of a folder in lexical order of their names.
pub(crate) fn list_images(folder: &Path) -> Result<Vec<PathBuf>, SequenceError> {
    let unreadable = |source| SequenceError::Read {
        path: folder.to_path_buf(),
        source,
    };
    let mut images = Vec::new();
    for entry in fs::read_dir(folder).map_err(unreadable)? {
        let path = entry.map_err(unreadable)?.path();
        if is_image_name(&path) {
            images.push(path);
        }
    }
    if images.is_empty() {
        return Err(SequenceError::File {
            path: folder.to_path_buf(),
            expected: "at least one .png, .jpg or .jpeg file".into(),
            found: "none".into(),
        });
    }
    images.sort();
    Ok(images)
}

/// The images behind a list of files and folders; a folder stands for its images in lexical order.
///
/// # Errors
/// [`SequenceError`] when a folder cannot be listed or holds no image.
pub fn image_files(inputs: &[PathBuf]) -> Result<Vec<PathBuf>, SequenceError> {
    let mut files = Vec::new();
    for input in inputs {
        if input.is_dir() {
            files.extend(list_images(input)?);
        } else {
            files.push(input.clone());
        }
    }
    Ok(files)
}

/// Reads every image's header and compares its size with the camera's.
pub(crate) fn check_sizes(images: &[PathBuf], camera: &CameraFile) -> Result<(), SequenceError> {
    for path in images {
        let (width, height) = decoded(path, open(path).and_then(ImageReader::into_dimensions))?;
        check_size(path, width, height, camera)?;
    }
    Ok(())
}

/// Decodes one image to grey.
pub(crate) fn load_grey(path: &Path, camera: &CameraFile) -> Result<GreyImage, SequenceError> {
    let (width, height) = decoded(path, open(path).and_then(ImageReader::into_dimensions))?;
    check_size(path, width, height, camera)?;
    read_grey(path)
}

/// Decodes a PNG or JPEG file of any size to grey.
///
/// # Errors
/// [`SequenceError`] when the file cannot be read or is not a complete image.
pub fn read_grey(path: &Path) -> Result<GreyImage, SequenceError> {
    let grey = decoded(path, open(path).and_then(ImageReader::decode))?.into_luma8();
    Ok(GreyImage {
        width: grey.width() as usize,
        height: grey.height() as usize,
        pixels: grey.into_raw(),
    })
}

/// A visible file with one of the known endings, in any case.
fn is_image_name(path: &Path) -> bool {
    let hidden = path
        .file_name()
        .is_none_or(|name| name.to_string_lossy().starts_with('.'));
    let known = path.extension().is_some_and(|ending| {
        ["png", "jpg", "jpeg"]
            .iter()
            .any(|known| ending.eq_ignore_ascii_case(known))
    });
    known && !hidden
}

/// The contents decide about the format; the name decides only where they do not tell.
fn open(path: &Path) -> ImageResult<ImageReader<std::io::BufReader<fs::File>>> {
    Ok(ImageReader::open(path)?.with_guessed_format()?)
}

fn decoded<T>(path: &Path, result: ImageResult<T>) -> Result<T, SequenceError> {
    result.map_err(|error| match error {
        image::ImageError::IoError(source)
            if source.kind() != std::io::ErrorKind::UnexpectedEof =>
        {
            SequenceError::Read {
                path: path.to_path_buf(),
                source,
            }
        }
        other => SequenceError::File {
            path: path.to_path_buf(),
            expected: "a whole PNG or JPEG image".into(),
            found: other.to_string().lines().collect::<Vec<_>>().join(" "),
        },
    })
}

fn check_size(
    path: &Path,
    width: u32,
    height: u32,
    camera: &CameraFile,
) -> Result<(), SequenceError> {
    if (width, height) == (camera.width, camera.height) {
        return Ok(());
    }
    Err(SequenceError::File {
        path: path.to_path_buf(),
        expected: format!(
            "{}x{} pixels as camera.toml says",
            camera.width, camera.height
        ),
        found: format!("{width}x{height}"),
    })
}
