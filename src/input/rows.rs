//! The rows of a CSV file with their lines.

use std::path::Path;

use super::{InputError, without_byte_order_mark};

/// A row of a CSV file.
#[derive(Clone, Debug)]
pub(crate) struct Row {
    /// Its first line, from 1.
    pub line: usize,
    /// Its cells, without the blanks around them.
    pub cells: csv::ByteRecord,
}

/// Reads the rows of a CSV file, which may have any number of cells. Lines that begin with `#` are comments.
///
/// The positions that the crate `csv` gives to records precede blank lines, comments, and the second character of `\r\n`, so
/// that the lines are counted here.
pub(crate) struct Rows<'a> {
    file: &'a Path,
    text: &'a [u8],
    reader: csv::Reader<&'a [u8]>,
    /// The byte up to which lines are counted, and its line.
    counted: (usize, usize),
}

impl<'a> Rows<'a> {
    /// Reads these bytes of a file, which errors name.
    pub fn new(file: &'a Path, bytes: &'a [u8]) -> Self {
        let text = without_byte_order_mark(bytes);
        let reader = csv::ReaderBuilder::new()
            .has_headers(false)
            .flexible(true)
            .comment(Some(b'#'))
            .trim(csv::Trim::All)
            .from_reader(text);
        Self { file, text, reader, counted: (0, 1) }
    }

    /// Returns the line of the first row that starts at a byte or after it; `None` if only blank lines and comments follow.
    fn line_from(&mut self, byte: usize) -> Option<usize> {
        let mut start = byte;
        loop {
            match self.text.get(start) {
                Some(b'\r' | b'\n') => start += 1,
                Some(b'#') => {
                    let length = self.text[start..].iter().take_while(|&&byte| byte != b'\n').count();
                    start += length;
                }
                Some(_) => break,
                None => return None,
            }
        }
        let (mut at, mut line) = self.counted;
        while at < start {
            let is_end = match self.text[at] {
                b'\n' => true,
                b'\r' => self.text.get(at + 1) != Some(&b'\n'),
                _ => false,
            };
            line += usize::from(is_end);
            at += 1;
        }
        self.counted = (at, line);
        Some(line)
    }
}

impl Iterator for Rows<'_> {
    type Item = Result<Row, InputError>;

    fn next(&mut self) -> Option<Self::Item> {
        let start = usize::try_from(self.reader.position().byte()).unwrap_or(usize::MAX);
        // Also ends at a comment without a line break, which `csv` takes for a row.
        let line = self.line_from(start)?;
        let mut cells = csv::ByteRecord::new();
        match self.reader.read_byte_record(&mut cells) {
            Ok(true) => Some(Ok(Row { line, cells })),
            Ok(false) => None,
            Err(error) => {
                let (expected, cure) = ("a row of a CSV file", "correct the line");
                Some(Err(InputError::at_line(self.file, line, error.to_string(), expected, cure)))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_know_their_lines() {
        for (text, expected) in [
            ("a\nb\nc", vec![1, 2, 3]),
            ("a\r\nb\r\nc\r\n", vec![1, 2, 3]),
            ("\u{feff}# comment\r\n\r\na\r\n# another\r\n\r\nb\r\n", vec![3, 6]),
            ("\n\na\n\n#, \"\n#\nb\n# end", vec![3, 7]),
            ("a\rb\r\rc\n", vec![1, 2, 4]),
            ("\"a\n\r\n\",1\r\nb\n", vec![1, 4]),
            ("# only\n\n", vec![]),
            ("", vec![]),
        ] {
            let rows = Rows::new(Path::new("f.csv"), text.as_bytes());
            assert_eq!(rows.map(|row| row.unwrap().line).collect::<Vec<_>>(), expected, "{text:?}");
        }
    }
}
