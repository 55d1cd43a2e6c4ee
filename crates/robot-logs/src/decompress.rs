//! Chunks of a log, stored plain or compressed: LZ4 frames, bzip2, Zstandard, all of them in Rust.
//!
//! The size after decompression is known from the log. No more than it is ever produced, and the buffer grows with the
//! bytes that arrive, so that a false size or a bomb costs no more memory than the limit.

use std::io::Read;

use crate::error::Mismatch;

/// Largest believed size of a chunk or message after decompression, in bytes. Recorders write chunks of 0.75 to 4 MiB.
pub(crate) const LARGEST_BYTES: u64 = 1 << 30;

/// How bytes are stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Compression {
    None,
    Lz4,
    Bzip2,
    Zstd,
}

impl Compression {
    /// The compression of a name in a log.
    pub(crate) fn from_name(name: &str) -> Result<Self, Mismatch> {
        match name {
            "" | "none" => Ok(Self::None),
            "lz4" => Ok(Self::Lz4),
            "bz2" => Ok(Self::Bzip2),
            "zstd" => Ok(Self::Zstd),
            other => Err(Mismatch::new(
                "a chunk compressed by none, lz4, bz2 or zstd",
                format!("{:?}", other.chars().take(40).collect::<String>()),
            )),
        }
    }
}

/// Decompresses `bytes` to exactly `size` bytes.
pub(crate) fn decompress(
    bytes: &[u8],
    compression: Compression,
    size: u64,
) -> Result<Vec<u8>, Mismatch> {
    if size > LARGEST_BYTES {
        return Err(Mismatch::new(
            format!("a chunk of at most {LARGEST_BYTES} bytes"),
            format!("one of {size} bytes"),
        ));
    }
    let found = up_to(bytes, compression, size.saturating_add(1))?;
    if found.len() as u64 != size {
        let more = if found.len() as u64 > size {
            "more"
        } else {
            "fewer"
        };
        return Err(Mismatch::new(
            format!("a chunk of {size} bytes"),
            format!("{more} after decompression"),
        ));
    }
    Ok(found)
}

/// Decompresses a Zstandard frame whose size is not known, up to the limit.
pub(crate) fn zstd_message(bytes: &[u8]) -> Result<Vec<u8>, Mismatch> {
    let found = up_to(bytes, Compression::Zstd, LARGEST_BYTES + 1)?;
    if found.len() as u64 > LARGEST_BYTES {
        return Err(Mismatch::new(
            format!("a message of at most {LARGEST_BYTES} bytes"),
            "a larger one after decompression",
        ));
    }
    Ok(found)
}

/// The first `most` bytes after decompression, or all where they are fewer.
fn up_to(bytes: &[u8], compression: Compression, most: u64) -> Result<Vec<u8>, Mismatch> {
    let mut out = Vec::new();
    let (name, result) = match compression {
        Compression::None => {
            let count = bytes.len().min(usize::try_from(most).unwrap_or(usize::MAX));
            return Ok(bytes[..count].to_vec());
        }
        Compression::Lz4 => (
            "lz4",
            lz4_flex::frame::FrameDecoder::new(bytes)
                .take(most)
                .read_to_end(&mut out),
        ),
        Compression::Bzip2 => (
            "bzip2",
            bzip2::read::BzDecoder::new(bytes)
                .take(most)
                .read_to_end(&mut out),
        ),
        Compression::Zstd => (
            "zstd",
            ruzstd::decoding::StreamingDecoder::new(bytes)
                .map_err(std::io::Error::other)
                .and_then(|decoder| decoder.take(most).read_to_end(&mut out)),
        ),
    };
    match result {
        Ok(_) => Ok(out),
        Err(error) => Err(Mismatch::new(
            format!("bytes compressed by {name}"),
            format!("others ({})", error.to_string().replace('\n', " ")),
        )),
    }
}
