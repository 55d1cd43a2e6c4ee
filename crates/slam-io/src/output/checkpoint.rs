//! Checkpoints: a run in the middle, to go on from after a crash.
//!
//! Little endian throughout:
//!
//! | bytes | meaning |
//! |---|---|
//! | 8 | the letters `MONOCKPT` |
//! | 4 | format version, `u32` |
//! | 4 | number of entries of the run's identity, `u32` |
//! | per entry: 4, as many | length of the name, name in UTF-8 |
//! | 4, as many | length of the value, value in UTF-8 |
//! | 8, as many | length of the state, state |
//! | 4 | CRC-32 (IEEE 802.3) of everything before it, `u32` |
//!
//! The state is for the same version of the program and for nobody else; the identity says which run it belongs to.

use std::fs::{self, File};
use std::io::Read as _;
use std::path::{Path, PathBuf};

use crate::output::atomic::{PendingFile, commit};
use crate::output::error::OutputError;
use crate::output::target::parent_of;
use crate::sequence::Sequence;

const MAGIC: &[u8; 8] = b"MONOCKPT";
/// Version written, and the only one read.
const FORMAT_VERSION: u32 = 3;
const CHECKSUM_BYTES: usize = 4;
/// Length of a value beyond which a message names its checksum only.
const QUOTED: usize = 80;

/// The facts that two parts of one run have in common: name and value, in order.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RunIdentity(Vec<(String, String)>);

/// A run in the middle.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Checkpoint {
    /// The run it belongs to.
    pub identity: RunIdentity,
    /// Its state, for the same version of the program.
    pub state: Vec<u8>,
}

impl RunIdentity {
    /// The identity of a run of `sequence` under a configuration, in a map (its use and its checksum) or in none.
    ///
    /// It holds everything that the results depend on but the pixels: an image may be mended before a run goes on.
    #[must_use]
    pub fn of(sequence: &Sequence, configuration: &str, map: Option<(&str, u32)>) -> Self {
        let numbers = |values: &mut dyn Iterator<Item = f64>| {
            let mut hasher = crc32fast::Hasher::new();
            let mut count = 0;
            for value in values {
                hasher.update(&value.to_bits().to_le_bytes());
                count += 1;
            }
            format!("{count} numbers, checksum {:08x}", hasher.finalize())
        };
        let odometry = &mut sequence
            .odometry
            .iter()
            .flat_map(|row| [row.t_s, row.v_mps, row.omega_radps]);
        let reference = &mut sequence
            .reference
            .iter()
            .flatten()
            .flat_map(|(t_s, pose)| [*t_s, pose.x, pose.y, pose.phi]);
        let entries = [
            (
                "program",
                format!("mono-slam {}", env!("CARGO_PKG_VERSION")),
            ),
            ("sequence", sequence.name.clone()),
            (
                "times of the images",
                numbers(&mut sequence.times_s.iter().copied()),
            ),
            (
                "odometry",
                format!("{}: {}", sequence.odometry_source, numbers(odometry)),
            ),
            ("reference", numbers(reference)),
            ("camera", format!("{:?}", sequence.camera)),
            ("configuration", configuration.to_owned()),
            (
                "map",
                map.map_or_else(
                    || "none".to_owned(),
                    |(usage, checksum)| format!("{usage}, checksum {checksum:08x}"),
                ),
            ),
        ];
        Self(
            entries
                .map(|(name, value)| (name.to_owned(), value))
                .to_vec(),
        )
    }

    /// The first thing in which `other` differs, as a clause; `None` for the same run.
    #[must_use]
    pub fn difference(&self, other: &Self) -> Option<String> {
        for (name, value) in &self.0 {
            let Some((_, theirs)) = other.0.iter().find(|(known, _)| known == name) else {
                return Some(format!("it says nothing of the {name}"));
            };
            if value != theirs {
                let (here, there) = first_difference(value, theirs);
                return Some(format!("the {name} was {there} and is {here} now"));
            }
        }
        None
    }
}

/// The lines in which two texts first differ, as a message quotes them.
fn first_difference(here: &str, there: &str) -> (String, String) {
    let (mut ours, mut theirs) = (here.lines(), there.lines());
    loop {
        match (ours.next(), theirs.next()) {
            (Some(a), Some(b)) if a == b => {}
            (a, b) => return (quoted(a), quoted(b)),
        }
    }
}

fn quoted(line: Option<&str>) -> String {
    match line.map(|text| text.split('#').next().unwrap_or_default().trim()) {
        None | Some("") => "nothing".to_owned(),
        Some(text) if text.len() > QUOTED => {
            format!("another ({:08x})", crc32fast::hash(text.as_bytes()))
        }
        Some(text) => format!("`{text}`"),
    }
}

/// Writes a checkpoint so that it appears whole or not at all: an older one stays valid until the new one is on disk.
///
/// # Errors
/// [`OutputError::Io`] when the file system refuses.
pub fn write_checkpoint(path: &Path, checkpoint: &Checkpoint) -> Result<(), OutputError> {
    commit(vec![PendingFile::write(path, &encode(checkpoint))?])
}

/// Removes a checkpoint, and what processes that were killed while writing it have left; there may be none of both.
///
/// # Errors
/// [`OutputError::Io`] when the file system refuses.
pub fn remove_checkpoint(path: &Path) -> Result<(), OutputError> {
    for leftover in unfinished(path) {
        // Somebody else's business when it cannot be removed: nothing reads it.
        drop(fs::remove_file(leftover));
    }
    match fs::remove_file(path) {
        Err(source) if source.kind() != std::io::ErrorKind::NotFound => {
            Err(OutputError::io(path, "removed", source))
        }
        _ => Ok(()),
    }
}

/// Temporary files of earlier writers of `path`.
fn unfinished(path: &Path) -> Vec<PathBuf> {
    let Some(name) = path.file_name().and_then(|name| name.to_str()) else {
        return Vec::new();
    };
    let is_leftover = |found: &str| {
        let process = found
            .strip_prefix(name)
            .and_then(|rest| rest.strip_prefix('.'))
            .and_then(|rest| rest.strip_suffix(".tmp"));
        process.is_some_and(|digits| digits.parse::<u32>().is_ok())
    };
    fs::read_dir(parent_of(path))
        .into_iter()
        .flatten()
        .flatten()
        .filter(|entry| entry.file_name().to_str().is_some_and(is_leftover))
        .map(|entry| entry.path())
        .collect()
}

/// Reads a checkpoint.
///
/// # Errors
/// [`OutputError::Io`] when the file cannot be read; [`OutputError::Malformed`] when the bytes are no checkpoint, of another
/// version, cut short or damaged.
pub fn read_checkpoint(path: &Path) -> Result<Checkpoint, OutputError> {
    let cannot = |source| OutputError::io(path, "read", source);
    let mut file = File::open(path).map_err(cannot)?;
    let mut bytes = Vec::new();
    // The beginning first: a device without end is no checkpoint, and is not read to its end.
    file.by_ref()
        .take(MAGIC.len() as u64)
        .read_to_end(&mut bytes)
        .map_err(cannot)?;
    if bytes == MAGIC {
        file.read_to_end(&mut bytes).map_err(cannot)?;
    }
    decode(&bytes).map_err(|(expected, found)| OutputError::malformed(path, expected, found))
}

fn encode(checkpoint: &Checkpoint) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(checkpoint.state.len() + 16_384);
    bytes.extend_from_slice(MAGIC);
    bytes.extend_from_slice(&FORMAT_VERSION.to_le_bytes());
    let entries = &checkpoint.identity.0;
    bytes.extend_from_slice(&(entries.len() as u32).to_le_bytes());
    for text in entries.iter().flat_map(|(name, value)| [name, value]) {
        bytes.extend_from_slice(&(text.len() as u32).to_le_bytes());
        bytes.extend_from_slice(text.as_bytes());
    }
    bytes.extend_from_slice(&(checkpoint.state.len() as u64).to_le_bytes());
    bytes.extend_from_slice(&checkpoint.state);
    bytes.extend_from_slice(&crc32fast::hash(&bytes).to_le_bytes());
    bytes
}

fn decode(bytes: &[u8]) -> Result<Checkpoint, (String, String)> {
    let fault = |expected: &str, found: String| (expected.to_owned(), found);
    if !bytes.starts_with(MAGIC) {
        return Err(fault(
            "a checkpoint starting with MONOCKPT",
            match bytes.len() {
                n if n < MAGIC.len() => format!("{n} bytes"),
                _ => "other bytes".to_owned(),
            },
        ));
    }
    let cut = || fault("a whole checkpoint", "one cut short".to_owned());
    let (content, checksum) = bytes.split_last_chunk::<CHECKSUM_BYTES>().ok_or_else(cut)?;
    let mut rest = content.get(MAGIC.len()..).ok_or_else(cut)?;
    let version = take_u32(&mut rest).ok_or_else(cut)?;
    if version != FORMAT_VERSION {
        return Err(fault(
            &format!("checkpoint version {FORMAT_VERSION}"),
            version.to_string(),
        ));
    }
    let (computed, written) = (crc32fast::hash(content), u32::from_le_bytes(*checksum));
    if computed != written {
        return Err(fault(
            &format!("checksum {written:08x} as written at the end"),
            format!("{computed:08x}: the file is damaged or cut short"),
        ));
    }
    let mut entries = Vec::new();
    for _ in 0..take_u32(&mut rest).ok_or_else(cut)? {
        let name = take_text(&mut rest).ok_or_else(cut)?;
        entries.push((name, take_text(&mut rest).ok_or_else(cut)?));
    }
    let (length, state) = rest.split_first_chunk::<8>().ok_or_else(cut)?;
    if u64::from_le_bytes(*length) != state.len() as u64 {
        return Err(cut());
    }
    Ok(Checkpoint {
        identity: RunIdentity(entries),
        state: state.to_vec(),
    })
}

fn take_u32(rest: &mut &[u8]) -> Option<u32> {
    let (head, tail) = rest.split_first_chunk::<4>()?;
    *rest = tail;
    Some(u32::from_le_bytes(*head))
}

fn take_text(rest: &mut &[u8]) -> Option<String> {
    let length = take_u32(rest)? as usize;
    let (head, tail) = rest.split_at_checked(length)?;
    *rest = tail;
    String::from_utf8(head.to_vec()).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn checkpoint(configuration: &str) -> Checkpoint {
        let entries = [
            ("program", "mono-slam 0.1.0"),
            ("configuration", configuration),
        ];
        Checkpoint {
            identity: RunIdentity(
                entries
                    .map(|(name, value)| (name.to_owned(), value.to_owned()))
                    .to_vec(),
            ),
            state: (0..200).collect(),
        }
    }

    #[test]
    fn a_checkpoint_reads_back_and_damage_is_noticed() {
        let whole = checkpoint("[filter]\nparticles = 30 # how many\n");
        let bytes = encode(&whole);
        assert_eq!(decode(&bytes).unwrap(), whole);
        for length in 0..bytes.len() {
            assert!(decode(&bytes[..length]).is_err(), "cut to {length} bytes");
        }
        for position in 0..bytes.len() {
            let mut damaged = bytes.clone();
            damaged[position] ^= 0x04;
            assert!(decode(&damaged).is_err(), "byte {position} flipped");
            // With a checksum that fits, the lengths are still compared with the bytes there are.
            let content = damaged.len() - CHECKSUM_BYTES;
            let checksum = crc32fast::hash(&damaged[..content]);
            damaged[content..].copy_from_slice(&checksum.to_le_bytes());
            drop(decode(&damaged));
        }
        let (expected, found) = decode(b"MONOSLAMandmore").unwrap_err();
        assert_eq!(
            (expected.as_str(), found.as_str()),
            ("a checkpoint starting with MONOCKPT", "other bytes")
        );
    }

    #[test]
    fn another_run_is_told_by_the_first_line_that_differs() {
        let thirty = checkpoint("[filter]\nparticles = 30 # how many\nseed = 1\n").identity;
        let fifty = checkpoint("[filter]\nparticles = 50 # how many\nseed = 2\n").identity;
        assert_eq!(thirty.difference(&thirty), None);
        assert_eq!(
            fifty.difference(&thirty).unwrap(),
            "the configuration was `particles = 30` and is `particles = 50` now"
        );
        let longer = checkpoint("[filter]\nparticles = 30 # how many\nseed = 1\nlag = 3").identity;
        assert_eq!(
            longer.difference(&thirty).unwrap(),
            "the configuration was nothing and is `lag = 3` now"
        );
        let one = RunIdentity(thirty.0[..1].to_vec());
        assert_eq!(
            thirty.difference(&one).unwrap(),
            "it says nothing of the configuration"
        );
    }

    #[test]
    fn leftovers_of_killed_writers_go_with_the_checkpoint_and_nothing_else() {
        let folder = std::env::temp_dir().join(format!("slam-io-leftovers-{}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        let path = folder.join("out.checkpoint");
        for name in [
            "out.checkpoint.17.tmp",
            "out.checkpoint.4000000000.tmp",
            "out.checkpoint.old.tmp",
            "out.checkpoint.17",
            "other.checkpoint.17.tmp",
        ] {
            fs::write(folder.join(name), "half").unwrap();
        }
        write_checkpoint(&path, &checkpoint("")).unwrap();
        remove_checkpoint(&path).unwrap();
        let mut left: Vec<String> = fs::read_dir(&folder)
            .unwrap()
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        left.sort();
        assert_eq!(
            left,
            [
                "other.checkpoint.17.tmp",
                "out.checkpoint.17",
                "out.checkpoint.old.tmp"
            ]
        );
        fs::remove_dir_all(&folder).unwrap();
    }
}
