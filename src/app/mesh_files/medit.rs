//! Text files of Medit (`.mesh`), as Mmg, Tetgen, FreeFem, Netgen and Gmsh write them.

use std::path::Path;

use super::assemble::{Contents, Face, Volume, order_by_edges};
use super::text_of;
use crate::fem::element::{CellType, ElementType, FaceType};
use crate::fem::mesh::gmsh::MeshFile;
use crate::input::{InputError, excerpt};

const EXPECTED: &str = "a mesh in Medit's text form (.mesh): keywords with numbers of lines, and the lines";
const DAMAGED: &str = "the file is damaged or cut off: write it again";

/// What a section holds.
#[derive(Clone, Copy)]
enum Section {
    Volumes(ElementType),
    Faces(FaceType),
}

fn section(keyword: &str) -> Option<Section> {
    Some(match keyword {
        "Tetrahedra" => Section::Volumes(ElementType::Tet4),
        "TetrahedraP2" => Section::Volumes(ElementType::Tet10),
        "Hexahedra" => Section::Volumes(ElementType::Hex8),
        "Prisms" => Section::Volumes(ElementType::Wedge6),
        "Triangles" => Section::Faces(FaceType::Tri3),
        "TrianglesP2" => Section::Faces(FaceType::Tri6),
        "Quadrilaterals" => Section::Faces(FaceType::Quad4),
        _ => return None,
    })
}

/// Elements that would be missing in the body.
const UNSUPPORTED: [&str; 8] = [
    "Pyramids",
    "HexahedraQ2",
    "PrismsP2",
    "PyramidsP2",
    "QuadrilateralsQ2",
    "TetrahedraP3",
    "TrianglesP3",
    "TetrahedraP4",
];

/// Reads a mesh.
pub(super) fn read(path: &Path) -> Result<MeshFile, InputError> {
    let text = text_of(path, EXPECTED)?;
    let mut words = Words::of(path, &text);
    let mut contents = Contents::default();
    let (mut volumes, mut faces) = (Vec::new(), Vec::new());
    while let Some((line, keyword)) = words.next_keyword() {
        match keyword {
            "Dimension" => {
                let dimension = words.count(keyword)?;
                if dimension != 3 {
                    let problem = format!("the mesh has {dimension} dimensions");
                    return Err(InputError::at_line(
                        path,
                        line,
                        problem,
                        "a mesh in space",
                        "mesh a body, not a plane",
                    ));
                }
            }
            "Vertices" => {
                for _ in 0..words.count(keyword)? {
                    contents.nodes.push([words.real()?, words.real()?, words.real()?]);
                    words.integer()?;
                }
            }
            "End" => break,
            keyword if UNSUPPORTED.contains(&keyword) => {
                let problem = format!("the file has `{keyword}`");
                let expected = "tetrahedra of order 1 or 2, hexahedra and prisms of order 1, and faces of them";
                return Err(InputError::at_line(path, line, problem, expected, "export the mesh with these elements"));
            }
            keyword => match section(keyword) {
                Some(Section::Volumes(of)) => words.cells(keyword, of, of.nodes(), &mut volumes)?,
                Some(Section::Faces(of)) => words.cells(keyword, of, of.nodes(), &mut faces)?,
                // Edges, corners, normals and the like.
                None => words.skip_numbers(),
            },
        }
    }
    let node = |index: i64, line: usize| {
        let count = contents.nodes.len();
        usize::try_from(index - 1).ok().filter(|&index| index < count).map(|index| index as u32).ok_or_else(|| {
            let problem = format!("there is no vertex {index}; the file has {count}, from 1");
            InputError::at_line(path, line, problem, EXPECTED, DAMAGED)
        })
    };
    let nodes = |of: &[i64], line| of.iter().map(|&index| node(index, line)).collect::<Result<Vec<u32>, _>>();
    let mut read = Vec::with_capacity(volumes.len());
    for (id, Cell { of, nodes: indices, reference, line }) in (1..).zip(&volumes) {
        read.push((
            Volume { element_type: *of, nodes: nodes(indices, *line)?, id, line: *line, region: 0 },
            *reference,
        ));
    }
    let mut of_faces = Vec::with_capacity(faces.len());
    for Cell { of, nodes: indices, reference, line } in &faces {
        of_faces.push((*reference, Face { face_type: *of, nodes: nodes(indices, *line)?, line: *line }));
    }
    // Regions and surfaces in the order of their numbers.
    let mut references: Vec<i64> = read.iter().map(|(_, reference)| *reference).collect();
    references.sort_unstable();
    references.dedup();
    contents.regions = references.iter().map(|reference| format!("region_{reference}")).collect();
    for (mut volume, reference) in read {
        volume.region = references.partition_point(|&other| other < reference) as u32;
        contents.volumes.push(volume);
    }
    of_faces.sort_by_key(|(reference, _)| *reference);
    of_faces.into_iter().for_each(|(reference, face)| contents.add_face(&format!("surface_{reference}"), face));
    order_by_edges(&mut contents.volumes, &contents.nodes);
    contents.into_mesh(path)
}

/// An element or a face: its nodes, from 1, and its reference.
struct Cell<T> {
    of: T,
    nodes: Vec<i64>,
    reference: i64,
    line: usize,
}

/// The words of a file with their lines; `#` begins a comment.
struct Words<'a> {
    path: &'a Path,
    words: std::iter::Peekable<Box<dyn Iterator<Item = (usize, &'a str)> + 'a>>,
    /// The line of the last word.
    line: usize,
}

impl<'a> Words<'a> {
    fn of(path: &'a Path, text: &'a str) -> Self {
        let words = (1..).zip(text.lines()).flat_map(|(line, text)| {
            text.split('#').next().unwrap_or_default().split_whitespace().map(move |word| (line, word))
        });
        let words: Box<dyn Iterator<Item = (usize, &'a str)> + 'a> = Box::new(words);
        Self { path, words: words.peekable(), line: 1 }
    }

    /// Returns the next keyword, without the numbers before it.
    fn next_keyword(&mut self) -> Option<(usize, &'a str)> {
        self.skip_numbers();
        self.words.next()
    }

    fn skip_numbers(&mut self) {
        while self.words.next_if(|(_, word)| !word.starts_with(|c: char| c.is_ascii_alphabetic())).is_some() {}
    }

    fn number<T: std::str::FromStr>(&mut self, what: &str) -> Result<T, InputError> {
        let Some((line, word)) = self.words.next() else {
            let problem = "the file ends within a section";
            return Err(InputError::in_file(self.path, problem, EXPECTED, DAMAGED));
        };
        self.line = line;
        word.parse().map_err(|_| {
            InputError::at_line(self.path, line, format!("`{}` is not {what}", excerpt(word)), EXPECTED, DAMAGED)
        })
    }

    fn integer(&mut self) -> Result<i64, InputError> {
        self.number("a whole number")
    }

    fn real(&mut self) -> Result<f64, InputError> {
        self.number("a number")
    }

    /// Reads the number of lines of a section.
    fn count(&mut self, keyword: &str) -> Result<usize, InputError> {
        self.number(&format!("the number of {keyword}"))
    }

    fn cells<T: Copy>(&mut self, keyword: &str, of: T, count: usize, out: &mut Vec<Cell<T>>) -> Result<(), InputError> {
        for _ in 0..self.count(keyword)? {
            let nodes = (0..count).map(|_| self.integer()).collect::<Result<_, _>>()?;
            let (reference, line) = (self.integer()?, self.line);
            out.push(Cell { of, nodes, reference, line });
        }
        Ok(())
    }
}
