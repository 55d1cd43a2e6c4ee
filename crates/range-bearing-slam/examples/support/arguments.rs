//! `--quick` and `--out FOLDER`.

use std::error::Error;
use std::path::PathBuf;

/// What an example was asked for.
#[derive(Clone, Debug, Default)]
pub(crate) struct Arguments {
    /// Fewer runs or less of a recording.
    pub(crate) quick: bool,
    /// Where CSV files go; made if it is not there.
    pub(crate) out: Option<PathBuf>,
}

impl Arguments {
    /// From the command line.
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
