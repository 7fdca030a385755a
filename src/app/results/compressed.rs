//! Arrays of VTK files that are compressed by zlib, in blocks. The module `vtu::decode` describes the layout.

use std::io::{self, Write};
use std::ops::Range;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use flate2::Compression;
use flate2::write::ZlibEncoder;
use rayon::prelude::*;

use crate::app::vtu::decode::{Encoding, Source};

/// Bytes of a block before compression.
const BLOCK: usize = 1 << 16;

/// The attribute of the root element of a file with compressed arrays.
const COMPRESSOR: &str = " compressor=\"vtkZLibDataCompressor\"";

/// The arrays of files that this program writes.
const ARRAYS: Encoding = Encoding { is_big_endian: false, header: 8, is_compressed: false };

/// Compresses the arrays of a file, which are in base64.
pub(super) fn compress(text: &[u8]) -> io::Result<Vec<u8>> {
    let invalid = |reason| io::Error::new(io::ErrorKind::InvalidData, reason);
    let compress = |array: &[u8]| -> io::Result<String> {
        let bytes = ARRAYS.bytes(Source::Base64(array)).map_err(invalid)?;
        let blocks: Vec<Vec<u8>> = bytes.chunks(BLOCK).map(compress_block).collect::<io::Result<_>>()?;
        let lengths = [blocks.len(), BLOCK, bytes.len() % BLOCK].into_iter().chain(blocks.iter().map(Vec::len));
        let header: Vec<u8> = lengths.flat_map(|length| (length as u64).to_le_bytes()).collect();
        Ok(STANDARD.encode(header) + &STANDARD.encode(blocks.concat()))
    };
    let root = find(text, b"<VTKFile", 0).and_then(|at| find(text, b">", at)).unwrap_or(text.len());
    let mut compressed = text[..root].to_vec();
    compressed.extend_from_slice(COMPRESSOR.as_bytes());
    replace_arrays(text, root, &mut compressed, compress)?;
    Ok(compressed)
}

/// Reverses [`compress`]; returns files without compressed arrays as they are.
///
/// # Errors
/// Returns what is wrong with an array.
pub(super) fn decompress(text: Vec<u8>) -> Result<Vec<u8>, String> {
    let Some(attribute) = find(&text, COMPRESSOR.as_bytes(), 0) else { return Ok(text) };
    let decompress = |array: &[u8]| -> Result<String, String> {
        let bytes = Encoding { is_compressed: true, ..ARRAYS }.bytes(Source::Base64(array))?;
        let header = (bytes.len() as u64).to_le_bytes();
        Ok(STANDARD.encode([&header, &bytes[..]].concat()))
    };
    let mut plain = text[..attribute].to_vec();
    replace_arrays(&text, attribute + COMPRESSOR.len(), &mut plain, decompress)?;
    Ok(plain)
}

fn compress_block(block: &[u8]) -> io::Result<Vec<u8>> {
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::fast());
    encoder.write_all(block)?;
    encoder.finish()
}

/// Appends `text` from `from` on, with what `replace` makes of each array in base64.
fn replace_arrays<E: Send>(
    text: &[u8],
    mut from: usize,
    to: &mut Vec<u8>,
    replace: impl Fn(&[u8]) -> Result<String, E> + Sync,
) -> Result<(), E> {
    let arrays = arrays(text, from);
    let replaced: Vec<String> =
        arrays.par_iter().map(|array| replace(&text[array.clone()])).collect::<Result<_, E>>()?;
    for (array, replaced) in arrays.into_iter().zip(replaced) {
        to.extend_from_slice(&text[from..array.start]);
        to.extend_from_slice(replaced.as_bytes());
        from = array.end;
    }
    to.extend_from_slice(&text[from..]);
    Ok(())
}

/// Returns where the arrays in base64 are.
fn arrays(text: &[u8], mut from: usize) -> Vec<Range<usize>> {
    let mut arrays = Vec::new();
    while let Some(tag) = find(text, b"format=\"binary\"", from) {
        let Some(start) = find(text, b">", tag) else { break };
        let end = find(text, b"<", start).unwrap_or(text.len());
        if text[start - 1] != b'/' {
            arrays.push(start + 1..end);
        }
        from = end;
    }
    arrays
}

fn find(text: &[u8], part: &[u8], from: usize) -> Option<usize> {
    let first = part[0];
    let mut at = from;
    while let Some(next) = text[at..].iter().position(|&byte| byte == first) {
        at += next;
        if text[at..].starts_with(part) {
            return Some(at);
        }
        at += 1;
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arrays_of_any_length_are_recovered() {
        let mut text = b"<?xml version=\"1.0\"?><VTKFile type=\"UnstructuredGrid\"><Points>".to_vec();
        for length in [0, 1, BLOCK - 1, BLOCK, BLOCK + 1, 3 * BLOCK] {
            let mut bytes = (length as u64).to_le_bytes().to_vec();
            bytes.extend((0..length).map(|k| (k / 100) as u8));
            text.extend_from_slice(b"<DataArray format=\"binary\">");
            text.extend_from_slice(STANDARD.encode(bytes).as_bytes());
            text.extend_from_slice(b"</DataArray><DataArray format=\"binary\"/>");
        }
        text.extend_from_slice(b"</Points></VTKFile>\n");
        let compressed = compress(&text).unwrap();
        assert!(compressed.len() < text.len() / 20, "{} of {}", compressed.len(), text.len());
        assert_eq!(decompress(compressed.clone()).unwrap(), text);
        assert_eq!(decompress(text.clone()).unwrap(), text);
        for end in [60, 200, compressed.len() / 2, compressed.len() - 40] {
            // A file that was cut is an error here, or is seen to be cut by the parser.
            let cut = decompress(compressed[..end].to_vec());
            assert!(cut.is_err() || cut.is_ok_and(|plain| !plain.ends_with(b"</VTKFile>\n")), "{end}");
        }
    }
}
