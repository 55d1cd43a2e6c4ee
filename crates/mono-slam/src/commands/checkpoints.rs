//! Checkpoints of a run: where they are, when they are written, and whether one belongs to this run.
//!
//! The checkpoint of results in `DIR` is the file `DIR.checkpoint` beside it: `DIR` itself appears with its results only.
//! It is replaced as a whole, so that a process that is killed while writing leaves the one before, and removed when the
//! results are written.

use std::path::{Path, PathBuf};

use mono_slam::run::{Run, RunError};
use slam_io::{
    Checkpoint, RunIdentity, check_output_file, read_checkpoint, remove_checkpoint,
    write_checkpoint,
};

use super::threshold::whole;
use crate::failure::{Failure, remark};

/// Options of commands that may go on later.
#[derive(Debug, clap::Args)]
pub(crate) struct CheckpointOptions {
    /// Write a checkpoint to DIR.checkpoint every so many frames, to go on from after a crash; 0 writes one on Ctrl-C only.
    /// It costs some hundredths of a second and grows with the run
    #[arg(long, value_name = "FRAMES", default_value = "0", value_parser = whole::<u32>)]
    checkpoint_every: u32,
    /// Go on from DIR.checkpoint; the results are those of an unbroken run. Begins anew where there is none
    #[arg(long)]
    resume: bool,
}

/// The checkpoint of one run.
#[derive(Debug)]
pub(crate) struct Checkpoints {
    path: PathBuf,
    every: usize,
    resume: bool,
    identity: RunIdentity,
}

impl Checkpoints {
    /// The checkpoint of a run whose results go to `out`.
    pub(crate) fn of(
        options: &CheckpointOptions,
        out: &Path,
        identity: RunIdentity,
    ) -> Result<Self, Failure> {
        let path = beside(out);
        let every = options.checkpoint_every as usize;
        if every > 0 {
            if let Some(parent) = path.parent().filter(|p| !p.as_os_str().is_empty()) {
                std::fs::create_dir_all(parent).map_err(|error| {
                    Failure::input(format!("{}: cannot be created: {error}", parent.display()))
                })?;
            }
            check_output_file(&path)?;
        }
        if !options.resume && path.exists() {
            remark(&format!(
                "{} is of an earlier run and will be replaced; --resume would go on from it",
                path.display()
            ));
        }
        Ok(Self {
            path,
            every,
            resume: options.resume,
            identity,
        })
    }

    /// The state to go on from, if that was asked for and there is one.
    pub(crate) fn stored(&self) -> Result<Option<Vec<u8>>, Failure> {
        if !self.resume {
            return Ok(None);
        }
        if !self.path.exists() {
            remark(&format!(
                "there is no {}: the run begins at its first frame",
                self.path.display()
            ));
            return Ok(None);
        }
        let checkpoint = read_checkpoint(&self.path)?;
        match self.identity.difference(&checkpoint.identity) {
            None => Ok(Some(checkpoint.state)),
            Some(difference) => Err(Failure::input(format!(
                "{}: it is of another run: {difference}; without --resume the run begins anew",
                self.path.display()
            ))),
        }
    }

    /// The failure of a state that the run refuses.
    pub(crate) fn refused(&self, error: &RunError) -> Failure {
        Failure::input(format!("{}: {error}", self.path.display()))
    }

    /// Writes a checkpoint when one is due after the frame just done.
    pub(crate) fn after(&self, run: &mut Run<'_>) -> Result<(), Failure> {
        if self.every > 0 && run.frames() % self.every == 0 {
            self.save(run)?;
        }
        Ok(())
    }

    /// Writes a checkpoint.
    pub(crate) fn save(&self, run: &mut Run<'_>) -> Result<(), Failure> {
        let checkpoint = Checkpoint {
            identity: self.identity.clone(),
            state: run.state()?,
        };
        Ok(write_checkpoint(&self.path, &checkpoint)?)
    }

    /// Removes the checkpoint of a run whose results are written.
    pub(crate) fn remove(&self) -> Result<(), Failure> {
        Ok(remove_checkpoint(&self.path)?)
    }
}

/// `DIR.checkpoint` for the folder `DIR`.
fn beside(out: &Path) -> PathBuf {
    // A name such as `.` or `..` stands for another one.
    let real = match out.file_name() {
        Some(_) => out.to_path_buf(),
        None => out.canonicalize().unwrap_or_else(|_| out.to_path_buf()),
    };
    match real.file_name() {
        Some(name) => {
            let mut name = name.to_os_string();
            name.push(".checkpoint");
            real.with_file_name(name)
        }
        None => real.join("checkpoint"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_checkpoint_lies_beside_its_folder() {
        assert_eq!(
            beside(Path::new("results/a")),
            Path::new("results/a.checkpoint")
        );
        assert_eq!(beside(Path::new("a.b/")), Path::new("a.b.checkpoint"));
        let here = std::env::current_dir().expect("a current folder");
        let expected = format!("{}.checkpoint", here.display());
        assert_eq!(beside(Path::new(".")), Path::new(&expected));
        assert_eq!(beside(Path::new("/")), Path::new("/checkpoint"));
    }
}
