//! The arrays of a `.vtu` or `.vtp` file: its XML text, with data in text, in base64, or appended.

use std::path::Path;

use quick_xml::events::{BytesStart, Event};

use super::decode::{Encoding, NumberType, Numbers, Source};
use crate::app::results::attribute;
use crate::input::InputError;

pub(super) const DAMAGED: &str = "the file is damaged: write it again";

/// An array of the file.
pub(in crate::app) struct Array {
    pub name: String,
    /// Line of its tag, from 1.
    pub line: usize,
    pub components: usize,
    pub numbers: Numbers,
}

/// What is read of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::app) enum Content {
    /// An unstructured grid with the values of its cells.
    Cells,
    /// An unstructured grid with the values of its points and cells.
    Grid,
    /// PolyData with lines and the values of its points and lines.
    Lines,
}

/// The grid or the lines of a file.
pub(in crate::app) struct Grid {
    /// Line of the tag `Piece`.
    pub line: usize,
    pub positions: Array,
    pub connectivity: Array,
    pub offsets: Array,
    /// The types of the cells of a grid; empty for lines.
    pub types: Array,
    /// The arrays with values of the points, if they are read.
    pub of_points: Vec<Array>,
    /// The arrays with values of the cells or lines.
    pub of_cells: Vec<Array>,
}

impl Content {
    /// Returns the name of the data set in VTK.
    fn data_set(self) -> &'static str {
        match self {
            Self::Cells | Self::Grid => "UnstructuredGrid",
            Self::Lines => "PolyData",
        }
    }

    fn expected(self) -> &'static str {
        match self {
            Self::Cells | Self::Grid => "an unstructured grid in VTK's XML form (.vtu)",
            Self::Lines => "lines in VTK's XML form (.vtp)",
        }
    }

    /// Returns the section that an element of XML begins.
    fn section(self, element: &str) -> Option<Section> {
        match (element, self) {
            ("Points", _) => Some(Section::Points),
            ("Cells", Self::Cells | Self::Grid) | ("Lines", Self::Lines) => Some(Section::Cells),
            ("CellData", _) => Some(Section::CellData),
            ("PointData", Self::Grid | Self::Lines) => Some(Section::PointData),
            _ => None,
        }
    }
}

/// Where the reader is: the section that holds the arrays.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Section {
    Points,
    Cells,
    PointData,
    CellData,
}

/// An array before its numbers are decoded.
struct Tag {
    name: String,
    line: usize,
    components: usize,
    number: NumberType,
    format: Format,
}

enum Format {
    Text,
    Base64,
    /// Its offset in the appended data.
    Appended(usize),
}

/// The appended data of a file, from the mark `_` on.
#[derive(Clone, Copy)]
struct Appended<'a> {
    bytes: &'a [u8],
    is_raw: bool,
}

/// Reads the grid of a file with the values of its cells.
pub(super) fn read(path: &Path) -> Result<Grid, InputError> {
    let bytes = std::fs::read(path).map_err(|error| InputError::unreadable(path, &error))?;
    parse(path, &bytes, Content::Cells)
}

/// Reads a file with these bytes.
pub(in crate::app) fn parse(path: &Path, bytes: &[u8], content: Content) -> Result<Grid, InputError> {
    let (text, appended) = split(path, bytes, content)?;
    Reader { path, content, text, appended, encoding: None, pieces: Vec::new(), arrays: Vec::new() }.read()
}

/// Splits a file into its XML text and the appended data, which need not be text.
fn split<'a>(path: &Path, bytes: &'a [u8], content: Content) -> Result<(&'a str, Option<Appended<'a>>), InputError> {
    const MARK: &[u8] = b"<AppendedData";
    let expected = content.expected();
    let damaged = |problem: String| InputError::in_file(path, problem, expected, DAMAGED);
    let at = bytes.windows(MARK.len()).position(|window| window == MARK);
    let (text, rest) = bytes.split_at(at.unwrap_or(bytes.len()));
    let text = std::str::from_utf8(text).map_err(|error| {
        let line = 1 + text[..error.valid_up_to()].iter().filter(|&&byte| byte == b'\n').count();
        InputError::at_line(path, line, "the file is not text in UTF-8", expected, "write it again in VTK's XML form")
    })?;
    let Some(_) = at else { return Ok((text, None)) };
    let end =
        rest.iter().position(|&byte| byte == b'>').ok_or_else(|| damaged("<AppendedData> does not end".into()))?;
    let (tag, rest) = rest.split_at(end);
    let is_raw = match String::from_utf8_lossy(tag).replace('\'', "\"") {
        tag if tag.contains("\"raw\"") => true,
        tag if tag.contains("\"base64\"") => false,
        _ => return Err(damaged("<AppendedData> has no encoding \"raw\" or \"base64\"".into())),
    };
    let start =
        rest.iter().position(|&byte| byte == b'_').ok_or_else(|| damaged("the appended data is empty".into()))?;
    let rest = &rest[start + 1..];
    // Base64 ends at the next tag; the arrays in raw data know their lengths.
    let end = rest.iter().position(|&byte| byte == b'<').filter(|_| !is_raw).unwrap_or(rest.len());
    Ok((text, Some(Appended { bytes: &rest[..end], is_raw })))
}

struct Reader<'a> {
    path: &'a Path,
    content: Content,
    text: &'a str,
    appended: Option<Appended<'a>>,
    encoding: Option<Encoding>,
    /// Line, number of points and number of cells of each piece.
    pieces: Vec<(usize, [usize; 2])>,
    arrays: Vec<(Section, Array)>,
}

impl Reader<'_> {
    fn read(mut self) -> Result<Grid, InputError> {
        let mut reader = quick_xml::Reader::from_str(self.text);
        let (mut line, mut counted, mut is_complete) = (1, 0, false);
        let (mut section, mut open) = (None, None::<(Tag, String)>);
        // Depth of elements within an array, such as the ranges that VTK writes there.
        let mut nested = 0_usize;
        loop {
            let event = reader.read_event();
            let at = usize::try_from(reader.buffer_position()).unwrap_or(usize::MAX).min(self.text.len());
            line += self.text.as_bytes()[counted..at].iter().filter(|&&byte| byte == b'\n').count();
            counted = at;
            let event = event.map_err(|error| self.error(line, format!("not XML: {error}")))?;
            let is_empty = matches!(&event, Event::Empty(tag) if tag.name().as_ref() == "DataArray");
            match event {
                Event::Start(_) if open.is_some() => nested += 1,
                Event::End(_) if nested > 0 => nested -= 1,
                Event::Text(_) if nested > 0 => {}
                Event::Start(tag) | Event::Empty(tag) if tag.name().as_ref() == "DataArray" => {
                    if let Some(read) = section.map(|_| self.tag(line, &tag)).transpose()? {
                        open = Some((read, String::new()));
                    }
                }
                Event::Start(tag) => match tag.name().as_ref() {
                    "VTKFile" => self.root(line, &tag)?,
                    "Piece" => self.piece(line, &tag)?,
                    element => section = self.content.section(element).or(section),
                },
                Event::Text(text) => {
                    if let Some((_, numbers)) = &mut open {
                        numbers.push_str(&text);
                    }
                }
                Event::End(tag) => match tag.name().as_ref() {
                    "DataArray" => self.close(&mut open, section)?,
                    "VTKFile" => is_complete = true,
                    element if self.content.section(element).is_some() => section = None,
                    _ => {}
                },
                Event::Eof => break,
                _ => {}
            }
            if is_empty {
                self.close(&mut open, section)?;
            }
        }
        // Appended data is cut off with the tag that ends the file.
        if !is_complete && self.encoding.is_some() && self.appended.is_none() {
            return Err(self.error(line, "the file ends before </VTKFile>"));
        }
        self.grid()
    }

    fn error(&self, line: usize, problem: impl Into<String>) -> InputError {
        InputError::at_line(self.path, line, problem, self.content.expected(), DAMAGED)
    }

    fn value(&self, line: usize, tag: &BytesStart<'_>, name: &str) -> Result<Option<String>, InputError> {
        attribute(tag, name).map_err(|error| self.error(line, error))
    }

    /// Reads the root element, which describes the encoding of all arrays.
    fn root(&mut self, line: usize, tag: &BytesStart<'_>) -> Result<(), InputError> {
        let kind = self.value(line, tag, "type")?.unwrap_or_default();
        if kind != self.content.data_set() {
            let problem = format!("the file holds the data set `{}`", crate::input::excerpt(&kind));
            let cure = "write the mesh as one unstructured grid (in ParaView: Merge Blocks, Save Data as .vtu)";
            return Err(InputError::at_line(self.path, line, problem, self.content.expected(), cure));
        }
        let compressor = self.value(line, tag, "compressor")?;
        if let Some(other) = compressor.as_deref().filter(|&name| !name.is_empty() && name != "vtkZLibDataCompressor") {
            let problem = format!("the arrays are compressed by `{}`", crate::input::excerpt(other));
            let expected = "arrays that are not compressed, or compressed by zlib (vtkZLibDataCompressor)";
            return Err(InputError::at_line(self.path, line, problem, expected, "write the file without compression"));
        }
        self.encoding = Some(Encoding {
            is_big_endian: self.value(line, tag, "byte_order")?.is_some_and(|order| order == "BigEndian"),
            header: if self.value(line, tag, "header_type")?.is_some_and(|of| of == "UInt64") { 8 } else { 4 },
            is_compressed: compressor.is_some_and(|name| !name.is_empty()),
        });
        Ok(())
    }

    fn piece(&mut self, line: usize, tag: &BytesStart<'_>) -> Result<(), InputError> {
        let count = |name: &str| {
            let text = self.value(line, tag, name)?;
            // `vtkio` omits the number of lines if there are none.
            let text = text.unwrap_or(if self.content == Content::Lines { "0".into() } else { String::new() });
            text.trim()
                .parse::<usize>()
                .map_err(|_| self.error(line, format!("`{name}` is `{}`, not a number", crate::input::excerpt(&text))))
        };
        let cells = if self.content == Content::Lines { "NumberOfLines" } else { "NumberOfCells" };
        let counts = [count("NumberOfPoints")?, count(cells)?];
        self.pieces.push((line, counts));
        Ok(())
    }

    fn tag(&self, line: usize, tag: &BytesStart<'_>) -> Result<Tag, InputError> {
        let of = |name: &str| self.value(line, tag, name);
        let name = of("Name")?.unwrap_or_default();
        let shown = || format!("the array `{}`", crate::input::excerpt(&name));
        let kind = of("type")?.unwrap_or_default();
        let number = NumberType::named(&kind)
            .ok_or_else(|| self.error(line, format!("{} has the type `{}`", shown(), crate::input::excerpt(&kind))))?;
        let components = match of("NumberOfComponents")?.map(|text| text.trim().parse()) {
            None => 1,
            Some(Ok(0)) => 1,
            Some(Ok(count)) => count,
            Some(Err(_)) => return Err(self.error(line, format!("{} has no valid `NumberOfComponents`", shown()))),
        };
        let format = match of("format")?.as_deref() {
            Some("ascii") => Format::Text,
            Some("binary") => Format::Base64,
            Some("appended") => {
                let offset = of("offset")?.and_then(|offset| offset.trim().parse().ok());
                Format::Appended(offset.ok_or_else(|| self.error(line, format!("{} has no valid `offset`", shown())))?)
            }
            _ => return Err(self.error(line, format!("{} has no format `ascii`, `binary` or `appended`", shown()))),
        };
        Ok(Tag { name, line, components, number, format })
    }

    /// Decodes the array that is open, if one is.
    fn close(&mut self, open: &mut Option<(Tag, String)>, section: Option<Section>) -> Result<(), InputError> {
        let (Some((tag, text)), Some(section)) = (open.take(), section) else { return Ok(()) };
        let Tag { name, line, components, number, format } = tag;
        let encoding = self.encoding.ok_or_else(|| self.error(line, "the file does not begin with <VTKFile>"))?;
        let numbers = match format {
            Format::Text => number.parse_text(&text),
            Format::Base64 => encoding.decode(Source::Base64(text.as_bytes()), number),
            Format::Appended(offset) => self.appended(offset).and_then(|source| encoding.decode(source, number)),
        };
        let numbers =
            numbers.map_err(|what| self.error(line, format!("the array `{}` {what}", crate::input::excerpt(&name))))?;
        self.arrays.push((section, Array { name, line, components, numbers }));
        Ok(())
    }

    fn appended(&self, offset: usize) -> Result<Source<'_>, String> {
        let Some(Appended { bytes, is_raw }) = self.appended else { return Err("has no appended data".into()) };
        let rest = bytes.get(offset..).ok_or_else(|| format!("begins at byte {offset} of {}", bytes.len()))?;
        Ok(if is_raw { Source::Raw(rest) } else { Source::Base64(rest) })
    }

    /// Returns the line of the only piece, and its numbers of points and cells.
    fn only_piece(&self) -> Result<(usize, [usize; 2]), InputError> {
        let expected = self.content.expected();
        if self.encoding.is_none() {
            let cure = "name a .vtu file, or a Gmsh file that ends in .msh";
            return Err(InputError::in_file(self.path, "the file has no <VTKFile>", expected, cure));
        }
        match self.pieces.as_slice() {
            &[piece] => Ok(piece),
            [] => Err(InputError::in_file(self.path, "the grid has no <Piece>", expected, DAMAGED)),
            &[_, (line, _), ..] => {
                let problem = format!("the grid consists of {} pieces", self.pieces.len());
                let cure = "merge the pieces and their shared points (in ParaView: Clean to Grid), and save again";
                Err(InputError::at_line(self.path, line, problem, "a grid of one piece", cure))
            }
        }
    }

    /// Takes the first array of a section, or that of this name, which must have `count` numbers.
    fn take(
        &mut self,
        piece: usize,
        section: Section,
        name: Option<&str>,
        count: Option<usize>,
    ) -> Result<Array, InputError> {
        let is_wanted = |(of, array): &(Section, Array)| *of == section && name.is_none_or(|name| array.name == name);
        let shown = name.unwrap_or("Points");
        let Some(at) = self.arrays.iter().position(is_wanted) else {
            return Err(self.error(piece, format!("the array `{shown}` is missing")));
        };
        let array = self.arrays.remove(at).1;
        let found = array.numbers.len();
        match count {
            Some(count) if found != count => {
                Err(self.error(array.line, format!("the array `{shown}` has {found} numbers; {count} are announced")))
            }
            _ => Ok(array),
        }
    }

    /// Collects the arrays of the only piece.
    fn grid(mut self) -> Result<Grid, InputError> {
        let (line, [points, cells]) = self.only_piece()?;
        let positions = self.take(line, Section::Points, None, Some(points.saturating_mul(3)))?;
        let connectivity = self.take(line, Section::Cells, Some("connectivity"), None)?;
        let offsets = self.take(line, Section::Cells, Some("offsets"), Some(cells))?;
        let types = match self.content {
            Content::Cells | Content::Grid => self.take(line, Section::Cells, Some("types"), Some(cells))?,
            Content::Lines => {
                Array { name: "types".into(), line, components: 1, numbers: Numbers::Integers(Vec::new()) }
            }
        };
        let (mut of_points, mut of_cells) = (Vec::new(), Vec::new());
        for (section, array) in self.arrays {
            match section {
                Section::PointData => of_points.push(array),
                Section::CellData => of_cells.push(array),
                Section::Points | Section::Cells => {}
            }
        }
        Ok(Grid { line, positions, connectivity, offsets, types, of_points, of_cells })
    }
}

impl Numbers {
    pub fn len(&self) -> usize {
        match self {
            Self::Integers(numbers) => numbers.len(),
            Self::Reals(numbers) => numbers.len(),
        }
    }
}
