//! `map.slam`: a map that outlives its run, bit for bit.
//!
//! Little endian throughout; every number has a fixed size, so a map reads the same on every machine.
//!
//! | bytes | meaning |
//! |---|---|
//! | 8 | the letters `MONOSLAM` |
//! | 2, 2 | format version, major and minor, `u16` |
//! | 4 | number of sections, `u32` |
//! | per section: 4 | name, four letters |
//! | 8 | number of bytes that follow, `u64` |
//! | as many | its contents |
//! | 4 | CRC-32 (IEEE 802.3) of everything before it, `u32` |
//!
//! A newer minor version only adds sections, and a reader passes over those it does not know. `LAND` holds the landmarks as
//! points in the world, for viewers and for the report. `CAME`, `KEYF`, `ERRS` and `ANCH` hold what localisation
//! needs; a map has all of them or none. `docs/formats/map.md` lists the bytes of each.
//!
//! Version 1 had the landmarks alone. They are still read, while a run cannot begin in such a map.

use std::fs::File;
use std::io::Read as _;
use std::path::Path;

use slam_pipeline::{KnownMap, MapLandmark};

use super::atomic::{PendingFile, commit};
use super::error::OutputError;
use bytes::{Bytes, Fault};

mod bytes;
mod checks;
mod sections;

/// Version written.
const MAJOR: u16 = 2;
const MINOR: u16 = 0;
/// The version that held landmarks alone.
const LANDMARKS_ALONE: u16 = 1;

const MAGIC: &[u8; 8] = b"MONOSLAM";
const HEADER_BYTES: usize = 16;
const CHECKSUM_BYTES: usize = 4;
/// Name and length of a section.
const SECTION_HEADER_BYTES: usize = 12;

const LANDMARKS: [u8; 4] = *b"LAND";
const CAMERA: [u8; 4] = *b"CAME";
const KEYFRAMES: [u8; 4] = *b"KEYF";
const ANCHORED: [u8; 4] = *b"ANCH";
const ERRORS: [u8; 4] = *b"ERRS";

/// Contents of a map file.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct MapFile {
    pub(super) landmarks: Vec<MapLandmark>,
    pub(super) known: Option<KnownMap>,
}

/// Reads the landmarks of a map file as points in the world.
///
/// # Errors
/// [`OutputError::Io`] when the file cannot be read; [`OutputError::Malformed`] when the bytes are no map, of a newer
/// major version, cut short, longer than they say, fail their checksum, or hold impossible numbers.
pub fn read_map(path: &Path) -> Result<Vec<MapLandmark>, OutputError> {
    Ok(read(path)?.landmarks)
}

/// Reads the map in which a run can begin.
///
/// # Errors
/// As [`read_map`], and [`OutputError::Malformed`] for a map that holds landmarks alone.
pub fn read_known_map(path: &Path) -> Result<KnownMap, OutputError> {
    read(path)?.known.ok_or_else(|| {
        OutputError::malformed(
            path,
            "a map with camera and keyframes",
            "one with landmarks alone; run the sequence again to write it with them",
        )
    })
}

/// Writes a map file, so that it appears whole or not at all.
///
/// # Errors
/// [`OutputError::Io`] when the file system refuses.
pub fn write_map(
    path: &Path,
    landmarks: &[MapLandmark],
    known: Option<&KnownMap>,
) -> Result<(), OutputError> {
    commit(vec![PendingFile::write(
        path,
        &encode_map(landmarks, known),
    )?])
}

/// A number that tells maps apart: CRC-32 of their bytes.
#[must_use]
pub fn map_checksum(known: &KnownMap) -> u32 {
    crc32fast::hash(&encode_map(&[], Some(known)))
}

/// The bytes of a map file.
pub(super) fn encode_map(landmarks: &[MapLandmark], known: Option<&KnownMap>) -> Vec<u8> {
    let mut parts = vec![(LANDMARKS, sections::landmarks(landmarks, known))];
    if let Some(known) = known {
        parts.push((CAMERA, sections::camera(&known.camera)));
        parts.push((KEYFRAMES, sections::keyframes(&known.keyframes)));
        parts.push((ERRORS, sections::errors(&known.errors)));
        parts.push((ANCHORED, sections::anchored(&known.landmarks)));
    }
    encode_sections(MAJOR, MINOR, &parts)
}

fn encode_sections(major: u16, minor: u16, parts: &[([u8; 4], Vec<u8>)]) -> Vec<u8> {
    let mut bytes = Vec::new();
    bytes.extend_from_slice(MAGIC);
    bytes.extend_from_slice(&major.to_le_bytes());
    bytes.extend_from_slice(&minor.to_le_bytes());
    bytes.extend_from_slice(&(parts.len() as u32).to_le_bytes());
    for (name, contents) in parts {
        bytes.extend_from_slice(name);
        bytes.extend_from_slice(&(contents.len() as u64).to_le_bytes());
        bytes.extend_from_slice(contents);
    }
    bytes.extend_from_slice(&crc32fast::hash(&bytes).to_le_bytes());
    bytes
}

/// Reads a whole map file.
pub(super) fn read(path: &Path) -> Result<MapFile, OutputError> {
    let inside = path.join("map.slam");
    if inside.is_file() {
        let found = format!("the folder of one: give {}", inside.display());
        return Err(OutputError::malformed(path, "a map", found));
    }
    let cannot = |source| OutputError::io(path, "read", source);
    let mut file = File::open(path).map_err(cannot)?;
    let mut bytes = Vec::new();
    // The beginning first: a device without end is no map, and is not read to its end.
    file.by_ref()
        .take(HEADER_BYTES as u64)
        .read_to_end(&mut bytes)
        .map_err(cannot)?;
    if bytes.starts_with(MAGIC) {
        file.read_to_end(&mut bytes).map_err(cannot)?;
    }
    decode_map(path, &bytes)
}

/// A map from a file's bytes; `path` is for messages.
fn decode_map(path: &Path, bytes: &[u8]) -> Result<MapFile, OutputError> {
    decode(bytes).map_err(|fault| OutputError::malformed(path, fault.expected, fault.found))
}

fn decode(bytes: &[u8]) -> Result<MapFile, Fault> {
    if !bytes.starts_with(MAGIC) {
        let found = match bytes.len() {
            n if n < MAGIC.len() => format!("{n} bytes"),
            _ => "other bytes".to_owned(),
        };
        return Err(Fault::new("a map starting with MONOSLAM", found));
    }
    let least = HEADER_BYTES + CHECKSUM_BYTES;
    if bytes.len() < least {
        return Err(Fault::new(
            format!("a map of at least {least} bytes"),
            format!("{} bytes", bytes.len()),
        ));
    }
    let (content, checksum) = bytes.split_at(bytes.len() - CHECKSUM_BYTES);
    let mut rest = Bytes::new(&content[MAGIC.len()..]);
    let (major, minor) = (rest.u16()?, rest.u16()?);
    if major > MAJOR || major == 0 {
        return Err(Fault::new(
            format!("map format version {MAJOR} or older"),
            format!("version {major}.{minor}"),
        ));
    }
    let computed = crc32fast::hash(content);
    let written = Bytes::new(checksum).u32()?;
    if computed != written {
        return Err(Fault::new(
            format!("checksum {written:08x} as written at the end"),
            format!("{computed:08x}: the file is damaged or cut short"),
        ));
    }
    if major == LANDMARKS_ALONE {
        let landmarks = sections::read_landmarks(&mut rest, &[])?;
        rest.end("landmarks")?;
        return Ok(MapFile {
            landmarks,
            known: None,
        });
    }
    whole(&named(&mut rest)?)
}

/// A section: its name and its bytes.
type Section<'a> = ([u8; 4], &'a [u8]);

/// The sections by name.
fn named<'a>(rest: &mut Bytes<'a>) -> Result<Vec<Section<'a>>, Fault> {
    let count = rest.count("sections", SECTION_HEADER_BYTES)?;
    let mut sections: Vec<([u8; 4], &[u8])> = Vec::with_capacity(count);
    for _ in 0..count {
        let name: [u8; 4] = rest.take()?;
        let length = rest.u64()?;
        let title = String::from_utf8_lossy(&name);
        let contents = rest.slice(length).ok_or_else(|| {
            Fault::new(
                format!("{length} bytes of section {title:?}"),
                format!("{} left in the file", rest.left()),
            )
        })?;
        if sections.iter().any(|(known, _)| *known == name) {
            return Err(Fault::new(
                format!("section {title:?} once"),
                "a second one".to_owned(),
            ));
        }
        sections.push((name, contents));
    }
    rest.end("sections")?;
    Ok(sections)
}

fn whole(sections: &[([u8; 4], &[u8])]) -> Result<MapFile, Fault> {
    let find = |name: [u8; 4]| {
        let found = sections.iter().find(|(known, _)| *known == name);
        found.map(|(_, contents)| Bytes::new(contents))
    };
    let known = match (find(CAMERA), find(KEYFRAMES), find(ERRORS), find(ANCHORED)) {
        (None, None, None, None) => None,
        (Some(mut camera), Some(mut keyframes), Some(mut errors), Some(mut anchored)) => {
            let map = KnownMap {
                camera: sections::read_camera(&mut camera)?,
                keyframes: sections::read_keyframes(&mut keyframes)?,
                errors: sections::read_errors(&mut errors)?,
                landmarks: sections::read_anchored(&mut anchored)?,
            };
            camera.end("the camera")?;
            keyframes.end("keyframes")?;
            errors.end("the errors of keyframes")?;
            anchored.end("anchored landmarks")?;
            checks::anchors_in_range(&map)?;
            checks::errors(&map)?;
            Some(map)
        }
        _ => {
            return Err(Fault::new(
                "sections CAME, KEYF, ERRS and ANCH together",
                "some of them alone",
            ));
        }
    };
    let anchored = known.as_ref().map_or(&[][..], |map| &map.landmarks);
    let Some(mut points) = find(LANDMARKS) else {
        return Err(Fault::new("section LAND", "none"));
    };
    let landmarks = sections::read_landmarks(&mut points, anchored)?;
    points.end("landmarks")?;
    Ok(MapFile { landmarks, known })
}

#[cfg(test)]
mod tests;
