//! Plausibility check of the loads, stiffnesses, lengths and elements of a case, which finds wrong units and poor meshes
//! before the solve.
//!
//! Each load is converted to the strain that it would cause in a uniform body: a displacement divided by the longest
//! edge of the body, a traction divided by the stiffness of the softest region on which it acts, a body force times that
//! edge divided by the same stiffness, a point force divided by the mean cross-section of the body and by that stiffness.
//! These are orders of magnitude, sufficient to find a modulus in MPa or a mesh in mm, and not used otherwise.

mod fibers;
mod floppy;
mod load_size;
mod loads;
mod locking;
mod shapes;

use crate::app::case::{Case, Formula, MeshSource, RegionMaterial, RigidCase, RveScale, StressScale, SurfaceLoad};
use crate::fem::mesh::Mesh;
use crate::las::RealBackend;
use crate::tissue::micro_scale::Library;
use fibers::check_fibers;
pub(super) use floppy::floppy_networks;
pub use floppy::{Examination, FloppyNetworks};
pub use load_size::{LoadOf, LoadSize};
use loads::{Load, loads};
use locking::{check_locking, greatest_poisson_ratio};
use shapes::check_shapes;

/// Strain above which a load is implausible for tissue.
const LARGEST_STRAIN: f64 = 3.0;
/// If every load of a case causes less strain than this, one of its units is probably wrong.
const SMALLEST_STRAIN: f64 = 1e-6;
/// The ratio of the sum of the fibers' moduli to Young's modulus of an isotropic network that deforms affinely, which has
/// both Lame constants equal to a fifteenth of this sum.
const AFFINE: f64 = 6.0;
/// Above this ratio, the softer of two materials, in different regions or in parallel, contributes nothing.
const LARGEST_RATIO: f64 = 1e6;
/// Range of the stiffness of a tissue, Pa, outside of which a unit is probably wrong.
const SENSIBLE_STIFFNESSES: std::ops::RangeInclusive<f64> = 1.0..=1e12;
/// Distance of a reference point from the body, in longest edges of the body, above which its unit is probably wrong.
const LARGEST_DISTANCE: f64 = 10.0;
/// Range of the longest edge of the body, m, outside of which its unit is probably wrong.
const SENSIBLE_EDGES: std::ops::RangeInclusive<f64> = 1e-5..=5.0;

/// The longest edge of a sample of tissue, m. A mesh file does not tell its unit: a larger body whose case does not state
/// one either is probably in mm.
pub const LARGEST_SAMPLE: f64 = 0.5;

/// The stiffness of a region of the case at rest, Pa.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Stiffness {
    /// Index of the region in the case.
    region: usize,
    /// Young's modulus of the softest and of the stiffest formula, or matrix.
    formula: Option<[f64; 2]>,
    /// `kappa sum E A L / 6` of the softest and of the stiffest network: Young's modulus of an isotropic network whose nodes
    /// move with the body, which is an upper bound for isotropic networks of straight fibers.
    fibers: Option<[f64; 2]>,
}

impl Stiffness {
    /// Returns the stiffness of a region of the case.
    fn of_region<B: RealBackend>(library: &Library<B>, region: usize) -> Self {
        let formulas = library.formulas_of_region(region).iter().map(|formula| youngs_modulus(formula));
        let networks = library.models_of_region(region).iter().map(|&model| {
            let model = &library.models()[model];
            model.scale() * model.truss().volume_of_moduli() / AFFINE
        });
        Self { region, formula: range(formulas), fibers: range(networks) }
    }

    /// The stiffness that resists a load: RVE and matrix in parallel.
    fn total(&self) -> f64 {
        let softest = |range: Option<[f64; 2]>| range.map_or(0.0, |[softest, _]| softest);
        softest(self.formula) + softest(self.fibers)
    }
}

/// What the check found.
pub(super) struct Plausibility {
    /// Implausible numbers, one line each, with the place in the case file.
    pub warnings: Vec<String>,
    /// The sizes of the tractions, pressures, point forces and body forces.
    pub loads: Vec<LoadSize>,
}

/// Checks the numbers of a case.
pub(super) fn check<B: RealBackend>(case: &Case, mesh: &Mesh, library: &Library<B>) -> Plausibility {
    let mut regions: Vec<usize> = mesh.regions().iter().filter_map(|name| case.region_of(name)).collect();
    regions.sort_unstable();
    regions.dedup();
    let stiffnesses: Vec<Stiffness> = regions.into_iter().map(|region| Stiffness::of_region(library, region)).collect();
    let Plausibility { mut warnings, loads } = check_magnitudes(case, mesh, &stiffnesses);
    warnings.extend(check_fibers(case, library));
    warnings.extend(check_shapes(case, mesh));
    let ratios = (0..case.regions.len()).map(|region| greatest_poisson_ratio(library.formulas_of_region(region)));
    warnings.extend(check_locking(case, mesh, &ratios.collect::<Vec<_>>()));
    Plausibility { warnings, loads }
}

/// Returns the least and the greatest of these numbers; `None` without any.
fn range(numbers: impl Iterator<Item = f64>) -> Option<[f64; 2]> {
    numbers.map(|number| [number; 2]).reduce(|[min, max], [number, _]| [min.min(number), max.max(number)])
}

fn youngs_modulus(formula: &Formula) -> f64 {
    let [mu, bulk] = formula.mean_moduli();
    9.0 * bulk * mu / (3.0 * bulk + mu)
}

fn check_magnitudes(case: &Case, mesh: &Mesh, stiffnesses: &[Stiffness]) -> Plausibility {
    let edge = longest_edge(mesh);
    let mut warnings = Vec::new();
    warnings.extend(check_size(case, mesh, edge));
    warnings.extend(check_references(case, mesh, edge));
    warnings.extend(check_stiffnesses(case, stiffnesses));
    warnings.extend(stiffnesses.iter().filter_map(|stiffness| check_stiffness(case, stiffness)));
    let loads = loads(case, mesh, edge, stiffnesses);
    warnings.extend(
        loads.iter().filter(|load| load.strain > LARGEST_STRAIN).map(|load| at(case, load.line, &load.message)),
    );
    let greatest = loads.iter().map(|load| load.strain).fold(0.0, f64::max);
    if greatest > 0.0 && greatest < SMALLEST_STRAIN {
        warnings.push(format!(
            "{}: the loads strain the body by at most about {}: are displacements in m, forces and moduli in Pa, and \
             is the `scale` of [mesh] right?",
            case.file.display(),
            short(greatest)
        ));
    }
    Plausibility { warnings, loads: loads.into_iter().filter_map(|Load { size, .. }| size).collect() }
}

/// Finds a body that is too large or too small for tissue, and names the `scale` that its mesh probably needs.
fn check_size(case: &Case, mesh: &Mesh, edge: f64) -> Option<String> {
    let is_sensible = SENSIBLE_EDGES.contains(&edge);
    let states_unit = case.mesh_scale_line.is_some() || !matches!(case.mesh, MeshSource::File(_));
    if is_sensible && (states_unit || edge <= LARGEST_SAMPLE) {
        return None;
    }
    let [low, high] = mesh.bounding_box();
    let lengths = [0, 1, 2].map(|axis| short(high[axis] - low[axis])).join(" x ");
    let cure = match case.mesh_scale {
        _ if is_sensible => {
            "if the mesh is in mm, set `scale = 0.001` in [mesh]; if it is in m, `scale = 1` confirms that".into()
        }
        1.0 if edge > *SENSIBLE_EDGES.end() => {
            // The largest length of a mesh unit with which the body is of a sensible size.
            let (scale, unit) = if edge * 1e-3 <= *SENSIBLE_EDGES.end() { ("0.001", "mm") } else { ("1e-6", "um") };
            format!("if the mesh is in {unit}, set `scale = {scale}` in [mesh]")
        }
        scale => format!("`scale` of [mesh], now {scale:?}, is the length of a mesh unit in m: 0.001 for a mesh in mm"),
    };
    Some(at(case, case.mesh_line, &format!("the body measures {lengths} m: {cure}")))
}

/// Finds reference points of rigid surfaces far from the body.
fn check_references<'a>(case: &'a Case, mesh: &'a Mesh, edge: f64) -> impl Iterator<Item = String> + 'a {
    let [low, high] = mesh.bounding_box();
    case.boundaries.iter().filter_map(move |boundary| {
        let SurfaceLoad::Rigid(RigidCase { reference: Some(reference), .. }) = &boundary.load else { return None };
        let outside = |axis: usize| {
            let x = reference[axis] * case.mesh_scale;
            (low[axis] - x).max(x - high[axis]).max(0.0)
        };
        let distance = (0..3).map(outside).fold(0.0, f64::hypot);
        (distance > LARGEST_DISTANCE * edge).then(|| {
            let message = format!(
                "the reference point of surface \"{}\" is {} m away from the body, whose longest edge is {} m: is `reference` in \
                 mesh units?",
                boundary.surface,
                short(distance),
                short(edge)
            );
            at(case, boundary.line, &message)
        })
    })
}

/// Finds a material that is softer or stiffer than any tissue.
fn check_stiffness(case: &Case, stiffness: &Stiffness) -> Option<String> {
    let total = stiffness.total();
    if total == 0.0 || SENSIBLE_STIFFNESSES.contains(&total) {
        return None;
    }
    let is_raw = matches!(
        &case.regions[stiffness.region].material,
        RegionMaterial::FiberRve(rve) if rve.scale == RveScale::Uniform(StressScale::Raw)
    );
    let than = if total < 1.0 { "softer" } else { "stiffer" };
    let cure = match is_raw {
        true => "with `scale = \"raw\"`, the `radius` is in units of the edge of the cube",
        false => "moduli are in Pa (1 MPa is 1e6)",
    };
    let message = format!("about {} Pa is {than} than any tissue: {cure}", short(total));
    Some(in_region(case, stiffness.region, &message))
}

/// Compares the materials of different regions, and fibers and matrix in parallel.
fn check_stiffnesses<'a>(case: &'a Case, stiffnesses: &'a [Stiffness]) -> impl Iterator<Item = String> + 'a {
    let within = stiffnesses.iter().filter_map(|stiffness| {
        let ([matrix, _], [least, most]) = (stiffness.formula?, stiffness.fibers?);
        let fibers = if matrix > most { least } else { most };
        let ratio = (matrix / fibers).max(fibers / matrix);
        (ratio > LARGEST_RATIO).then(|| {
            let message = format!(
                "the fibers give about {} Pa and the matrix {} Pa, so the {} {} times as stiff: are both moduli in Pa and the \
                 radius in m?",
                short(fibers),
                short(matrix),
                if matrix > fibers { "matrix is" } else { "fibers are" },
                short(ratio)
            );
            in_region(case, stiffness.region, &message)
        })
    });
    let by_total = |a: &&Stiffness, b: &&Stiffness| a.total().total_cmp(&b.total());
    let (softest, stiffest) = (stiffnesses.iter().min_by(by_total), stiffnesses.iter().max_by(by_total));
    let between_regions = softest.zip(stiffest).and_then(|(soft, stiff)| {
        let ratio = stiff.total() / soft.total();
        (ratio > LARGEST_RATIO).then(|| {
            let message = format!(
                "about {} Pa, {} times stiffer than the region \"{}\" with {} Pa: are all moduli in Pa?",
                short(stiff.total()),
                short(ratio),
                case.regions[soft.region].name,
                short(soft.total())
            );
            in_region(case, stiff.region, &message)
        })
    });
    within.chain(between_regions)
}

/// The longest edge of the bounding box of the body, m.
fn longest_edge(mesh: &Mesh) -> f64 {
    let [low, high] = mesh.bounding_box();
    (0..3).map(|axis| high[axis] - low[axis]).fold(0.0, f64::max)
}

/// Formats a number with two decimals, or else two significant digits, since only its order of magnitude is meaningful.
fn short(x: f64) -> String {
    if (0.01..1e4).contains(&x) { format!("{}", (x * 100.0).round() / 100.0) } else { format!("{x:.1e}") }
}

fn at(case: &Case, line: usize, message: &str) -> String {
    format!("{}:{line}: {message}", case.file.display())
}

fn in_region(case: &Case, region: usize, message: &str) -> String {
    let region = &case.regions[region];
    at(case, region.line, &format!("region \"{}\": {message}", region.name))
}

#[cfg(test)]
pub(super) mod tests {
    use std::path::Path;
    use std::sync::Arc;

    use super::*;
    use crate::fem::element::ElementType;
    use crate::fem::mesh::shapes::{cuboid, cuboid_of};

    pub const CASE: &str = r#"[mesh]
generate = { shape = "box", cells = [1, 1, 1], size = [1.0, 1.0, 1.0] }
[[region]]
name = "*"
material = { model = "neo-hookean", shear_modulus = 1.0e3, poisson_ratio = 0.25 }
[[boundary]]
surface = "x0"
displacement = { x = 0.0, y = 0.0, z = 0.0 }
[[boundary]]
surface = "x1"
displacement = { x = 0.1 }
"#;
    const PULLED: &str = "displacement = { x = 0.1 }";

    /// Returns the warnings of a case on a box of this edge, without the name of the file.
    fn warnings_of(text: &str, edge: f64, fibers: Option<[f64; 2]>) -> Vec<String> {
        let case = Case::parse(text, Path::new("case.toml")).unwrap_or_else(|errors| panic!("{errors}")).case;
        let mesh = cuboid([1, 1, 1], [edge, 0.5 * edge, 0.5 * edge]).unwrap();
        let formula = case.regions[0].material.formula().and_then(|formula| formula.constant());
        let formula = formula.map(|formula| [youngs_modulus(formula); 2]);
        let warnings = check_magnitudes(&case, &mesh, &[Stiffness { region: 0, formula, fibers }]).warnings;
        warnings.into_iter().map(|warning| warning.strip_prefix("case.toml:").unwrap().to_owned()).collect()
    }

    #[test]
    fn consistent_units_give_no_warning() {
        assert_eq!(warnings_of(CASE, 1.0, None), [""; 0]);
        for load in ["traction = [4e2, 0, 0]", "traction = [0, -1e-2, 0]", "displacement = { x = 0.0 }"] {
            assert_eq!(warnings_of(&CASE.replace(PULLED, load), 1.0, None), [""; 0], "{load}");
        }
        // A load may be small if another one is not.
        let force = "[[body_force]]\nregion = \"*\"\nvalue = [0, 0, 1e-12]\n";
        assert_eq!(warnings_of(&format!("{CASE}{force}"), 1.0, Some([1e2, 1e8])), [""; 0]);
    }

    #[test]
    fn a_modulus_in_megapascals_is_found() {
        // 1 kPa and 1 TPa in MPa, moved by displacements.
        for (modulus, expected) in [
            ("1.0e-3", "3: region \"*\": about 2.5e-3 Pa is softer than any tissue: moduli are in Pa (1 MPa is 1e6)"),
            ("1.0e12", "3: region \"*\": about 2.5e12 Pa is stiffer than any tissue: moduli are in Pa (1 MPa is 1e6)"),
        ] {
            assert_eq!(warnings_of(&CASE.replace("1.0e3", modulus), 1.0, None), [expected]);
        }
    }

    #[test]
    fn a_mesh_in_millimeters_is_found() {
        let found = |text: &str, edge: f64| warnings_of(text, edge, None);
        let size = "2: the body measures 50 x 25 x 25 m: if the mesh is in mm, set `scale = 0.001` in [mesh]";
        assert_eq!(found(CASE, 50.0), [size]);
        let size = "2: the body measures 8000 x 4000 x 4000 m: if the mesh is in um, set `scale = 1e-6` in [mesh]";
        assert_eq!(found(CASE, 8000.0), [size]);
        let scaled = CASE.replace("[mesh]\n", "[mesh]\nscale = 0.001\n").replace("x = 0.1", "x = 1e-6");
        let size = "3: the body measures 5.0e-6 x 2.5e-6 x 2.5e-6 m: `scale` of [mesh], now 0.001, is the length of a mesh unit in m: \
                    0.001 for a mesh in mm";
        assert_eq!(found(&scaled, 5e-6), [size]);
        let long = CASE.replace("x = 0.1", "x = -5.0");
        let displacement = "9: the displacement of surface \"x1\" is 5 m, and the longest edge of the body 0.1 m: are both in \
                            m? `scale` of [mesh] is the length of a mesh unit in m";
        assert_eq!(warnings_of(&long, 0.1, None), [displacement]);
        let curved = CASE.replace(PULLED, "displacement = { x = 1.0 }\ncurve = [[0, 0], [0.5, -5], [1, 0]]");
        assert_eq!(warnings_of(&curved, 0.1, None).len(), 1);
    }

    #[test]
    fn loads_and_moduli_in_other_units_are_found() {
        // E = 2.5 mu.
        let traction = CASE.replace(PULLED, "traction = [4e6, 0, 0]");
        let expected = "9: the traction on surface \"x1\" is 4.0e6 Pa, 1600 times the stiffness of the region \"*\", about \
                                2500 Pa: are both in Pa?";
        assert_eq!(warnings_of(&traction, 1.0, None), [expected]);
        let force = format!("{CASE}[[body_force]]\nregion = \"*\"\nvalue = [0, 0, -1e7]\n");
        let expected = "12: the body force is 1.0e7 N/m^3 over 0.5 m, 2000 times the stiffness of the region \"*\", about 2500 \
                             Pa: are both in Pa?";
        assert_eq!(warnings_of(&force, 0.5, None), [expected]);
        // 5 kPa in MPa.
        let small = CASE.replace(PULLED, "traction = [2.5e-4, 0, 0]");
        let expected = " the loads strain the body by at most about 1.0e-7: are displacements in m, forces and moduli \
                             in Pa, and is the `scale` of [mesh] right?";
        assert_eq!(warnings_of(&small, 1.0, None), [expected]);
    }

    #[test]
    fn expressions_are_sampled_where_they_act() {
        // Infinite at the nodes at x = 0, but not at integration points.
        let force = format!("{CASE}[[body_force]]\nregion = \"*\"\nvalue = [0, 0, \"t/x\"]\n");
        assert_eq!(warnings_of(&force, 1.0, None), [""; 0]);
        // The reference point is the center, y = 0.25 m, of the surface; its nodes lie at y = 0 and y = 0.5 m.
        let rigid = CASE.replace(
            PULLED,
            "rigid = { displacement = { x = \"1e3*t*(y - 0.25)\" }, rotation = { z = \"1e3*t*(y - 0.25)\" } }",
        );
        assert_eq!(warnings_of(&rigid, 1.0, None), [""; 0]);
        let far = rigid.replace("rigid = {", "rigid = { reference = [1, 1, 0],");
        assert_eq!(warnings_of(&far, 1.0, None).len(), 2);
    }

    #[test]
    fn reference_points_far_from_the_body_are_found() {
        let at =
            |z: &str| CASE.replace(PULLED, &format!("rigid = {{ reference = [0, 0, {z}], rotation = {{ z = 0.1 }} }}"));
        assert_eq!(warnings_of(&at("-9.9"), 1.0, None), [""; 0]);
        let expected = "9: the reference point of surface \"x1\" is 100 m away from the body, whose longest edge is 1 m: is \
                        `reference` in mesh units?";
        assert_eq!(warnings_of(&at("-100"), 1.0, None), [expected]);
    }

    #[test]
    fn very_different_stiffnesses_of_fibers_and_matrix_are_found() {
        let apart = "3: region \"*\": the fibers give about 1.0e10 Pa and the matrix 2500 Pa, so the fibers are 4.0e6 times as \
                     stiff: are both moduli in Pa and the radius in m?";
        assert_eq!(warnings_of(CASE, 1.0, Some([5e9, 1e10])), [apart]);
        assert_eq!(warnings_of(CASE, 1.0, Some([1e-4, 1.0])).len(), 1);
    }

    #[test]
    fn linear_elements_in_nearly_incompressible_materials_are_found() {
        let nearly = CASE.replace("poisson_ratio = 0.25", "poisson_ratio = 0.499");
        let case = Case::parse(&nearly, Path::new("case.toml")).unwrap().case;
        let mesh = cuboid([1, 1, 1], [1.0; 3]).unwrap();
        let expected = "case.toml:3: region \"*\": its linear elements lock at a Poisson ratio of 0.499: set `f_bar = true` here, \
                        or `order = 2` in [mesh]";
        let formula = case.regions[0].material.formula().and_then(|formula| formula.constant()).unwrap().clone();
        let ratios = [greatest_poisson_ratio(&[Arc::new(formula)])];
        assert_eq!(check_locking(&case, &mesh, &ratios), [expected]);
        assert_eq!(check_locking(&case, &mesh.quadratic(Default::default()).unwrap(), &ratios), [""; 0]);
        assert_eq!(check_locking(&case, &mesh.clone().with_patches(|_| true), &ratios), [""; 0]);

        // Wedges have neither patches nor order 2.
        let wedges = cuboid_of(ElementType::Wedge6, [1, 1, 1], [1.0; 3]).unwrap().with_patches(|_| true);
        let expected = "case.toml:3: region \"*\": its wedges lock at a Poisson ratio of 0.499, and have no \
                        `f_bar`: mesh it with tetrahedra or hexahedra, and set `f_bar = true` here, or, if the mesh \
                        then has no wedges, `order = 2` in [mesh]";
        assert_eq!(check_locking(&case, &wedges, &ratios), [expected]);
        assert_eq!(check_locking(&case, &wedges, &[0.45]), [""; 0]);
        let plain =
            "case.toml:3: region \"*\": its linear elements lock at a Poisson ratio of 0.499: set `f_bar = true` here";
        let both = with_wedges_beside(&mesh, &wedges);
        assert_eq!(check_locking(&case, &both, &ratios), [plain, expected]);
        assert_eq!(check_locking(&case, &both.with_patches(|_| true), &ratios), [expected]);
    }

    /// Returns a mesh with the elements of both, which are apart.
    fn with_wedges_beside(mesh: &Mesh, wedges: &Mesh) -> Mesh {
        let first = mesh.nodes().len() as u32;
        let nodes = mesh.nodes().iter().copied().chain(wedges.nodes().iter().map(|[x, y, z]| [x + 2.0, *y, *z]));
        let mut elements = mesh.elements().clone();
        elements.extend(&wedges.elements().map(|node| node + first));
        let count = elements.len();
        Mesh::new(nodes.collect(), elements, vec![0; count], vec!["body".into()], Vec::new()).unwrap()
    }

    #[test]
    fn very_different_stiffnesses_of_regions_are_found() {
        let grip = "[[region]]\nname = \"grip\"\nmaterial = { model = \"neo-hookean\", shear_modulus = 1e12, poisson_ratio = 0.25 }\n";
        let text = CASE.replace("[[boundary]]\nsurface = \"x0\"", &format!("{grip}[[boundary]]\nsurface = \"x0\""));
        let case = Case::parse(&text, Path::new("case.toml")).unwrap().case;
        let stiffness = |region, modulus| Stiffness { region, formula: Some([modulus; 2]), fibers: None };
        let found: Vec<String> = check_stiffnesses(&case, &[stiffness(0, 2500.0), stiffness(1, 2.5e12)]).collect();
        let expected = "case.toml:6: region \"grip\": about 2.5e12 Pa, 1.0e9 times stiffer than the region \"*\" with 2500 Pa: are \
                        all moduli in Pa?";
        assert_eq!(found, [expected]);
        assert_eq!(check_stiffnesses(&case, &[stiffness(0, 1e3), stiffness(1, 1e8)]).count(), 0);
    }
}
