//! Parser of Matrix Market files.

use std::path::Path;
use std::str::FromStr;

use crate::input::{InputError, without_byte_order_mark};

/// Shape and entries of a matrix. A position appears as often as the file lists it; entries implied by symmetry are
/// included.
#[derive(Debug, PartialEq)]
pub(super) struct Triplets {
    pub rows: usize,
    pub cols: usize,
    pub entries: Vec<(u32, u32, f64)>,
}

const BANNER: &str = "%%MatrixMarket matrix coordinate|array real|integer|pattern general|symmetric|skew-symmetric";

#[derive(Clone, Copy, PartialEq)]
enum Symmetry {
    General,
    Symmetric,
    Skew,
}

struct Header {
    array: bool,
    pattern: bool,
    symmetry: Symmetry,
}

/// The lines that are neither empty nor comments, with their line numbers.
struct Lines<'a> {
    file: &'a Path,
    lines: std::iter::Enumerate<std::str::Lines<'a>>,
    last: usize,
}

impl<'a> Lines<'a> {
    fn next(&mut self, expected: &str) -> Result<Line<'a>, InputError> {
        for (number, text) in self.lines.by_ref() {
            self.last = number + 1;
            if !text.trim().is_empty() && !text.starts_with('%') {
                return Ok(Line { file: self.file, number: number + 1, text });
            }
        }
        let cure = "complete the file, or correct the counts at its beginning";
        Err(InputError::at_line(self.file, self.last, "the file ends here", expected, cure))
    }
}

struct Line<'a> {
    file: &'a Path,
    number: usize,
    text: &'a str,
}

impl Line<'_> {
    fn error(&self, expected: &str, cure: &str) -> InputError {
        InputError::at_line(self.file, self.number, format!("`{}`", self.text.trim()), expected, cure)
    }

    /// Parses exactly `N` numbers.
    fn numbers<T: FromStr + Copy, const N: usize>(&self, expected: &str) -> Result<[T; N], InputError> {
        let words = || self.text.split_whitespace();
        let numbers: Vec<T> = words().map_while(|word| word.parse().ok()).collect();
        let exact = <[T; N]>::try_from(numbers).ok().filter(|_| words().count() == N);
        exact.ok_or_else(|| self.error(expected, "correct the line"))
    }
}

/// Parses the content of a file.
pub(super) fn triplets(file: &Path, bytes: &[u8]) -> Result<Triplets, InputError> {
    let text = std::str::from_utf8(without_byte_order_mark(bytes)).map_err(|_| {
        InputError::in_file(file, "is not text", "a Matrix Market file", "unpack it first if it is compressed")
    })?;
    let header = header(file, text)?;
    let mut lines = Lines { file, lines: text.lines().enumerate(), last: 1 };
    if header.array { array(&header, &mut lines) } else { coordinate(&header, &mut lines) }
}

fn header(file: &Path, text: &str) -> Result<Header, InputError> {
    let first = text.lines().next().unwrap_or("").to_lowercase();
    let words: Vec<&str> = first.split_whitespace().collect();
    let refuse = |what: &str, cure: &str| Err(InputError::at_line(file, 1, what.to_owned(), BANNER, cure));
    let &["%%matrixmarket", "matrix", format, field, symmetry] = words.as_slice() else {
        return refuse("no Matrix Market banner", "begin the file with the banner");
    };
    if field == "complex" || symmetry == "hermitian" {
        return refuse("a complex matrix", "write its real part: complex numbers are not supported");
    }
    let array = match format {
        "array" => true,
        "coordinate" => false,
        _ => return refuse(&format!("the format `{format}`"), "correct the banner"),
    };
    let pattern = match field {
        "real" | "integer" | "double" => false,
        "pattern" if !array => true,
        _ => return refuse(&format!("the field `{field}`"), "correct the banner"),
    };
    let symmetry = match symmetry {
        "general" => Symmetry::General,
        "symmetric" => Symmetry::Symmetric,
        "skew-symmetric" => Symmetry::Skew,
        _ => return refuse(&format!("the symmetry `{symmetry}`"), "correct the banner"),
    };
    Ok(Header { array, pattern, symmetry })
}

/// Checks the numbers of rows and columns.
fn shape(line: &Line, header: &Header, rows: usize, cols: usize) -> Result<(), InputError> {
    if header.symmetry != Symmetry::General && rows != cols {
        return Err(line.error("as many rows as columns in a symmetric matrix", "correct the counts or the banner"));
    }
    if rows > i32::MAX as usize || cols > i32::MAX as usize {
        return Err(line.error("at most 2147483647 rows and columns", "divide the matrix"));
    }
    Ok(())
}

fn coordinate(header: &Header, lines: &mut Lines) -> Result<Triplets, InputError> {
    let counts = "numbers of rows, columns and entries";
    let line = lines.next(counts)?;
    let [rows, cols, count] = line.numbers::<usize, 3>(counts)?;
    shape(&line, header, rows, cols)?;
    let mut entries = Vec::new();
    let expected = if header.pattern { "row and column, from 1" } else { "row and column, from 1, and a value" };
    for _ in 0..count {
        let line = lines.next(&format!("{count} entries, here the one after the first {}", entries.len()))?;
        let (row, column, value) = if header.pattern {
            let [row, column] = line.numbers::<f64, 2>(expected)?;
            (row, column, 1.0)
        } else {
            let [row, column, value] = line.numbers::<f64, 3>(expected)?;
            (row, column, value)
        };
        let inside = |index: f64, end: usize| index >= 1.0 && index <= end as f64 && index.fract() == 0.0;
        if !(inside(row, rows) && inside(column, cols)) {
            return Err(line.error(&format!("a position within {rows} rows and {cols} columns"), "correct the line"));
        }
        put(header, &line, (row as u32 - 1, column as u32 - 1, value), &mut entries)?;
    }
    Ok(Triplets { rows, cols, entries })
}

fn array(header: &Header, lines: &mut Lines) -> Result<Triplets, InputError> {
    let counts = "numbers of rows and columns";
    let line = lines.next(counts)?;
    let [rows, cols] = line.numbers::<usize, 2>(counts)?;
    shape(&line, header, rows, cols)?;
    let mut entries = Vec::new();
    for column in 0..cols as u32 {
        let first = match header.symmetry {
            Symmetry::General => 0,
            Symmetry::Symmetric => column,
            Symmetry::Skew => column + 1,
        };
        for row in first..rows as u32 {
            let line = lines.next(&format!("the value of row {} in column {}", row + 1, column + 1))?;
            let [value] = line.numbers::<f64, 1>("a value")?;
            put(header, &line, (row, column, value), &mut entries)?;
        }
    }
    Ok(Triplets { rows, cols, entries })
}

/// Appends an entry and, for symmetric matrices, its transpose.
fn put(
    header: &Header,
    line: &Line,
    (row, column, value): (u32, u32, f64),
    entries: &mut Vec<(u32, u32, f64)>,
) -> Result<(), InputError> {
    if !value.is_finite() {
        return Err(line.error("a finite value", "correct the value"));
    }
    if header.symmetry == Symmetry::Skew && row == column {
        return Err(line.error("no diagonal in a skew-symmetric matrix", "take the line out, or correct the banner"));
    }
    entries.push((row, column, value));
    if row != column {
        match header.symmetry {
            Symmetry::General => {}
            Symmetry::Symmetric => entries.push((column, row, value)),
            Symmetry::Skew => entries.push((column, row, -value)),
        }
    }
    Ok(())
}
