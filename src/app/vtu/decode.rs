//! The numbers of a data array: base64, zlib blocks, byte order and number types of VTK's XML form.
//!
//! The layout is that of the VTK wiki, "VTK XML Formats": an array in binary begins with its length in bytes or, if it
//! is compressed, with the number of blocks, the length of a block, the length of the last block (0: a full one), and
//! the compressed length of each block.

use std::io::Read;

/// The numbers of an array.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::app) enum Numbers {
    Integers(Vec<i64>),
    Reals(Vec<f64>),
}

/// The type of the numbers of an array.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum NumberType {
    /// Number of bytes, and whether the integers are signed.
    Integer(usize, bool),
    /// Number of bytes.
    Real(usize),
}

/// What the root element of a file says about all arrays in binary.
#[derive(Clone, Copy, Debug)]
pub(super) struct Encoding {
    pub is_big_endian: bool,
    /// Bytes of a number in the header of an array: 4 or 8.
    pub header: usize,
    pub is_compressed: bool,
}

impl NumberType {
    /// Returns the type of this name.
    pub fn named(name: &str) -> Option<Self> {
        Some(match name {
            "Int8" => Self::Integer(1, true),
            "UInt8" => Self::Integer(1, false),
            "Int16" => Self::Integer(2, true),
            "UInt16" => Self::Integer(2, false),
            "Int32" => Self::Integer(4, true),
            "UInt32" => Self::Integer(4, false),
            "Int64" => Self::Integer(8, true),
            "UInt64" => Self::Integer(8, false),
            "Float32" => Self::Real(4),
            "Float64" => Self::Real(8),
            _ => return None,
        })
    }

    fn bytes(self) -> usize {
        let (Self::Integer(bytes, _) | Self::Real(bytes)) = self;
        bytes
    }

    /// Reads numbers separated by blanks.
    pub fn parse_text(self, text: &str) -> Result<Numbers, String> {
        let words = text.split_ascii_whitespace();
        let invalid = |word: &str| format!("`{}` is not a number of its type", crate::input::excerpt(word));
        Ok(match self {
            Self::Integer(..) => {
                let numbers = words.map(|word| word.parse().map_err(|_| invalid(word)));
                Numbers::Integers(numbers.collect::<Result<_, _>>()?)
            }
            Self::Real(_) => {
                let numbers = words.map(|word| word.parse().map_err(|_| invalid(word)));
                Numbers::Reals(numbers.collect::<Result<_, _>>()?)
            }
        })
    }

    /// Converts bytes to numbers.
    fn parse_bytes(self, bytes: &[u8], is_big_endian: bool) -> Result<Numbers, String> {
        let size = self.bytes();
        if !bytes.len().is_multiple_of(size) {
            return Err(format!("has {} bytes, not a multiple of {size}", bytes.len()));
        }
        let words = bytes.chunks_exact(size).map(|chunk| word(chunk, is_big_endian));
        Ok(match self {
            Self::Real(4) => Numbers::Reals(words.map(|word| f64::from(f32::from_bits(word as u32))).collect()),
            Self::Real(_) => Numbers::Reals(words.map(f64::from_bits).collect()),
            Self::Integer(_, is_signed) => {
                // Bits above the highest one of the type, to extend its sign.
                let unused = 64 - 8 * size as u32;
                let number = |word: u64| match is_signed {
                    true => Ok(((word << unused) as i64) >> unused),
                    false => i64::try_from(word).map_err(|_| format!("holds {word}, beyond the range of indices")),
                };
                Numbers::Integers(words.map(number).collect::<Result<_, _>>()?)
            }
        })
    }
}

/// Returns the number in up to eight bytes.
fn word(bytes: &[u8], is_big_endian: bool) -> u64 {
    let push = |word: u64, &byte: &u8| word << 8 | u64::from(byte);
    if is_big_endian { bytes.iter().fold(0, push) } else { bytes.iter().rev().fold(0, push) }
}

/// Encoded bytes: raw ones, or base64.
#[derive(Clone, Copy)]
pub(super) enum Source<'a> {
    Raw(&'a [u8]),
    Base64(&'a [u8]),
}

impl Source<'_> {
    /// Returns the first `count` bytes.
    fn first(self, count: usize) -> Result<Vec<u8>, String> {
        let bytes = match self {
            Self::Raw(bytes) => bytes[..bytes.len().min(count)].to_vec(),
            Self::Base64(text) => from_base64(text, count)?,
        };
        match bytes.len() {
            found if found < count => Err(format!("ends after {found} of {count} bytes")),
            _ => Ok(bytes),
        }
    }
}

/// Decodes base64 until there are `count` bytes or the text ends. Each part of an array (header, data) may be padded.
fn from_base64(text: &[u8], count: usize) -> Result<Vec<u8>, String> {
    let mut bytes = Vec::with_capacity(count.min(text.len()));
    let (mut bits, mut digits, mut padding) = (0_u32, 0, 0);
    for &letter in text.iter().filter(|letter| !letter.is_ascii_whitespace()) {
        if bytes.len() >= count {
            break;
        }
        let value = match letter {
            b'A'..=b'Z' => letter - b'A',
            b'a'..=b'z' => letter - b'a' + 26,
            b'0'..=b'9' => letter - b'0' + 52,
            b'+' => 62,
            b'/' => 63,
            b'=' => 0,
            _ => return Err(format!("`{}` is not base64", char::from(letter).escape_default())),
        };
        padding += u32::from(letter == b'=');
        bits = bits << 6 | u32::from(value);
        digits += 1;
        if digits == 4 {
            let [_, triple @ ..] = bits.to_be_bytes();
            bytes.extend(&triple[..3_usize.saturating_sub(padding as usize)]);
            (bits, digits, padding) = (0, 0, 0);
        }
    }
    bytes.truncate(count);
    Ok(bytes)
}

impl Encoding {
    /// Returns the numbers of an array in binary.
    pub(super) fn decode(self, source: Source<'_>, of: NumberType) -> Result<Numbers, String> {
        of.parse_bytes(&self.bytes(source)?, self.is_big_endian)
    }

    fn bytes(self, source: Source<'_>) -> Result<Vec<u8>, String> {
        if self.is_compressed { self.decompressed(source) } else { self.plain(source) }
    }

    fn header(self, bytes: &[u8]) -> Result<Vec<usize>, String> {
        let words = bytes.chunks_exact(self.header).map(|chunk| word(chunk, self.is_big_endian));
        words.map(|word| usize::try_from(word).map_err(|_| "has an invalid length".to_owned())).collect()
    }

    fn plain(self, source: Source<'_>) -> Result<Vec<u8>, String> {
        let length = self.header(&source.first(self.header)?)?;
        let total = length[0].checked_add(self.header).ok_or("has an invalid length")?;
        Ok(source.first(total)?.split_off(self.header))
    }

    fn decompressed(self, source: Source<'_>) -> Result<Vec<u8>, String> {
        let invalid = || "has invalid lengths of blocks".to_owned();
        let blocks = self.header(&source.first(self.header)?)?[0];
        if blocks == 0 {
            return Ok(Vec::new());
        }
        let header = blocks.checked_add(3).and_then(|n| n.checked_mul(self.header)).ok_or_else(invalid)?;
        let lengths = self.header(&source.first(header)?)?;
        let [_, size, last, compressed @ ..] = lengths.as_slice() else { return Err(invalid()) };
        let sum = compressed.iter().try_fold(header, |sum, &length| sum.checked_add(length)).ok_or_else(invalid)?;
        let data = source.first(sum)?;
        let (mut rest, mut bytes) = (&data[header..], Vec::new());
        for (block, &length) in (1..).zip(compressed) {
            let (own, others) = rest.split_at_checked(length).ok_or_else(invalid)?;
            let expected = if block == blocks && *last > 0 { *last } else { *size };
            let before = bytes.len();
            let read = flate2::read::ZlibDecoder::new(own).take(expected as u64).read_to_end(&mut bytes);
            read.map_err(|error| format!("is not compressed by zlib: {error}"))?;
            if bytes.len() - before != expected {
                return Err(invalid());
            }
            rest = others;
        }
        Ok(bytes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_of_base64_may_be_padded() {
        assert_eq!(from_base64(b"AQ==AgM=", 9).unwrap(), [1, 2, 3]);
        assert_eq!(from_base64(b"AQID BA==", 2).unwrap(), [1, 2]);
        assert!(from_base64(b"AQ*=", 9).is_err());
    }

    #[test]
    fn numbers_of_every_type() {
        let integers = |numbers: &[i64]| Ok(Numbers::Integers(numbers.to_vec()));
        let of = |name: &str, bytes: &[u8], big| NumberType::named(name).unwrap().parse_bytes(bytes, big);
        assert_eq!(of("Int8", &[255, 1], false), integers(&[-1, 1]));
        assert_eq!(of("UInt8", &[255], false), integers(&[255]));
        assert_eq!(of("Int16", &[0xff, 0xfe], true), integers(&[-2]));
        assert_eq!(of("UInt32", &[1, 2, 0, 0], false), integers(&[513]));
        assert_eq!(of("Int64", &[0, 0, 0, 0, 0, 0, 0, 9], true), integers(&[9]));
        assert!(of("UInt64", &[255; 8], true).is_err());
        assert_eq!(of("Float32", &1.5_f32.to_be_bytes(), true), Ok(Numbers::Reals(vec![1.5])));
        assert_eq!(of("Float64", &0.1_f64.to_le_bytes(), false), Ok(Numbers::Reals(vec![0.1])));
        assert!(of("Float64", &[0; 7], false).is_err());
        assert!(NumberType::named("String").is_none());
    }

    #[test]
    fn damaged_blocks_are_errors() {
        let encoding = Encoding { is_big_endian: false, header: 4, is_compressed: true };
        for numbers in [vec![1_u32, 8, 8, 200], vec![u32::MAX, 8, 8], vec![2, 8, 0, 1, u32::MAX], vec![1, 8, 8, 0]] {
            let bytes: Vec<u8> = numbers.iter().flat_map(|number| number.to_le_bytes()).collect();
            assert!(encoding.decode(Source::Raw(&bytes), NumberType::Real(8)).is_err(), "{numbers:?}");
        }
        assert_eq!(encoding.decode(Source::Raw(&[0; 4]), NumberType::Real(8)), Ok(Numbers::Reals(Vec::new())));
    }
}
