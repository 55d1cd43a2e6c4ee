//! Text files of numbers, plain or gzipped, and the folder of the optional data.

use std::error::Error;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

/// The folder of a data set under `MONO_SLAM_DATA`, or under `../shared/data` beside the workspace. If it
/// does not exist, the answer is `None`, with a sentence on the console.
#[expect(clippy::print_stdout, reason = "a run without its data says so")]
pub(crate) fn data_folder(name: &str) -> Option<PathBuf> {
    let root = std::env::var_os("MONO_SLAM_DATA").map_or_else(
        || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data"),
        PathBuf::from,
    );
    let folder = root.join(name);
    if folder.is_dir() {
        return Some(folder);
    }
    println!(
        "skipped: no {}; set MONO_SLAM_DATA to the folder above it",
        folder.display()
    );
    None
}

/// The first N numbers of every line of `path`, or of `path.gz` where there is no `path`.
///
/// Fields are separated by blanks, tabs or commas. Lines that start with `#` or a letter are
/// comments or headings.
///
/// # Errors
/// A file that cannot be read, or a line without N finite numbers; the message names both.
pub(crate) fn read_table<const N: usize>(path: &Path) -> Result<Vec<[f64; N]>, Box<dyn Error>> {
    let text = read_text(path).map_err(|error| format!("{}: {error}", path.display()))?;
    let mut rows = Vec::new();
    for (number, line) in (1..).zip(text.lines()) {
        let line = line.trim();
        if line.starts_with(|first: char| first == '#' || first.is_ascii_alphabetic())
            || line.is_empty()
        {
            continue;
        }
        let mut fields = line
            .split([' ', '\t', ','])
            .filter(|field| !field.is_empty())
            .map_while(|field| field.parse().ok().filter(|value: &f64| value.is_finite()));
        let mut row = [0.0; N];
        for (column, entry) in row.iter_mut().enumerate() {
            *entry = fields.next().ok_or_else(|| {
                format!(
                    "{}:{number}: column {} of {N} is no number: {line:?}",
                    path.display(),
                    column + 1
                )
            })?;
        }
        rows.push(row);
    }
    if rows.is_empty() {
        return Err(format!("{}: no rows", path.display()).into());
    }
    Ok(rows)
}

fn read_text(path: &Path) -> std::io::Result<String> {
    let mut text = String::new();
    if path.exists() {
        File::open(path)?.read_to_string(&mut text)?;
    } else {
        let mut packed = path.as_os_str().to_owned();
        packed.push(".gz");
        flate2::read::GzDecoder::new(File::open(packed)?).read_to_string(&mut text)?;
    }
    Ok(text)
}
