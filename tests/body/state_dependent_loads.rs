//! Loads that depend on the displacements, implemented outside the crate: an elastic foundation, whose stiffness is
//! symmetric, and a follower pressure, whose stiffness is not.
use std::sync::Arc;

use biotissue::backends::sparse::Sparse;
use biotissue::fem::boundary::{
    BoundaryError, Conditions, CoupledNodes, Load, LoadCondition, LoadCurve, Source, SurfaceCondition, Traction,
    find_surface,
};
use biotissue::fem::material::NeoHookean;
use biotissue::fem::mesh::{Faces, Mesh, Surface, shapes};
use biotissue::fem::point_field::FormulaField;
use biotissue::fem::reactions::SurfaceForce;
use biotissue::fem::stepping::{StepParams, Stepper};
use biotissue::las::Symmetry;
use nalgebra::{Matrix3, Vector3};

use crate::stiffness::assert_tangent_is_the_derivative;

const SOFT: NeoHookean = NeoHookean { mu: 3.0e3, lambda: 5.0e3 };

/// Springs on a surface: the force per reference area, Pa, is `-modulus * factor(t) * u` with a modulus in Pa/m.
#[derive(Clone, Debug)]
struct Foundation {
    surface: &'static str,
    modulus: f64,
    curve: LoadCurve,
}

/// A pressure, Pa, on the current area of a surface.
#[derive(Clone, Debug)]
struct Pressure {
    surface: &'static str,
    value: f64,
    curve: LoadCurve,
}

/// A load `L` on the facets of a surface.
#[derive(Debug)]
struct FacetsWithLoad<L> {
    load: L,
    surface: usize,
    facets: Vec<[u32; 3]>,
    faces: Faces,
    positions: Vec<[[f64; 3]; 3]>,
}

impl<L> FacetsWithLoad<L> {
    fn new(load: L, mesh: &Mesh, name: &str) -> Result<Box<Self>, BoundaryError> {
        let (surface, Surface { faces, .. }) = find_surface(mesh, name)?;
        let facets = faces.iter().filter_map(|nodes| nodes.try_into().ok()).collect::<Vec<[u32; 3]>>();
        let positions = facets.iter().map(|nodes| nodes.map(|node| mesh.nodes()[node as usize])).collect();
        Ok(Box::new(Self { load, surface, facets, faces: faces.clone(), positions }))
    }

    /// Returns the current positions of the nodes of a facet.
    fn corners(&self, facet: usize, displacements: &[[f64; 3]]) -> [Vector3<f64>; 3] {
        let u = self.facets[facet].map(|node| Vector3::from(displacements[node as usize]));
        std::array::from_fn(|a| Vector3::from(self.positions[facet][a]) + u[a])
    }
}

/// A load whose forces on the nodes of a facet depend only on the displacements of these nodes.
trait FacetLoad: std::fmt::Debug + Send + Sync + Sized {
    const SYMMETRY: Symmetry;

    /// Returns the forces `f_a` on the three nodes, N.
    fn forces(on: &FacetsWithLoad<Self>, t: f64, facet: usize, u: &[[f64; 3]]) -> [Vector3<f64>; 3];

    /// Returns the stiffness `blocks[a][b] = -df_a/du_b`, N/m.
    fn blocks(on: &FacetsWithLoad<Self>, t: f64, facet: usize, u: &[[f64; 3]]) -> [[Matrix3<f64>; 3]; 3];
}

impl<L: FacetLoad> Load for FacetsWithLoad<L> {
    fn add_forces(&self, t: f64, displacements: &[[f64; 3]], forces: &mut [[f64; 3]]) {
        for (facet, nodes) in self.facets.iter().enumerate() {
            for (&node, force) in nodes.iter().zip(L::forces(self, t, facet, displacements)) {
                (0..3).for_each(|i| forces[node as usize][i] += force[i]);
            }
        }
    }

    fn resultant(&self, t: f64, displacements: &[[f64; 3]]) -> [f64; 3] {
        let forces = (0..self.facets.len()).flat_map(|facet| L::forces(self, t, facet, displacements));
        forces.sum::<Vector3<f64>>().into()
    }

    fn source(&self) -> Option<Source> {
        Some(Source::Surface(self.surface))
    }

    fn coupled_nodes(&self) -> CoupledNodes<'_> {
        CoupledNodes::Faces(&self.faces)
    }

    fn symmetry(&self) -> Symmetry {
        L::SYMMETRY
    }

    fn add_stiffness(&self, t: f64, displacements: &[[f64; 3]], group: usize, block: &mut [f64]) {
        let blocks = L::blocks(self, t, group, displacements);
        for (n, entry) in block.iter_mut().enumerate() {
            let (row, column) = (n / 9, n % 9);
            *entry += blocks[row / 3][column / 3][(row % 3, column % 3)];
        }
    }
}

impl Foundation {
    /// Returns the entry of the consistent matrix of a linear triangle: `modulus * area / 12 (1 + d_ab)`, where `d_ab`
    /// is 1 for `a = b` and 0 otherwise.
    fn spring(on: &FacetsWithLoad<Self>, t: f64, facet: usize, a: usize, b: usize) -> f64 {
        let [x, y, z] = on.positions[facet].map(Vector3::from);
        let area = 0.5 * (y - x).cross(&(z - x)).norm();
        let modulus = on.load.modulus * on.load.curve.factor(t, [0.0; 3]);
        modulus * area / if a == b { 6.0 } else { 12.0 }
    }
}

impl FacetLoad for Foundation {
    const SYMMETRY: Symmetry = Symmetry::Definite;

    fn forces(on: &FacetsWithLoad<Self>, t: f64, facet: usize, u: &[[f64; 3]]) -> [Vector3<f64>; 3] {
        let u = on.facets[facet].map(|node| Vector3::from(u[node as usize]));
        std::array::from_fn(|a| -(0..3).map(|b| u[b] * Self::spring(on, t, facet, a, b)).sum::<Vector3<f64>>())
    }

    fn blocks(on: &FacetsWithLoad<Self>, t: f64, facet: usize, _: &[[f64; 3]]) -> [[Matrix3<f64>; 3]; 3] {
        let spring = |a, b| Matrix3::from_diagonal_element(Self::spring(on, t, facet, a, b));
        std::array::from_fn(|a| std::array::from_fn(|b| spring(a, b)))
    }
}

impl FacetLoad for Pressure {
    const SYMMETRY: Symmetry = Symmetry::None;

    /// Returns a third of `-p a` for every node, with the current area vector `a = (x1 - x0) x (x2 - x0) / 2`.
    fn forces(on: &FacetsWithLoad<Self>, t: f64, facet: usize, u: &[[f64; 3]]) -> [Vector3<f64>; 3] {
        let [x, y, z] = on.corners(facet, u);
        [(y - x).cross(&(z - x)) * (-on.load.value * on.load.curve.factor(t, [0.0; 3]) / 6.0); 3]
    }

    fn blocks(on: &FacetsWithLoad<Self>, t: f64, facet: usize, u: &[[f64; 3]]) -> [[Matrix3<f64>; 3]; 3] {
        let [x, y, z] = on.corners(facet, u);
        let factor = on.load.value * on.load.curve.factor(t, [0.0; 3]) / 6.0;
        let (by_y, by_z) = ((x - z).cross_matrix() * factor, (y - x).cross_matrix() * factor);
        [[-by_y - by_z, by_y, by_z]; 3]
    }
}

impl LoadCondition for Foundation {
    fn resolve(&self, mesh: &Mesh) -> Result<Box<dyn Load>, BoundaryError> {
        Ok(FacetsWithLoad::new(self.clone(), mesh, self.surface)?)
    }
}

impl LoadCondition for Pressure {
    fn resolve(&self, mesh: &Mesh) -> Result<Box<dyn Load>, BoundaryError> {
        Ok(FacetsWithLoad::new(self.clone(), mesh, self.surface)?)
    }
}

fn beam() -> Mesh {
    shapes::cuboid([4, 2, 2], [1.0, 0.4, 0.4]).unwrap()
}

fn foundation() -> Foundation {
    // Half of the spring stiffness acts from the beginning.
    let curve = LoadCurve::table(&[[0.0, 0.5], [1.0, 1.0]]).unwrap();
    Foundation { surface: "z0", modulus: 4.0e3, curve }
}

/// Returns conditions that clamp the body at `x = 0` and apply these loads.
fn loaded(loads: Vec<Arc<dyn LoadCondition>>) -> Conditions {
    let clamp = SurfaceCondition { surface: "x0".into(), displacement: [Some(0.0); 3], curve: LoadCurve::Ramp };
    Conditions { surfaces: vec![clamp], loads, ..Conditions::default() }
}

fn on_springs() -> Conditions {
    let pull = Traction { surface: "x1".into(), value: [0.0, 60.0, -300.0], curve: LoadCurve::Ramp };
    loaded(vec![Arc::new(pull), Arc::new(foundation())])
}

fn under_pressure() -> Conditions {
    loaded(vec![Arc::new(Pressure { surface: "z1", value: 120.0, curve: LoadCurve::Ramp })])
}

/// Runs two load steps and checks that Newton converges quadratically in each.
fn run(conditions: &Conditions) -> Stepper<Sparse, FormulaField> {
    let mesh = Arc::new(beam());
    let mut params = StepParams { count: 2, max_cuts: 0, ..StepParams::default() };
    params.newton.tolerance = 1e-12;
    let field = FormulaField::uniform(SOFT, &mesh);
    let mut stepper = Stepper::<Sparse, _>::new(&(), mesh, conditions, field, params).unwrap();
    for report in stepper.run(&mut ()).unwrap() {
        let r = &report.solves[0].relative;
        assert!(r.len() >= 3, "{r:?}");
        for pair in r.windows(2).filter(|pair| pair[0] < 1e-3 && pair[1] > 1e-12) {
            assert!(pair[1] < 100.0 * pair[0] * pair[0], "{r:?}");
        }
    }
    stepper
}

#[test]
fn newton_converges_quadratically_with_state_dependent_loads() {
    let stepper = run(&on_springs());
    let moved = stepper.state().displacements.iter().fold(0.0_f64, |most, u| most.max(u[2].abs()));
    assert!(moved > 0.05, "{moved}");
    let forces = stepper.forces();
    let named = |name: &str| -> &SurfaceForce { forces.surfaces.iter().find(|s| s.name == name).unwrap() };
    let size = named("x1").force[2].abs();
    assert!(forces.sum().iter().all(|f| f.abs() < 1e-9 * size), "{:?}", forces.sum());
    let springs = named("z0");
    assert!(springs.force[2] > 0.1 * size, "{springs:?}");
    for (force, u) in springs.force.iter().zip(springs.displacement) {
        assert!(
            (force + 4.0e3 * 0.4 * u).abs() < 1e-9 * size,
            "the force is not the mean displacement times the stiffness: {springs:?}"
        );
    }

    let stepper = run(&under_pressure());
    let forces = stepper.forces();
    let pressed = forces.surfaces.iter().find(|s| s.name == "z1").unwrap();
    // The beam bends, so that the resultant rotates with its upper side.
    assert!(pressed.force[2] < -30.0 && pressed.force[0].abs() > 1.0, "{pressed:?}");
    assert!(forces.sum().iter().all(|f| f.abs() < 1e-9 * pressed.force[2].abs()), "{:?}", forces.sum());
}

#[test]
fn the_stiffness_is_the_derivative_of_the_residual() {
    for conditions in [on_springs(), under_pressure()] {
        assert_tangent_is_the_derivative(beam(), SOFT, &conditions, 1e-5);
    }
}
