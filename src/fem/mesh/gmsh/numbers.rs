//! Reading of the numbers of a mesh file, text or binary.

use std::borrow::Cow;

use super::cursor::{Cursor, DAMAGED, Encoding, clipped};
use crate::input::InputError;

impl<'a> Cursor<'a> {
    /// Reads a 32-bit integer.
    pub fn integer(&mut self, expected: &str) -> Result<i32, InputError> {
        match self.encoding {
            Encoding::Text => self.text_integer(expected),
            Encoding::Binary { .. } => self.take(expected).map(i32::from_le_bytes),
        }
    }

    /// Reads a nonnegative count or tag.
    pub fn size(&mut self, expected: &str) -> Result<u64, InputError> {
        match self.encoding {
            Encoding::Text => self.text_size(expected),
            Encoding::Binary { eight_byte_sizes: true, .. } => self.take(expected).map(u64::from_le_bytes),
            Encoding::Binary { eight_byte_sizes: false, .. } => {
                self.take(expected).map(|bytes| u32::from_le_bytes(bytes).into())
            }
        }
    }

    /// Reads a nonnegative count or tag stored in 32 bits (version 2).
    pub fn small_size(&mut self, expected: &str) -> Result<u64, InputError> {
        let value = self.integer(expected)?;
        u64::try_from(value).map_err(|_| self.error(format!("{value} is negative"), expected, DAMAGED))
    }

    /// Reads a count on its own line, which is text in binary files too.
    pub fn text_count(&mut self, expected: &str) -> Result<u64, InputError> {
        self.skip_whitespace();
        self.in_row = true;
        let count = self.text_size(expected)?;
        self.in_row = false;
        self.finish_line()?;
        Ok(count)
    }

    /// Reads an integer that is text in binary files too.
    pub fn text_integer(&mut self, expected: &str) -> Result<i32, InputError> {
        self.word_as(expected, "a whole number")
    }

    fn text_size(&mut self, expected: &str) -> Result<u64, InputError> {
        self.word_as(expected, "a nonnegative whole number")
    }

    /// Reads a floating-point number, finite or not; used for ignored data.
    pub fn number(&mut self, expected: &str) -> Result<f64, InputError> {
        match self.encoding {
            Encoding::Text => self.word_as(expected, "a number"),
            Encoding::Binary { .. } => self.take(expected).map(f64::from_le_bytes),
        }
    }

    /// Reads a finite floating-point number.
    pub fn finite(&mut self, expected: &str) -> Result<f64, InputError> {
        let value = self.number(expected)?;
        if value.is_finite() {
            return Ok(value);
        }
        Err(self.error(format!("{value} is not finite"), expected, "find the cause in the program that wrote the mesh"))
    }

    /// Reads the integer 1, which shows the byte order of a binary file; returns true if the file is big-endian.
    pub fn byte_order(&mut self) -> Result<bool, InputError> {
        let bytes: [u8; 4] = self.take("the number 1 in four bytes")?;
        match (i32::from_le_bytes(bytes), i32::from_be_bytes(bytes)) {
            (1, _) => Ok(false),
            (_, 1) => Ok(true),
            (found, _) => Err(InputError::in_file(
                self.path,
                format!("the number that indicates the byte order is {found}, not 1"),
                "the number 1 in four bytes, in either byte order",
                "the file is damaged, perhaps copied as text: export it again",
            )),
        }
    }

    /// Reads the rest of a line.
    pub fn rest_of_line(&mut self) -> Cow<'a, str> {
        let rest = self.bytes[self.at..].split(|&byte| byte == b'\n').next().unwrap_or_default();
        self.mark();
        self.at += rest.len();
        String::from_utf8_lossy(rest.trim_ascii())
    }

    /// Reads the next word and parses it; `kind` describes a valid word.
    fn word_as<T: std::str::FromStr>(&mut self, expected: &str, kind: &str) -> Result<T, InputError> {
        let word = self.word(expected)?;
        std::str::from_utf8(word)
            .ok()
            .and_then(|word| word.parse().ok())
            .ok_or_else(|| self.error(format!("`{}` is not {kind}", clipped(word)), expected, DAMAGED))
    }

    /// Reads the next word; a word that begins with `$` opens or closes a section and is an error here.
    fn word(&mut self, expected: &str) -> Result<&'a [u8], InputError> {
        if self.in_row {
            self.skip_spaces();
        } else {
            self.skip_whitespace();
        }
        self.mark();
        let rest = &self.bytes[self.at..];
        let word = rest.split(|byte| byte.is_ascii_whitespace()).next().unwrap_or_default();
        match word.first() {
            None if rest.is_empty() => Err(self.ended(true, expected)),
            None => Err(self.error("the line ends too early", expected, DAMAGED)),
            Some(b'$') => Err(self.ended(false, expected)),
            Some(_) => {
                self.at += word.len();
                Ok(word)
            }
        }
    }

    /// Reads the bytes of a number in little-endian order.
    fn take<const N: usize>(&mut self, expected: &str) -> Result<[u8; N], InputError> {
        self.mark();
        let Some(&(mut bytes)) = self.bytes[self.at..].first_chunk() else {
            return Err(self.ended(true, expected));
        };
        self.at += N;
        if matches!(self.encoding, Encoding::Binary { big_endian: true, .. }) {
            bytes.reverse();
        }
        Ok(bytes)
    }
}
