//! Reads a table of stretch and stress from a CSV file.

use std::path::Path;

use super::Table;
use crate::input::{InputError, InputErrors, MOST_SHOWN, Row, Rows, excerpt};

const EXPECTED: &str = "two numbers separated by a comma: stretch, nominal stress in Pa";

impl Table {
    /// Reads a law from a CSV file with the columns stretch and nominal stress in Pa.
    ///
    /// The first line may be a header; lines that begin with `#` are comments.
    ///
    /// # Errors
    /// Returns the lines that are not points, at most 20 of them, or, if there is none, the first reason why the points
    /// do not define a law; each error with its line.
    pub fn read(file: &Path) -> Result<Self, InputErrors> {
        let bytes = std::fs::read(file).map_err(|error| InputError::unreadable(file, &error))?;
        Self::parse(file, &bytes)
    }

    fn parse(file: &Path, bytes: &[u8]) -> Result<Self, InputErrors> {
        let (mut points, mut lines, mut errors) = (Vec::new(), Vec::new(), Vec::new());
        for (number, row) in Rows::new(file, bytes).enumerate() {
            let Row { line, cells } = row?;
            match point(&cells) {
                Ok(point) => {
                    points.push(point);
                    lines.push(line);
                }
                // A header contains no number.
                Err(_) if number == 0 && cells.iter().all(|cell| number_of(cell).is_none()) => {}
                Err(what) => errors.push(InputError::at_line(file, line, what, EXPECTED, "correct or remove the line")),
            }
            if errors.len() == MOST_SHOWN {
                break;
            }
        }
        if !errors.is_empty() {
            return Err(InputErrors(errors));
        }
        Self::new(points).map_err(|error| {
            let line = error.point().and_then(|point| lines.get(point).copied());
            let [expected, cure] = error.advice();
            InputErrors(vec![InputError { line, ..InputError::in_file(file, error.to_string(), expected, cure) }])
        })
    }
}

fn number_of(cell: &[u8]) -> Option<f64> {
    std::str::from_utf8(cell).ok()?.parse().ok()
}

/// Parses the two numbers of a line, or describes its first error.
fn point(record: &csv::ByteRecord) -> Result<[f64; 2], String> {
    let mut point = [0.0; 2];
    if record.len() != point.len() {
        let (cells, s) = (record.len(), if record.len() == 1 { "" } else { "s" });
        return Err(format!("the line has {cells} column{s}"));
    }
    for (value, cell) in point.iter_mut().zip(record) {
        *value =
            number_of(cell).ok_or_else(|| format!("`{}` is not a number", excerpt(&String::from_utf8_lossy(cell))))?;
    }
    Ok(point)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<Table, InputErrors> {
        Table::parse(Path::new("curve.csv"), text.as_bytes())
    }

    #[test]
    fn header_comments_and_blanks_are_skipped() {
        let text = "stretch, stress (Pa)\n# measured at 37 degrees\n0.9, -1e6\n\n 1.0 , 0\n1.1,2e6\n";
        let table = parse(text).unwrap();
        assert_eq!(table.points(), [[0.9, -1e6], [1.0, 0.0], [1.1, 2e6]]);
        assert_eq!(parse("0.9,-1e6\r\n1,0\r\n1.1,2e6").unwrap(), table);
    }

    #[test]
    fn every_error_is_reported_with_its_line() {
        let cases = [
            ("1,0\n1.1,x\n1.2\n1.3,1,2\n", "curve.csv:2: `x` is not a number"),
            ("1,0\n1.2\n", "curve.csv:2: the line has 1 column"),
            ("stretch,stress\n1;0\n", "curve.csv:2: the line has 1 column"),
            ("a,b\nc,d\n1,0\n", "curve.csv:2: `c` is not a number"),
            ("", "curve.csv: the table has 0 points"),
            ("1,0\n", "curve.csv: the table has 1 points"),
            ("0.9,-1\n1.1,1\n", "curve.csv: no point has the stretch 1"),
            ("a,b\n0.9,-1\n1,0.5\n1.1,1\n", "curve.csv:3: the stress at stretch 1 is 0.5"),
            ("1,0\r\n# cut\r\n\r\n1.2;2\r\n", "curve.csv:4: the line has 1 column"),
            ("1,0\n\n1.2,2\n1.1,3\n", "curve.csv:4: the stretch 1.1 follows 1.2"),
            ("1,0\n1.1,3\n1.2,2\n", "curve.csv:3: the stress falls from 3 to 2"),
            ("-1,-3\n1,0\n", "curve.csv:1: the stretch is -1"),
            ("1,0\n1.1,inf\n", "curve.csv:2: a value of the point (1.1, inf) is not finite"),
            ("0.9,-1\n1,0\n1.1,0\n1.2,1\n", "curve.csv:2: the curve has no slope at stretch 1"),
        ];
        for (text, expected) in cases {
            let error = parse(text).unwrap_err().to_string();
            assert_eq!(error.lines().next(), Some(expected), "{text}");
        }
        assert_eq!(parse("1,0\n1.1,x\n1.2\n1.3,1,2\n").unwrap_err().0.len(), 3);
        assert!(Table::parse(Path::new("curve.csv"), b"1,0\n\xff\xfe,2\n").is_err());
        assert!(Table::read(Path::new("absent.csv")).unwrap_err().to_string().contains("cannot be read"));
    }
}
