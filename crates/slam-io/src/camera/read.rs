//! Wishes of the caller, and remarks for them: the choice of a camera, the image size of a file that has none, notes.

use std::path::Path;

use super::file::file_fault;
use crate::error::SequenceError;

/// Most names that a message lists.
const MOST_LISTED: usize = 4;

/// The caller's wishes during the reading of one file, and what the caller is to be told.
pub(super) struct Wanted<'a> {
    /// The camera to take from a file of several.
    pub(super) camera: Option<&'a str>,
    size: Option<[u32; 2]>,
    notes: Vec<String>,
}

impl<'a> Wanted<'a> {
    pub(super) fn new(camera: Option<&'a str>, size: Option<[u32; 2]>) -> Self {
        Wanted {
            camera,
            size,
            notes: Vec::new(),
        }
    }

    /// Adds a remark, one sentence.
    pub(super) fn note(&mut self, sentence: impl Into<String>) {
        self.notes.push(sentence.into());
    }

    /// The remarks.
    pub(super) fn into_notes(self) -> Vec<String> {
        self.notes
    }

    /// Refuses the choice of a camera where there is one alone.
    pub(super) fn only_camera(&self, path: &Path) -> Result<(), SequenceError> {
        match self.camera {
            None => Ok(()),
            Some(name) => Err(file_fault(
                path,
                format!("a file of several cameras to choose {name} from"),
                "a file of one camera",
            )),
        }
    }

    /// The camera asked for, else the only one, else `usual` with a remark, else the first with a remark.
    pub(super) fn choose(
        &mut self,
        path: &Path,
        names: &[String],
        usual: Option<&str>,
    ) -> Result<String, SequenceError> {
        let found = match self.camera {
            Some(name) => names.iter().find(|known| *known == name),
            None => names
                .iter()
                .find(|name| usual == Some(name))
                .or_else(|| names.first()),
        };
        let Some(found) = found else {
            let expected = match self.camera {
                Some(name) => format!("a camera {name}"),
                None => "a camera".to_owned(),
            };
            return Err(file_fault(path, expected, listed(names)));
        };
        if self.camera.is_none() && names.len() > 1 {
            self.notes.push(format!(
                "camera {found} of {} is taken; --camera chooses another",
                listed(names)
            ));
        }
        Ok(found.clone())
    }

    /// The image size, from the file or from the caller; `missing` names what the file should have had.
    pub(super) fn size_of(
        &self,
        path: &Path,
        found: Option<[u32; 2]>,
        missing: &str,
    ) -> Result<[u32; 2], SequenceError> {
        match (found, self.size) {
            (Some(found), Some(size)) if found != size => Err(file_fault(
                path,
                format!("images of {}x{} pixels as asked for", size[0], size[1]),
                format!("{}x{}", found[0], found[1]),
            )),
            (Some(size), _) | (None, Some(size)) => Ok(size),
            (None, None) => Err(file_fault(
                path,
                format!("{missing}, or --width and --height"),
                "none",
            )),
        }
    }
}

/// Names between commas, the first few of many.
pub(super) fn listed(names: &[String]) -> String {
    match names.len() {
        0 => "none".to_owned(),
        count if count <= MOST_LISTED => names.join(", "),
        count => format!(
            "{} and {} more",
            names[..MOST_LISTED - 1].join(", "),
            count + 1 - MOST_LISTED
        ),
    }
}
