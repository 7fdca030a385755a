//! The files of a checkpoint and of a divided body: eight letters, the version of the format, the content, and a hash of all these.
//!
//! The beginning and the end are the same in every version, so that damage can be distinguished from another version.

use std::fs::File;
use std::io::{self, BufWriter, Read, Write};
use std::path::Path;

use crate::checksum::Fnv;
use crate::output;

const MAGIC: &[u8; 8] = b"BIOTISSU";
/// The version of the format, incremented whenever the content of one of the files changes.
pub(crate) const VERSION: u32 = 8;
/// Number of bytes before the content.
pub(crate) const HEAD: usize = MAGIC.len() + size_of::<u32>();
/// Number of bytes after the content.
pub(crate) const TAIL: usize = size_of::<u64>();
/// Number of bytes that are read at once.
const BLOCK: usize = 1 << 16;

/// What distinguishes a file from others of its name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Seal {
    /// Length of the file in bytes.
    pub bytes: u64,
    /// The hash at its end.
    pub hash: u64,
}

/// The reason why a file is not as it was written.
#[derive(Debug)]
pub(crate) enum SealError {
    /// It cannot be read.
    Unreadable(io::Error),
    /// Its content is not as it was written: the defect.
    Damaged(String),
    /// It has this version of the format.
    Version(u32),
}

/// Returns true if a file, which may be truncated, begins like one of any version.
pub(crate) fn is_begin(bytes: &[u8]) -> bool {
    MAGIC.starts_with(&bytes[..bytes.len().min(MAGIC.len())])
}

/// Writes a file, whose content `write` appends; an existing file is replaced only when the new one is complete.
pub(crate) fn write(
    path: &Path,
    write: impl FnOnce(&mut Hashing<BufWriter<&mut File>>) -> io::Result<()>,
) -> io::Result<Seal> {
    let mut seal = Seal { bytes: 0, hash: 0 };
    output::replace_by(path, |file| {
        let mut out = Hashing { to: BufWriter::new(file), hash: Fnv::new(), bytes: 0, failed: None };
        out.write_all(MAGIC)?;
        out.write_all(&VERSION.to_le_bytes())?;
        if let Err(error) = write(&mut out) {
            return Err(out.failed.take().unwrap_or(error));
        }
        let Hashing { mut to, hash, bytes, .. } = out;
        seal = Seal { bytes: bytes + TAIL as u64, hash: hash.finish() };
        to.write_all(&seal.hash.to_le_bytes())?;
        to.flush()
    })?;
    Ok(seal)
}

/// Reads a whole file block by block and compares it with its hash; calls `block` with the bytes of its content.
pub(crate) fn verify_by(path: &Path, mut block: impl FnMut(&[u8])) -> Result<Seal, SealError> {
    let mut file = File::open(path).map_err(SealError::Unreadable)?;
    let mut hash = Fnv::new();
    let (mut bytes, mut buffer, mut held, mut head) = (0, vec![0; BLOCK + TAIL], 0, Vec::with_capacity(HEAD));
    loop {
        let read = match file.read(&mut buffer[held..]) {
            Ok(read) => read,
            Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
            Err(error) => return Err(SealError::Unreadable(error)),
        };
        (bytes, held) = (bytes + read as u64, held + read);
        // The last bytes may be the hash.
        let whole = held.saturating_sub(TAIL);
        let mut part = &buffer[..whole];
        hash.add_bytes(part);
        let of_head = part.len().min(HEAD - head.len());
        head.extend_from_slice(&part[..of_head]);
        part = &part[of_head..];
        if !part.is_empty() {
            block(part);
        }
        buffer.copy_within(whole..held, 0);
        held -= whole;
        if read == 0 {
            break;
        }
    }
    if ![&head[..], &buffer[..held]].concat().starts_with(MAGIC) {
        return Err(SealError::Damaged("does not begin like a file of this program".into()));
    }
    let Some(tail) = buffer.first_chunk::<TAIL>().filter(|_| held == TAIL && head.len() == HEAD) else {
        let shortest = HEAD + TAIL;
        return Err(SealError::Damaged(format!(
            "ends after {bytes} bytes; the shortest file of this kind has {shortest}"
        )));
    };
    let seal = Seal { bytes, hash: u64::from_le_bytes(*tail) };
    if hash.finish() != seal.hash {
        return Err(SealError::Damaged(format!("its {bytes} bytes do not match their hash: truncated or changed")));
    }
    let found = head.last_chunk().map_or(0, |version| u32::from_le_bytes(*version));
    if found == VERSION { Ok(seal) } else { Err(SealError::Version(found)) }
}

/// Reads a whole file and returns its content. The memory allocated is limited by the length of the file.
pub(crate) fn read(path: &Path) -> Result<Vec<u8>, SealError> {
    let mut content = Vec::new();
    verify_by(path, |block| content.extend_from_slice(block))?;
    Ok(content)
}

/// A writer that counts and hashes all bytes, and keeps the I/O error, which a serializer would drop.
pub(crate) struct Hashing<W> {
    to: W,
    hash: Fnv,
    bytes: u64,
    failed: Option<io::Error>,
}

impl<W> Hashing<W> {
    /// Number of bytes written so far.
    pub fn position(&self) -> u64 {
        self.bytes
    }
}

impl<W: Write> Write for Hashing<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = self.to.write_all(bytes);
        self.keep_error(written)?;
        self.hash.add_bytes(bytes);
        self.bytes += bytes.len() as u64;
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        let flushed = self.to.flush();
        self.keep_error(flushed)
    }
}

impl<W> Hashing<W> {
    /// Keeps an error, whose text a serializer would replace by its own.
    fn keep_error(&mut self, outcome: io::Result<()>) -> io::Result<()> {
        outcome.map_err(|error| {
            let kind = error.kind();
            self.failed = Some(error);
            kind.into()
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_of_any_length_are_read_as_written_and_damage_is_found() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        for length in [0, 1, 7, 8, 9, BLOCK - HEAD - 1, BLOCK - HEAD, BLOCK, BLOCK + TAIL, 3 * BLOCK + 5] {
            let content: Vec<u8> = (0..length).map(|k| (k * k % 251) as u8).collect();
            let seal = write(&path, |out| out.write_all(&content)).unwrap();
            assert_eq!(seal.bytes, std::fs::metadata(&path).unwrap().len());
            assert!(read(&path).unwrap() == content, "{length}");
            assert_eq!(verify_by(&path, |_| ()).unwrap(), seal);
            let bytes = std::fs::read(&path).unwrap();
            for at in [0, 5, 9, bytes.len() / 2, bytes.len() - 9, bytes.len() - 1] {
                let mut changed = bytes.clone();
                changed[at] ^= 4;
                std::fs::write(&path, &changed).unwrap();
                assert!(matches!(read(&path), Err(SealError::Damaged(_))), "{length}: byte {at}");
                std::fs::write(&path, &bytes[..at]).unwrap();
                assert!(matches!(read(&path), Err(SealError::Damaged(_))), "{length}: cut at {at}");
            }
        }
        assert!(matches!(read(folder.path()), Err(SealError::Unreadable(_))));
    }

    #[test]
    fn the_error_of_the_disk_is_reported() {
        let folder = tempfile::tempdir().unwrap();
        let failed = write(&folder.path().join("file"), |out| {
            out.failed = Some(io::Error::other("full"));
            Err(io::Error::other("the serializer failed"))
        });
        assert_eq!(failed.unwrap_err().to_string(), "full");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    }

    /// A disk that is found full when a buffer is written.
    #[test]
    fn a_serializer_does_not_hide_the_error_of_the_disk() {
        struct Full;
        impl Write for Full {
            fn write(&mut self, _: &[u8]) -> io::Result<usize> {
                Err(io::Error::other("full"))
            }

            fn flush(&mut self) -> io::Result<()> {
                Ok(())
            }
        }
        for length in [1, 1 << 20] {
            let mut out = Hashing { to: BufWriter::new(Full), hash: Fnv::new(), bytes: 0, failed: None };
            assert!(postcard::to_io(&vec![7_u8; length], &mut out).is_err());
            assert_eq!(out.failed.unwrap().to_string(), "full", "{length}");
        }
    }
}
