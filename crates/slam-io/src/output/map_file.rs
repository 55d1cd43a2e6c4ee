//! `map.slam`: the landmarks, bit for bit.
//!
//! Little endian throughout:
//!
//! | bytes | meaning |
//! |---|---|
//! | 8 | the letters `MONOSLAM` |
//! | 4 | format version, `u32` |
//! | 4 | number of landmarks, `u32` |
//! | per landmark: 4, 4 | id, observations, `u32` |
//! | 24 | position x, y, z in metres, `f64` |
//! | 72 | covariance row by row in m^2, `f64` |
//! | 1 (+128) | 1 and the descriptor's bytes, or 0 |
//! | 4 | CRC-32 (IEEE 802.3) of everything before it, `u32` |

use std::fs;
use std::path::Path;

use nalgebra::{Matrix3, Vector3};

use slam_pipeline::MapLandmark;

use super::error::OutputError;

/// Version written, and the only one read.
const MAP_FORMAT_VERSION: u32 = 1;

const MAGIC: &[u8; 8] = b"MONOSLAM";
const HEADER_BYTES: usize = 16;
const CHECKSUM_BYTES: usize = 4;
const DESCRIPTOR_BYTES: usize = 128;
/// A landmark without its descriptor.
const LANDMARK_BYTES: usize = 4 + 4 + 24 + 72 + 1;

/// The bytes of a map file.
pub(super) fn encode_map(landmarks: &[MapLandmark]) -> Vec<u8> {
    let largest =
        HEADER_BYTES + landmarks.len() * (LANDMARK_BYTES + DESCRIPTOR_BYTES) + CHECKSUM_BYTES;
    let mut bytes = Vec::with_capacity(largest);
    bytes.extend_from_slice(MAGIC);
    bytes.extend_from_slice(&MAP_FORMAT_VERSION.to_le_bytes());
    // Ids are u32 and unique, so the count fits.
    bytes.extend_from_slice(&(landmarks.len() as u32).to_le_bytes());
    for landmark in landmarks {
        bytes.extend_from_slice(&landmark.id.to_le_bytes());
        bytes.extend_from_slice(&landmark.observations.to_le_bytes());
        for value in &landmark.position {
            bytes.extend_from_slice(&value.to_le_bytes());
        }
        for row in 0..3 {
            for column in 0..3 {
                bytes.extend_from_slice(&landmark.covariance[(row, column)].to_le_bytes());
            }
        }
        bytes.push(u8::from(landmark.descriptor.is_some()));
        if let Some(descriptor) = &landmark.descriptor {
            bytes.extend_from_slice(descriptor.as_slice());
        }
    }
    bytes.extend_from_slice(&crc32fast::hash(&bytes).to_le_bytes());
    bytes
}

/// Reads the landmarks of a map file.
///
/// # Errors
/// [`OutputError::Io`] when the file cannot be read; [`OutputError::Malformed`] when the bytes are no map, of another
/// version, cut short, longer than they say, or fail their checksum.
pub fn read_map(path: &Path) -> Result<Vec<MapLandmark>, OutputError> {
    let bytes = fs::read(path).map_err(|source| OutputError::io(path, "read", source))?;
    decode_map(path, &bytes)
}

/// Landmarks from a map file's bytes; `path` is for messages.
fn decode_map(path: &Path, bytes: &[u8]) -> Result<Vec<MapLandmark>, OutputError> {
    let fault = |expected: String, found: String| OutputError::malformed(path, expected, found);
    if bytes.len() < HEADER_BYTES + CHECKSUM_BYTES {
        let least = HEADER_BYTES + CHECKSUM_BYTES;
        return Err(fault(
            format!("a map of at least {least} bytes"),
            format!("{} bytes", bytes.len()),
        ));
    }
    if !bytes.starts_with(MAGIC) {
        return Err(fault(
            "a map starting with MONOSLAM".into(),
            "other bytes".into(),
        ));
    }
    let (content, checksum) = bytes.split_at(bytes.len() - CHECKSUM_BYTES);
    let mut rest = Bytes(&content[MAGIC.len()..]);
    let truncated = || fault("a whole map".into(), "a truncated one".into());
    let version = rest.u32().ok_or_else(truncated)?;
    if version != MAP_FORMAT_VERSION {
        return Err(fault(
            format!("map format version {MAP_FORMAT_VERSION}"),
            version.to_string(),
        ));
    }
    let count = rest.u32().ok_or_else(truncated)? as usize;
    // Nothing is reserved for a count that the bytes cannot hold.
    if rest.0.len() / LANDMARK_BYTES < count {
        return Err(fault(
            format!("{count} landmarks"),
            format!("a file cut short after {} bytes", bytes.len()),
        ));
    }
    let expected_crc = crc32fast::hash(content);
    let found_crc = Bytes(checksum).u32().ok_or_else(truncated)?;
    if expected_crc != found_crc {
        return Err(fault(
            format!("checksum {found_crc:08x} as written at the end"),
            format!("{expected_crc:08x}: the file is damaged or cut short"),
        ));
    }
    let mut landmarks = Vec::with_capacity(count);
    for _ in 0..count {
        landmarks.push(rest.landmark().ok_or_else(truncated)?);
    }
    if !rest.0.is_empty() {
        return Err(fault(
            "the end of the map".into(),
            format!("{} more bytes", rest.0.len()),
        ));
    }
    Ok(landmarks)
}

/// Bytes not yet read.
struct Bytes<'a>(&'a [u8]);

impl Bytes<'_> {
    fn take<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (head, tail) = self.0.split_first_chunk::<N>()?;
        self.0 = tail;
        Some(*head)
    }

    fn u32(&mut self) -> Option<u32> {
        self.take().map(u32::from_le_bytes)
    }

    fn f64(&mut self) -> Option<f64> {
        self.take().map(f64::from_le_bytes)
    }

    fn landmark(&mut self) -> Option<MapLandmark> {
        let id = self.u32()?;
        let observations = self.u32()?;
        let position = Vector3::new(self.f64()?, self.f64()?, self.f64()?);
        let mut covariance = Matrix3::zeros();
        for row in 0..3 {
            for column in 0..3 {
                covariance[(row, column)] = self.f64()?;
            }
        }
        let descriptor = match self.take::<1>()? {
            [0] => None,
            [1] => Some(Box::new(self.take::<DESCRIPTOR_BYTES>()?)),
            _ => return None,
        };
        Some(MapLandmark {
            id,
            position,
            covariance,
            observations,
            descriptor,
        })
    }
}

#[cfg(test)]
mod tests;
