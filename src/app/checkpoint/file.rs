//! A checkpoint file: eight letters, the version of the format, the content encoded by `postcard`, and a hash of all
//! these.
//!
//! The beginning and the end are the same in every version, so that damage can be distinguished from another version.

use std::fs;
use std::io::{self, BufWriter, Write};
use std::path::Path;

use serde::Serialize;
use serde::de::DeserializeOwned;

use super::CheckpointError;
use crate::app::results::ResultsError;
use crate::checksum::Fnv;
use crate::output;

const MAGIC: &[u8; 8] = b"BIOTISSU";
/// The version of the format, incremented whenever the content changes.
const VERSION: u32 = 6;
const HEAD: usize = MAGIC.len() + size_of::<u32>();
const TAIL: usize = size_of::<u64>();

/// Returns true if a file, which may be truncated, begins like a checkpoint of any version.
pub(super) fn is_begin(bytes: &[u8]) -> bool {
    MAGIC.starts_with(&bytes[..bytes.len().min(MAGIC.len())])
}

/// Writes a checkpoint; an existing file is replaced only when the new one is complete.
pub(super) fn write(path: &Path, content: &impl Serialize) -> Result<(), ResultsError> {
    let written = output::replace_by(path, |file| {
        let mut out = Hashing { to: BufWriter::new(file), hash: Fnv::new(), failed: None };
        out.write_all(MAGIC)?;
        out.write_all(&VERSION.to_le_bytes())?;
        if let Err(error) = postcard::to_io(content, &mut out) {
            return Err(out.failed.take().unwrap_or_else(|| io::Error::other(error)));
        }
        let Hashing { mut to, hash, .. } = out;
        to.write_all(&hash.finish().to_le_bytes())?;
        to.flush()
    });
    written.map_err(ResultsError::write(path))
}

/// Reads a checkpoint. The memory allocated is limited by the length of the file, whatever counts it contains.
pub(super) fn read<T: DeserializeOwned>(path: &Path) -> Result<T, CheckpointError> {
    let bytes = fs::read(path).map_err(|source| CheckpointError::Unreadable(path.into(), source))?;
    let damaged = |what: String| CheckpointError::Damaged(path.into(), what);
    if !bytes.starts_with(MAGIC) {
        return Err(damaged("does not begin like a checkpoint".into()));
    }
    let (body, tail) = bytes.split_last_chunk::<TAIL>().filter(|(body, _)| body.len() >= HEAD).ok_or_else(|| {
        damaged(format!("ends after {} bytes; the shortest checkpoint has {}", bytes.len(), HEAD + TAIL))
    })?;
    let mut hash = Fnv::new();
    hash.add_bytes(body);
    if hash.finish() != u64::from_le_bytes(*tail) {
        return Err(damaged(format!("its {} bytes do not match their hash: truncated or changed", bytes.len())));
    }
    let (version, content) = body[MAGIC.len()..].split_first_chunk().unwrap_or((&[0; 4], &[]));
    let found = u32::from_le_bytes(*version);
    if found != VERSION {
        return Err(CheckpointError::Version { path: path.into(), found, expected: VERSION });
    }
    match postcard::take_from_bytes(content) {
        Ok((content, [])) => Ok(content),
        Ok((_, rest)) => Err(damaged(format!("{} bytes are left over", rest.len()))),
        Err(error) => Err(damaged(error.to_string())),
    }
}

/// A writer that hashes all bytes, and keeps the I/O error, which the serializer would drop.
struct Hashing<W> {
    to: W,
    hash: Fnv,
    failed: Option<io::Error>,
}

impl<W: Write> Write for Hashing<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match self.to.write_all(bytes) {
            Ok(()) => self.hash.add_bytes(bytes),
            Err(error) => {
                let kind = error.kind();
                self.failed = Some(error);
                return Err(kind.into());
            }
        }
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        self.to.flush()
    }
}
