//! `biotissue mesh`: writes the built-in meshes as Gmsh files, and summarizes mesh files.

mod info;
mod summary;

use std::path::{Path, PathBuf};

use biotissue::app::mesh_files::ENDINGS;
use biotissue::fem::element::ElementType;
use biotissue::fem::mesh::gmsh::{self, Version, WriteOptions};
use biotissue::fem::mesh::shapes::{self, DogboneShape, ShapeError, TubeShape};
use biotissue::fem::mesh::{Mesh, MeshError, QuadraticHexahedron};
use clap::{Args, Subcommand, ValueEnum};

use crate::failure::Failure;
use crate::number::real;
use crate::output::make_folder_of;

/// A shape to be meshed, or a mesh file to be read.
#[derive(Subcommand)]
pub enum MeshCommand {
    /// A box with its lowest corner at the origin: region `body`, surfaces x0 x1 y0 y1 z0 z1
    Box {
        /// Cells along x, y and z
        #[arg(long, value_name = "NX,NY,NZ", value_parser = three::<usize>, allow_hyphen_values = true)]
        cells: [usize; 3],
        /// Lengths along x, y and z, in meters
        #[arg(long, value_name = "X,Y,Z", value_parser = three::<f64>, default_value = "1,1,1", allow_hyphen_values = true)]
        size: [f64; 3],
        /// Elements: six tetrahedra per cell, one hexahedron, or two wedges
        #[arg(long, value_enum, default_value = "tet4")]
        element: LinearElement,
        #[command(flatten)]
        order: Order,
        #[command(flatten)]
        output: Output,
    },
    /// A hollow cylinder around z, from z = 0: region `wall`, surfaces inner, outer, z0, z1
    Tube {
        /// Cells through the wall, around the axis and along it
        #[arg(long, value_name = "NR,NA,NZ", value_parser = three::<usize>, allow_hyphen_values = true)]
        cells: [usize; 3],
        /// Radius of the lumen, in meters
        #[arg(long, value_name = "M", value_parser = real, allow_hyphen_values = true)]
        inner_radius: f64,
        /// Outer radius, in meters
        #[arg(long, value_name = "M", value_parser = real, allow_hyphen_values = true)]
        outer_radius: f64,
        /// Length along z, in meters
        #[arg(long, value_name = "M", value_parser = real, allow_hyphen_values = true)]
        length: f64,
        /// Elements: six tetrahedra per cell, one hexahedron, or two wedges
        #[arg(long, value_enum, default_value = "tet4")]
        element: LinearElement,
        #[command(flatten)]
        order: Order,
        #[command(flatten)]
        output: Output,
    },
    /// A flat tensile sample along x: regions `grip` and `gauge`, surfaces left, right, sides
    Dogbone {
        /// Edge of the elements in the grips, in meters; toward the gauge they become finer
        #[arg(long, value_name = "M", value_parser = real, allow_hyphen_values = true)]
        element_size: f64,
        #[command(flatten)]
        shape: ShapeArguments,
        #[command(flatten)]
        order: Order,
        #[command(flatten)]
        output: Output,
    },
    /// Reads a mesh file and lists its regions, surfaces, size and element quality
    Info(info::InfoArguments),
}

#[derive(Clone, Copy, ValueEnum)]
pub enum LinearElement {
    Tet4,
    Hex8,
    Wedge6,
}

impl LinearElement {
    fn element_type(self) -> ElementType {
        match self {
            Self::Tet4 => ElementType::Tet4,
            Self::Hex8 => ElementType::Hex8,
            Self::Wedge6 => ElementType::Wedge6,
        }
    }
}

/// The order of the elements.
#[derive(Args)]
pub struct Order {
    /// Order of the elements; 2 adds nodes at the centers of edges, on the tube along its curved surfaces
    #[arg(long, value_name = "1|2", value_parser = clap::value_parser!(u8).range(1..=2), default_value = "1")]
    order: u8,
    /// Nodes of a hexahedron of order 2; 27 adds the centers of faces and elements [default: 20]
    #[arg(long, value_name = "20|27", value_parser = ["20", "27"])]
    hexahedra: Option<String>,
}

impl Order {
    /// Returns the mesh with elements of this order, which follow the cylinders of a tube.
    fn apply(&self, mesh: Mesh, is_tube: bool) -> Result<Mesh, Failure> {
        let hexahedra = match self.hexahedra.as_deref() {
            Some(nodes) if self.order == 1 => {
                let problem = format!("--hexahedra {nodes} is given without --order 2");
                return Err(Failure::arguments(problem, "--order 2 beside it", "add --order 2, or omit --hexahedra"));
            }
            Some("27") => QuadraticHexahedron::Triquadratic,
            _ => QuadraticHexahedron::Serendipity,
        };
        if self.order == 1 {
            return Ok(mesh);
        }
        let quadratic = match is_tube {
            true => mesh.quadratic_between(hexahedra, shapes::between_on_tube),
            false => mesh.quadratic(hexahedra),
        };
        quadratic.map_err(|error| match error {
            MeshError::NoQuadraticType { .. } => Failure::arguments(
                "--order 2: there are no wedges of order 2",
                "tetrahedra or hexahedra",
                "omit --order, or choose --element tet4 or hex8",
            ),
            other => Failure::arguments(other.to_string(), "a mesh of order 1", "omit --order"),
        })
    }
}

/// Dimensions of the dogbone that differ from the default ones.
#[derive(Args)]
pub struct ShapeArguments {
    /// Length of the sample, in meters [default: 0.038]
    #[arg(long, value_name = "M", value_parser = real, allow_hyphen_values = true)]
    length: Option<f64>,
    /// Length of each grip [default: 0.006]
    #[arg(long, value_name = "M", value_parser = real, allow_hyphen_values = true)]
    grip_length: Option<f64>,
    /// Width of the grips [default: 0.010]
    #[arg(long, value_name = "M", value_parser = real, allow_hyphen_values = true)]
    grip_width: Option<f64>,
    /// Width of the gauge [default: 0.005]
    #[arg(long, value_name = "M", value_parser = real, allow_hyphen_values = true)]
    gauge_width: Option<f64>,
    /// Radius of the fillets between grip and gauge [default: 0.0125]
    #[arg(long, value_name = "M", value_parser = real, allow_hyphen_values = true)]
    fillet_radius: Option<f64>,
    /// Thickness of the sample [default: 0.0025]
    #[arg(long, value_name = "M", value_parser = real, allow_hyphen_values = true)]
    thickness: Option<f64>,
}

impl ShapeArguments {
    fn shape(&self) -> DogboneShape {
        let default = DogboneShape::default();
        DogboneShape {
            length: self.length.unwrap_or(default.length),
            grip_length: self.grip_length.unwrap_or(default.grip_length),
            grip_width: self.grip_width.unwrap_or(default.grip_width),
            gauge_width: self.gauge_width.unwrap_or(default.gauge_width),
            fillet_radius: self.fillet_radius.unwrap_or(default.fillet_radius),
            thickness: self.thickness.unwrap_or(default.thickness),
        }
    }
}

/// Where the mesh goes.
#[derive(Args)]
pub struct Output {
    /// The mesh file; a regular file of that name is replaced
    #[arg(short = 'o', long = "output", value_name = "FILE.msh")]
    file: PathBuf,
    /// Version of the Gmsh format
    #[arg(long, value_enum, default_value = "4.1")]
    format: Format,
    /// Write binary instead of text
    #[arg(long)]
    binary: bool,
    /// Print the summary as JSON
    #[arg(long)]
    json: bool,
}

#[derive(Clone, Copy, ValueEnum)]
enum Format {
    #[value(name = "2.2")]
    V2_2,
    #[value(name = "4.1")]
    V4_1,
}

/// Parses three values separated by commas.
fn three<T: std::str::FromStr + Copy>(text: &str) -> Result<[T; 3], String> {
    let values: Option<Vec<T>> = text.split(',').map(|value| value.trim().parse().ok()).collect();
    values
        .and_then(|values| values.try_into().ok())
        .ok_or_else(|| "expected three numbers separated by commas, as in 4,4,4".to_owned())
}

/// Makes the mesh, writes it and prints a summary, or prints that of a file.
pub fn run(command: MeshCommand) -> Result<(), Failure> {
    let is_tube = matches!(command, MeshCommand::Tube { .. });
    let (mesh, order, output) = match command {
        MeshCommand::Box { cells, size, element, order, output } => {
            (shapes::cuboid_of(element.element_type(), cells, size), order, output)
        }
        MeshCommand::Tube { cells, inner_radius, outer_radius, length, element, order, output } => {
            let shape = TubeShape { inner_radius, outer_radius, length };
            (shapes::tube(element.element_type(), cells, &shape), order, output)
        }
        MeshCommand::Dogbone { element_size, shape, order, output } => {
            (shapes::dogbone(&shape.shape(), element_size), order, output)
        }
        MeshCommand::Info(arguments) => return info::run(&arguments),
    };
    check_ending(&output.file)?;
    let mesh = order.apply(mesh.map_err(|error| shape_failure(&error))?, is_tube)?;
    let version = match output.format {
        Format::V2_2 => Version::V2_2,
        Format::V4_1 => Version::V4_1,
    };
    make_folder_of(&output.file)?;
    gmsh::write_with(&output.file, &mesh, WriteOptions { version, binary: output.binary })
        .map_err(|error| Failure::unwritable(&output.file, &error))?;
    summary::print(&output.file, &mesh, output.json)
}

/// Refuses the ending of another kind of file: the mesh would be read in another format than it has, or replace a case.
fn check_ending(file: &Path) -> Result<(), Failure> {
    let ending = file.extension().map(|ending| ending.to_ascii_lowercase());
    let is_other = |other: &&str| *other != "msh" && ending.as_ref().is_some_and(|ending| ending == other);
    if ENDINGS.iter().chain(&["vtk", "toml"]).any(is_other) {
        let what = format!("invalid --output {}", file.display());
        return Err(Failure::arguments(what, "a name that ends in .msh, for a file of Gmsh", "change the ending"));
    }
    Ok(())
}

/// Returns the failure for arguments that do not define a valid shape.
fn shape_failure(error: &ShapeError) -> Failure {
    let (expected, cure) = match error {
        ShapeError::NoCells(_) => ("at least one cell along each axis".to_owned(), "raise --cells"),
        ShapeError::TubeCells(_) => ("at least 1, 3 and 1 cells".to_owned(), "raise --cells"),
        ShapeError::NoWall { outer_radius, .. } => {
            (format!("an inner radius below {outer_radius}"), "lower --inner-radius or raise --outer-radius")
        }
        ShapeError::NotPositive { .. } => ("a positive, finite length in meters".to_owned(), "correct it"),
        ShapeError::TooManyElements(_) => {
            (format!("at most {} elements", shapes::MAX_ELEMENTS), "use fewer cells or larger elements")
        }
        ShapeError::ElementTooLarge { limit, .. } => (format!("at most {limit}"), "lower --element-size"),
        ShapeError::Mesh(_) => ("cells of positive volume".to_owned(), "use lengths closer to one another"),
        ShapeError::GaugeTooWide { .. } => {
            ("a gauge narrower than the grips".to_owned(), "lower --gauge-width or raise --grip-width")
        }
        ShapeError::FilletTooSmall { least, .. } => (format!("{least} or more"), "raise --fillet-radius"),
        ShapeError::NoGauge { taken, .. } => {
            (format!("a length of more than {taken}"), "raise --length, or lower --grip-length or --fillet-radius")
        }
    };
    Failure::arguments(error.to_string(), expected, cure)
}
