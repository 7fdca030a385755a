//! Columns of a CSV file: one row per element in their order, or in any order with a column `element`.

use std::path::Path;

use super::ElementValues;
use crate::input::{InputError, InputErrors, MOST_SHOWN, Row, Rows, excerpt};

/// The column with the numbers of the elements.
const ELEMENT: &str = "element";

/// Reads the rows of a file, the first of which names the columns.
pub(super) fn read(file: &Path) -> Result<Vec<Row>, InputError> {
    let bytes = std::fs::read(file).map_err(|error| InputError::unreadable(file, &error))?;
    Rows::new(file, &bytes).collect()
}

/// Parses `N` columns of a file. Without the column `element`, there is one row for each of `total` elements; with it, one
/// for each of `elements`, and others are allowed.
pub(super) fn parse<const N: usize>(
    file: &Path,
    rows: &[Row],
    columns: &[String],
    (total, elements): (usize, &[usize]),
) -> Result<ElementValues<N>, InputErrors> {
    let (names, rows) = rows.split_first().map_or((None, rows), |(names, rows)| (Some(names), rows));
    let header = Header::find(file, names, columns)?;
    if let (None, Some(column)) = (header.element, header.other_numbering(rows)) {
        let name =
            names.and_then(|names| names.cells.get(column)).map_or_else(Default::default, String::from_utf8_lossy);
        let problem = format!("the column \"{}\" numbers the rows in another order than theirs", excerpt(&name));
        let expected = "rows in the order of the elements, or a column `element` with their numbers, from 0";
        let cure = "name the column `element` if it numbers the elements from 0, or remove it";
        return Err(InputError {
            line: names.map(|row| row.line),
            ..InputError::in_file(file, problem, expected, cure)
        }
        .into());
    }
    let (mut values, mut lines, mut errors) = (vec![[f64::NAN; N]; total], vec![0; total], Vec::new());
    for (number, Row { line, cells }) in rows.iter().enumerate() {
        match header.row::<N>(cells, (number, total), &lines) {
            Ok((element, of_row)) => (values[element], lines[element]) = (of_row, *line),
            Err([problem, expected]) => {
                errors.push(InputError::at_line(file, *line, problem, expected, "correct or remove the line"));
            }
        }
        if errors.len() == MOST_SHOWN {
            break;
        }
    }
    if errors.is_empty() && header.element.is_none() && rows.len() != total {
        let row = if rows.len() == 1 { "row" } else { "rows" };
        let problem = format!("the file has {} {row} of values; the mesh has {total} elements", rows.len());
        let cure = "add the missing rows, or a column `element` with the number of each element, from 0";
        errors.push(InputError::in_file(file, problem, "one row for each element of the mesh", cure));
    }
    let missing = elements.iter().filter(|&&element| lines[element] == 0);
    if let (true, Some(first)) = (errors.is_empty(), missing.clone().next()) {
        let problem = match missing.count() {
            1 => format!("element {first} has no row"),
            count => format!("{count} elements have no row, the first of them element {first}"),
        };
        let expected = "one row for each element of the region";
        errors.push(InputError::in_file(file, problem, expected, "add the missing rows"));
    }
    if !errors.is_empty() {
        return Err(InputErrors(errors));
    }
    let names: Vec<String> = columns.iter().map(|column| format!("`{}`", excerpt(column))).collect();
    Ok(ElementValues { file: file.into(), name: names.join(", "), values, lines })
}

/// The positions of the columns.
struct Header {
    element: Option<usize>,
    columns: Vec<usize>,
    /// The number of columns of the first row.
    width: usize,
}

impl Header {
    fn find(file: &Path, row: Option<&Row>, columns: &[String]) -> Result<Self, InputErrors> {
        let (line, names) = row.map_or_else(Default::default, |row| (Some(row.line), row.cells.clone()));
        let place = |name: &str| names.iter().position(|cell| cell == name.as_bytes());
        let listed: Vec<String> =
            names.iter().map(|cell| format!("\"{}\"", excerpt(&String::from_utf8_lossy(cell)))).collect();
        let missing = |column: &String| {
            let expected = format!("names of columns in the first row, which has {}", listed.join(", "));
            let problem = format!("there is no column \"{}\"", excerpt(column));
            let is_one = |separator: u8| names.len() == 1 && names.iter().any(|cell| cell.contains(&separator));
            let cure = match [b';', b'\t'].into_iter().any(is_one) {
                true => "separate the columns by commas, and write decimal points",
                false => "correct the name, or add the column",
            };
            InputError { line, ..InputError::in_file(file, problem, expected, cure) }
        };
        let found: Vec<Result<usize, InputError>> =
            columns.iter().map(|column| place(column).ok_or_else(|| missing(column))).collect();
        let errors: Vec<InputError> = found.iter().filter_map(|column| column.as_ref().err().cloned()).collect();
        if !errors.is_empty() {
            return Err(InputErrors(errors));
        }
        let is_element = |cell: &[u8]| cell.eq_ignore_ascii_case(ELEMENT.as_bytes());
        let is_repeated = |name: &&str| names.iter().filter(|cell| *cell == name.as_bytes()).count() > 1;
        let several = names.iter().filter(|cell| is_element(cell)).count() > 1;
        let repeated = columns.iter().map(String::as_str).find(is_repeated).or(several.then_some(ELEMENT));
        if let Some(repeated) = repeated {
            let problem = format!("two columns have the name \"{}\"", excerpt(repeated));
            let cure = "rename or remove one of them";
            return Err(InputError { line, ..InputError::in_file(file, problem, "names that differ", cure) }.into());
        }
        let element = names.iter().position(is_element);
        Ok(Self { element, columns: found.into_iter().flatten().collect(), width: names.len() })
    }

    /// Returns an unused column that numbers all rows, but not in their order: probably the elements under another name.
    fn other_numbering(&self, rows: &[Row]) -> Option<usize> {
        /// The whole numbers of fewer rows may be values.
        const FEWEST: usize = 10;
        if rows.len() < FEWEST {
            return None;
        }
        let columns = rows.first().map_or(0, |row| row.cells.len());
        let number = |row: &Row, column: usize| std::str::from_utf8(row.cells.get(column)?).ok()?.parse::<usize>().ok();
        (0..columns).filter(|column| !self.columns.contains(column)).find(|&column| {
            let Some(mut numbers) = rows.iter().map(|row| number(row, column)).collect::<Option<Vec<usize>>>() else {
                return false;
            };
            let in_order = numbers.is_sorted();
            numbers.sort_unstable();
            let are_consecutive = numbers.windows(2).all(|pair| pair[1] == pair[0] + 1);
            !in_order && are_consecutive && numbers.first().is_some_and(|first| *first <= 1)
        })
    }

    /// Returns the element of a row and its values, or what is wrong and what is expected.
    fn row<const N: usize>(
        &self,
        record: &csv::ByteRecord,
        (number, total): (usize, usize),
        lines: &[usize],
    ) -> Result<(usize, [f64; N]), [String; 2]> {
        let last = self.columns.iter().copied().chain(self.element).max().unwrap_or_default();
        if record.len() <= last {
            let problem = format!("the row ends after column {}; column {} is needed", record.len(), last + 1);
            return Err([problem, "a cell for each column of the first row".to_owned()]);
        }
        if record.len() > self.width {
            let problem = format!("the row has {} columns; the first row has {}", record.len(), self.width);
            return Err([problem, "a cell for each column of the first row, and decimal points".to_owned()]);
        }
        let cell = |column: usize| String::from_utf8_lossy(&record[column]);
        let shown = |column: usize| format!("`{}`", excerpt(&cell(column)));
        let element = match self.element {
            Some(column) => cell(column).parse().map_err(|_| {
                [format!("the element is {}", shown(column)), "the number of an element, from 0".to_owned()]
            })?,
            None => number,
        };
        let line = lines.get(element).ok_or_else(|| {
            let last = total.saturating_sub(1);
            [format!("there is no element {element}"), format!("elements counted from 0 to {last}")]
        })?;
        if *line > 0 {
            let problem = format!("element {element} has a row at line {line} already");
            return Err([problem, "one row for each element".into()]);
        }
        let mut values = [f64::NAN; N];
        for (value, &column) in values.iter_mut().zip(&self.columns) {
            *value = cell(column)
                .parse()
                .map_err(|_| [format!("{} is not a number", shown(column)), "a number in each column".to_owned()])?;
        }
        Ok((element, values))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn values(text: &str, columns: &[&str]) -> Result<Vec<[f64; 1]>, String> {
        let columns: Vec<String> = columns.iter().map(|column| (*column).to_owned()).collect();
        let file = Path::new("f.csv");
        let rows: Vec<Row> = Rows::new(file, text.as_bytes()).map(Result::unwrap).collect();
        let parsed = parse::<1>(file, &rows, &columns, (3, &[0, 2]));
        parsed.map(|read| read.values).map_err(|errors| errors.to_string())
    }

    #[test]
    fn rows_belong_to_elements() {
        let expected = [[1.0], [2.0], [3.0]];
        assert_eq!(values("# moduli\nE,nu\n1,0\n2,0\n3,0\n", &["E"]).unwrap(), expected);
        assert_eq!(values("nu, element, E\n0,2,3\n0,0,1\n0,1,2\n", &["E"]).unwrap(), expected);
        let partial = values("element,E\n2,3\n0,1\n", &["E"]).unwrap();
        assert_eq!((partial[0], partial[2], partial[1][0].is_nan()), ([1.0], [3.0], true));
    }

    #[test]
    fn rows_that_do_not_fit_are_reported() {
        for (text, expected) in [
            ("E\n1\n2\n", "f.csv: the file has 2 rows of values; the mesh has 3 elements"),
            ("E\n1\n2\n3\n4\n", "f.csv:5: there is no element 3"),
            ("E\n1\n2 Pa\n3\n", "f.csv:3: `2 Pa` is not a number"),
            ("E,F\n1,1\n2,2\n\"\",3\n", "f.csv:4: `` is not a number"),
            ("F\n1\n2\n3\n", "f.csv:1: there is no column \"E\""),
            ("element,E\n0,1\n", "f.csv: element 2 has no row"),
            ("element,E\n0,1\n2,1\n0,2\n", "f.csv:4: element 0 has a row at line 2 already"),
            ("element,E\n-1,1\n", "f.csv:2: the element is `-1`"),
            ("# moduli\r\nE\r\n1\r\n\r\n2 Pa\r\n", "f.csv:5: `2 Pa` is not a number"),
            ("# moduli\n\nF\n1\n", "f.csv:3: there is no column \"E\""),
            ("", "f.csv: there is no column \"E\""),
        ] {
            let found = values(text, &["E"]).unwrap_err();
            assert_eq!(found.lines().next().unwrap(), expected, "{text}");
        }
    }

    #[test]
    fn elements_in_a_column_of_another_name_are_noticed() {
        let rows = |name: &str| {
            let rows: String = (0..12).rev().map(|element| format!("{element},1\n")).collect();
            format!("{name},E\n{rows}")
        };
        let noticed = "f.csv:1: the column \"id\" numbers the rows in another order than theirs";
        assert_eq!(values(&rows("id"), &["E"]).unwrap_err().lines().next().unwrap(), noticed);
        // Read as `element`: the mesh of this test has three elements.
        assert!(values(&rows("Element"), &["E"]).unwrap_err().starts_with("f.csv:2: there is no element 11"));
    }
}
