//! Writing of mesh files.

use std::io::{self, BufWriter, Write};
use std::path::Path;

use super::element_type::GmshType;
use crate::fem::mesh::{Mesh, measure};
use crate::output;

/// Version of the file format.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Version {
    /// Version 2.2, which most programs can read.
    V2_2,
    /// Version 4.1, the current version.
    #[default]
    V4_1,
}

/// Options for writing a mesh file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct WriteOptions {
    /// Version of the file format.
    pub version: Version,
    /// True for binary files (little-endian), false for text.
    pub binary: bool,
}

/// Writes a mesh as text of version 4.1; see [`write_with`].
///
/// # Errors
/// As for [`write_with`].
pub fn write(path: &Path, mesh: &Mesh) -> io::Result<()> {
    write_with(path, mesh, WriteOptions::default())
}

/// Writes a mesh, with regions and surfaces as named physical groups and coordinates in full precision.
///
/// An existing file keeps its content until the new one is complete, also if writing fails. Symbolic links, devices and
/// pipes are treated as in [`output::write`].
///
/// # Errors
/// Returns the error of the file system, or [`io::ErrorKind::InvalidInput`] if the mesh is too large for the numbers of
/// the format.
pub fn write_with(path: &Path, mesh: &Mesh, options: WriteOptions) -> io::Result<()> {
    output::write_by(path, |file| {
        let mut out = BufWriter::new(file);
        to_writer(&mut out, mesh, options)?;
        out.flush()
    })
}

/// Writes a mesh to a writer; see [`write_with`].
///
/// # Errors
/// Returns the error of the writer, or [`io::ErrorKind::InvalidInput`] if the mesh is too large for the numbers of the
/// format.
pub fn to_writer(out: &mut impl Write, mesh: &Mesh, options: WriteOptions) -> io::Result<()> {
    let faces: usize = mesh.surfaces().iter().map(|surface| surface.faces.len()).sum();
    // Tags are signed 32-bit integers in version 2 and in the entities of binary files.
    for count in [mesh.nodes().len(), mesh.elements().len() + faces, mesh.regions().len(), mesh.surfaces().len()] {
        if i32::try_from(count).is_err() {
            let problem = format!("{count} nodes, elements or groups are more than Gmsh's 32-bit numbers can address");
            return Err(io::Error::new(io::ErrorKind::InvalidInput, problem));
        }
    }
    let mut sink = Sink { out, binary: options.binary, row_begun: false };
    sink.header(options.version)?;
    sink.names(mesh)?;
    match options.version {
        Version::V2_2 => sink.version2(mesh, faces),
        Version::V4_1 => sink.version4(mesh, faces),
    }
}

/// Writes numbers as text or binary.
struct Sink<'a, W> {
    out: &'a mut W,
    binary: bool,
    row_begun: bool,
}

impl<W: Write> Sink<'_, W> {
    fn header(&mut self, version: Version) -> io::Result<()> {
        let version = match version {
            Version::V2_2 => "2.2",
            Version::V4_1 => "4.1",
        };
        writeln!(self.out, "$MeshFormat\n{version} {} 8", u8::from(self.binary))?;
        if self.binary {
            self.out.write_all(&1_i32.to_le_bytes())?;
            writeln!(self.out)?;
        }
        writeln!(self.out, "$EndMeshFormat")
    }

    /// Writes the physical names. Regions and surfaces are both numbered from 1, since only the numbers of one
    /// dimension must be unique.
    fn names(&mut self, mesh: &Mesh) -> io::Result<()> {
        writeln!(self.out, "$PhysicalNames\n{}", mesh.surfaces().len() + mesh.regions().len())?;
        for (number, name) in (1..).zip(mesh.surface_names()) {
            writeln!(self.out, "2 {number} \"{name}\"")?;
        }
        for (number, name) in (1..).zip(mesh.regions()) {
            writeln!(self.out, "3 {number} \"{name}\"")?;
        }
        writeln!(self.out, "$EndPhysicalNames")
    }

    fn version2(&mut self, mesh: &Mesh, faces: usize) -> io::Result<()> {
        writeln!(self.out, "$Nodes\n{}", mesh.nodes().len())?;
        for (tag, node) in (1..).zip(mesh.nodes()) {
            self.int(tag)?;
            self.numbers(node)?;
            self.end_row()?;
        }
        self.end("Nodes")?;
        writeln!(self.out, "$Elements\n{}", faces + mesh.elements().len())?;
        let mut tag = 1;
        for (group, surface) in (1..).zip(mesh.surfaces()) {
            for block in surface.faces.blocks() {
                self.block2(block.cell_type().number(), block.len())?;
                for face in block.iter() {
                    self.cell2(&mut tag, block.cell_type(), group, face)?;
                }
            }
        }
        for block in mesh.elements().blocks() {
            self.block2(block.cell_type().number(), block.len())?;
            for (element, &region) in block.iter().zip(&mesh.region_of()[block.range()]) {
                self.cell2(&mut tag, block.cell_type(), region as i32 + 1, element)?;
            }
        }
        self.end("Elements")
    }

    /// Writes the header of a block of elements of one type in a binary file.
    fn block2(&mut self, kind: i32, count: usize) -> io::Result<()> {
        if self.binary { self.ints(&[kind, count as i32, 2]) } else { Ok(()) }
    }

    /// Writes an element with its two tags, physical group and entity, which have the same number.
    fn cell2(&mut self, tag: &mut i32, cell_type: impl GmshType, group: i32, nodes: &[u32]) -> io::Result<()> {
        self.int(*tag)?;
        if !self.binary {
            self.ints(&[cell_type.number(), 2])?;
        }
        self.ints(&[group, group])?;
        for node in in_order_of_gmsh(cell_type, nodes) {
            self.int(node as i32 + 1)?;
        }
        *tag += 1;
        self.end_row()
    }

    fn version4(&mut self, mesh: &Mesh, faces: usize) -> io::Result<()> {
        self.entities4(mesh)?;
        let count = mesh.nodes().len();
        writeln!(self.out, "$Nodes")?;
        self.sizes(&[1, count, 1, count])?;
        self.ints(&[3, 1, 0])?;
        self.sizes(&[count])?;
        for tag in 1..=count {
            self.size(tag)?;
            self.end_row()?;
        }
        for node in mesh.nodes() {
            self.numbers(node)?;
            self.end_row()?;
        }
        self.end("Nodes")?;
        writeln!(self.out, "$Elements")?;
        let count = faces + mesh.elements().len();
        // A block is a run of consecutive elements of one type and region, so the order of the elements is preserved.
        let blocks = mesh.elements().blocks();
        let runs = blocks.iter().map(|block| mesh.region_of()[block.range()].chunk_by(|a, b| a == b));
        let of_surfaces: usize = mesh.surfaces().iter().map(|surface| surface.faces.blocks().len()).sum();
        self.sizes(&[of_surfaces + runs.clone().flatten().count(), count, 1, count])?;
        let mut tag = 1;
        for (entity, surface) in (1..).zip(mesh.surfaces()) {
            for block in surface.faces.blocks() {
                self.ints(&[2, entity, block.cell_type().number()])?;
                self.sizes(&[block.len()])?;
                for face in block.iter() {
                    self.cell4(&mut tag, block.cell_type(), face)?;
                }
            }
        }
        for (block, runs) in blocks.iter().zip(runs) {
            let mut elements = block.iter();
            for run in runs {
                self.ints(&[3, run[0] as i32 + 1, block.cell_type().number()])?;
                self.sizes(&[run.len()])?;
                for element in elements.by_ref().take(run.len()) {
                    self.cell4(&mut tag, block.cell_type(), element)?;
                }
            }
        }
        self.end("Elements")
    }

    fn cell4(&mut self, tag: &mut usize, cell_type: impl GmshType, nodes: &[u32]) -> io::Result<()> {
        self.size(*tag)?;
        for node in in_order_of_gmsh(cell_type, nodes) {
            self.size(node as usize + 1)?;
        }
        *tag += 1;
        self.end_row()
    }

    /// Writes one entity per surface and per region, in the physical group of the same number.
    fn entities4(&mut self, mesh: &Mesh) -> io::Result<()> {
        writeln!(self.out, "$Entities")?;
        self.sizes(&[0, 0, mesh.surfaces().len(), mesh.regions().len()])?;
        let position = |&node: &u32| mesh.nodes()[node as usize];
        for (tag, surface) in (1..).zip(mesh.surfaces()) {
            let bounds = measure::bounding_box(surface.faces.iter().flatten().map(position));
            self.entity4(tag, bounds)?;
        }
        for (region, tag) in (0..mesh.regions().len() as u32).zip(1..) {
            let nodes = mesh.elements_in(region).flat_map(|element| &mesh.elements()[element]);
            self.entity4(tag, measure::bounding_box(nodes.map(position)))?;
        }
        self.end("Entities")
    }

    fn entity4(&mut self, tag: i32, bounds: [[f64; 3]; 2]) -> io::Result<()> {
        self.int(tag)?;
        self.numbers(bounds.as_flattened())?;
        self.size(1)?;
        self.int(tag)?;
        self.sizes(&[0])
    }

    // Numbers; in text files, spaces separate the numbers of a row.

    fn ints(&mut self, values: &[i32]) -> io::Result<()> {
        values.iter().try_for_each(|&value| self.int(value))
    }

    /// Writes sizes and ends the row.
    fn sizes(&mut self, values: &[usize]) -> io::Result<()> {
        values.iter().try_for_each(|&value| self.size(value))?;
        self.end_row()
    }

    fn numbers(&mut self, values: &[f64]) -> io::Result<()> {
        values.iter().try_for_each(|&value| {
            if self.binary { self.out.write_all(&value.to_le_bytes()) } else { self.word(format_args!("{value:?}")) }
        })
    }

    fn int(&mut self, value: i32) -> io::Result<()> {
        if self.binary { self.out.write_all(&value.to_le_bytes()) } else { self.word(format_args!("{value}")) }
    }

    fn size(&mut self, value: usize) -> io::Result<()> {
        if self.binary { self.out.write_all(&(value as u64).to_le_bytes()) } else { self.word(format_args!("{value}")) }
    }

    fn word(&mut self, word: std::fmt::Arguments<'_>) -> io::Result<()> {
        let space = if std::mem::replace(&mut self.row_begun, true) { " " } else { "" };
        write!(self.out, "{space}{word}")
    }

    fn end_row(&mut self) -> io::Result<()> {
        self.row_begun = false;
        if self.binary { Ok(()) } else { writeln!(self.out) }
    }

    fn end(&mut self, section: &str) -> io::Result<()> {
        let line_break = if self.binary { "\n" } else { "" };
        writeln!(self.out, "{line_break}$End{section}")
    }
}

/// Returns the nodes of a cell in the order of Gmsh.
fn in_order_of_gmsh(cell_type: impl GmshType, nodes: &[u32]) -> Vec<u32> {
    let mut ordered = nodes.to_vec();
    for (&place, &node) in cell_type.places().into_iter().flatten().zip(nodes) {
        ordered[place] = node;
    }
    ordered
}
