//! How a command can fail, and the exit code that goes with it.

use std::fmt;
use std::io::{self, Write as _};
use std::path::Path;

use camera_calibration::CalibrateError;
use mono_slam::recorded::RecordedError;
use mono_slam::refine::RefineError;
use mono_slam::run::RunError;
use slam_io::{OutputError, SequenceError};
use slam_pipeline::SlamError;
use trajectory_eval::EvaluationError;

/// Exit code of a process that a signal ended, less the number of the signal.
pub(crate) const SIGNAL_CODE: i32 = 128;

/// A failed command.
#[derive(Debug)]
pub(crate) enum Failure {
    /// The input or the arguments are wrong: exit code 2.
    Input(anyhow::Error),
    /// A threshold was not met: exit code 3.
    Threshold(String),
    /// A signal asked the process to end: exit code 128 and its number.
    Interrupted {
        /// Number of the signal.
        signal: i32,
        /// The fate of the work.
        sentence: String,
    },
    /// Anything else: exit code 1.
    Other(anyhow::Error),
}

impl Failure {
    /// Bad input described by a sentence.
    pub(crate) fn input(sentence: String) -> Failure {
        Failure::Input(anyhow::Error::msg(sentence))
    }

    /// The same failure, with a clause about its consequence behind its message.
    pub(crate) fn with(self, consequence: &str) -> Failure {
        let sentence = format!("{self}; {consequence}");
        match self {
            Failure::Input(_) => Failure::input(sentence),
            Failure::Other(_) => Failure::Other(anyhow::Error::msg(sentence)),
            Failure::Threshold(_) => Failure::Threshold(sentence),
            Failure::Interrupted { signal, .. } => Failure::Interrupted { signal, sentence },
        }
    }

    /// The process's exit code.
    pub(crate) fn exit_code(&self) -> u8 {
        match self {
            Failure::Interrupted { signal, .. } => (SIGNAL_CODE + signal) as u8,
            Failure::Other(_) => 1,
            Failure::Input(_) => 2,
            Failure::Threshold(_) => 3,
        }
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            // The alternate form names the causes too, in one line.
            Failure::Input(error) | Failure::Other(error) => write!(formatter, "{error:#}"),
            Failure::Threshold(sentence) | Failure::Interrupted { sentence, .. } => {
                formatter.write_str(sentence)
            }
        }
    }
}

impl From<SequenceError> for Failure {
    fn from(error: SequenceError) -> Self {
        Failure::input(error.to_string())
    }
}

impl From<RunError> for Failure {
    fn from(error: RunError) -> Self {
        match error {
            RunError::Sequence(_)
            | RunError::Camera(_)
            | RunError::Sigma(_)
            | RunError::State(_)
            | RunError::Slam(SlamError::Map { .. })
            | RunError::Features(_) => Failure::input(error.to_string()),
            RunError::Slam(_) | RunError::Threads(_) => Failure::Other(error.into()),
        }
    }
}

impl From<RecordedError> for Failure {
    fn from(error: RecordedError) -> Self {
        match error {
            RecordedError::Output(error) => error.into(),
            error => Failure::input(error.to_string()),
        }
    }
}

impl From<RefineError> for Failure {
    fn from(error: RefineError) -> Self {
        Failure::input(error.to_string())
    }
}

impl From<CalibrateError> for Failure {
    fn from(error: CalibrateError) -> Self {
        Failure::input(error.to_string())
    }
}

impl From<EvaluationError> for Failure {
    fn from(error: EvaluationError) -> Self {
        Failure::Input(error.into())
    }
}

impl From<OutputError> for Failure {
    fn from(error: OutputError) -> Self {
        let sentence = error.to_string();
        match error {
            OutputError::Malformed { .. }
            | OutputError::Unusable { .. }
            | OutputError::NoRun { .. }
            // A full disk or a folder without permission is the user's to mend.
            | OutputError::Io { .. } => Failure::input(sentence),
            _ => Failure::Other(anyhow::Error::msg(sentence)),
        }
    }
}

/// Writes to standard output; a reader that went away (`| head`) is no failure.
pub(crate) fn print(text: &str) -> Result<(), Failure> {
    let mut out = io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => Err(Failure::Other(
            anyhow::Error::new(error).context("standard output cannot be written"),
        )),
        _ => Ok(()),
    }
}

/// Refuses an output that is one of the inputs or that two results share; `what` names each.
pub(crate) fn distinct(files: &[(&str, &Path)]) -> Result<(), Failure> {
    let real = |path: &Path| path.canonicalize().unwrap_or_else(|_| path.to_path_buf());
    for (index, (what, path)) in files.iter().enumerate() {
        for (other, earlier) in &files[..index] {
            if real(path) == real(earlier) {
                return Err(Failure::input(format!(
                    "{what} and {other} are the same file: {}",
                    path.display()
                )));
            }
        }
    }
    Ok(())
}

/// One line on standard error; with nobody listening there is nobody to tell.
pub(crate) fn tell(line: &str) {
    let _ = writeln!(io::stderr(), "{line}");
}

/// A remark for the user on standard error, one sentence.
pub(crate) fn remark(sentence: &str) {
    // With standard error closed there is nobody left to tell.
    let _ = writeln!(io::stderr(), "mono-slam: note: {sentence}");
}
