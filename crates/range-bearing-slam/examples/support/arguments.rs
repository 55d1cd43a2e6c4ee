//! The arguments of the examples, `--quick` and `--out FOLDER`.

use std::error::Error;
use std::path::PathBuf;

/// The arguments of an example.
#[derive(Clone, Debug, Default)]
pub(crate) struct Arguments {
    /// Whether to do fewer runs, or to take less of a recording.
    pub(crate) quick: bool,
    /// Folder of the CSV files; it is made if it does not exist.
    pub(crate) out: Option<PathBuf>,
}

impl Arguments {
    /// Parses the command line.
    ///
    /// # Errors
    /// An argument that is not known, or a folder that cannot be made.
    pub(crate) fn parse() -> Result<Self, Box<dyn Error>> {
        let mut parsed = Self::default();
        let mut arguments = std::env::args().skip(1);
        while let Some(argument) = arguments.next() {
            match argument.as_str() {
                "--quick" => parsed.quick = true,
                "--out" => {
                    let folder = arguments.next().ok_or("--out needs a folder")?;
                    std::fs::create_dir_all(&folder)
                        .map_err(|error| format!("{folder}: {error}"))?;
                    parsed.out = Some(PathBuf::from(folder));
                }
                other => {
                    return Err(
                        format!("unknown argument {other}; known: --quick, --out FOLDER").into(),
                    );
                }
            }
        }
        Ok(parsed)
    }
}
