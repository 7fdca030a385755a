mod threads;

use std::sync::Arc;

use super::*;
use crate::backends::sparse::Sparse;
use crate::fem::element::ElementType;
use crate::fem::material::NeoHookean;
use crate::fem::mesh::Mesh;
use crate::fem::mesh::shapes;
use crate::fem::point_field::{FormulaField, PointField, PointResponses};

/// A box, fixed at `x = 0`, bent and stretched.
struct Bent {
    mesh: Mesh,
    unknowns: Unknowns,
    matrix: <Sparse as Backend>::Matrix,
    assembler: Assembler<Sparse>,
    field: FormulaField,
    displacements: Vec<[f64; 3]>,
}

impl Bent {
    fn new() -> Self {
        Self::of(shapes::cuboid([2, 2, 2], [1.0, 0.7, 0.5]).unwrap())
    }

    fn of(mesh: Mesh) -> Self {
        let unknowns = Unknowns::new(mesh.nodes().len(), |node, _| mesh.nodes()[node][0] == 0.0).unwrap();
        let matrix = Sparse::matrix(&(), &Arc::new(unknowns.pattern(&mesh).unwrap())).unwrap();
        let assembler = Assembler::new(geometry(&mesh).unwrap(), &unknowns, &matrix).unwrap();
        let field = FormulaField::uniform(NeoHookean { mu: 3.0, lambda: 5.0 }, &mesh);
        let displacements = mesh.nodes().iter().map(|&[x, y, z]| [0.1 * x + 0.2 * y * z, -0.15 * x * x, 0.2 * x * y]);
        Self { displacements: displacements.collect(), unknowns, matrix, assembler, field, mesh }
    }

    fn evaluate(&mut self, displacements: &[[f64; 3]]) -> PointResponses {
        let (mut gradients, mut responses) = (Vec::new(), PointResponses::default());
        self.assembler.deformation_gradients(displacements, &mut gradients);
        self.field.update(&gradients, &mut responses).unwrap();
        responses
    }

    fn forces(&mut self, displacements: &[[f64; 3]]) -> Vec<[f64; 3]> {
        let responses = self.evaluate(displacements);
        let mut forces = vec![[7.0; 3]; displacements.len()];
        self.assembler.internal_forces(displacements, &responses.pk1, &mut forces);
        forces
    }
}

#[test]
fn the_stiffness_is_the_slope_of_the_forces() {
    for mut bent in [Bent::new(), with_patches(ElementType::Tet4), with_patches(ElementType::Hex8)] {
        the_stiffness_is_the_slope_of_its_forces(&mut bent);
    }
}

/// Tetrahedra or hexahedra in patches, beside elements without.
fn with_patches(element_type: ElementType) -> Bent {
    let mesh = shapes::cuboid_of(element_type, [2, 2, 2], [1.0, 0.7, 0.5]).unwrap();
    let region_of = (0..mesh.elements().len()).map(|element| u32::from(mesh.center(element)[0] > 0.5)).collect();
    let regions = vec!["left".to_owned(), "right".to_owned()];
    let mesh = Mesh::new(mesh.nodes().to_vec(), mesh.elements().clone(), region_of, regions, vec![]).unwrap();
    let mesh = mesh.with_patches(|region| region == 1);
    assert_eq!(mesh.patches().len(), 4);
    Bent::of(mesh)
}

fn the_stiffness_is_the_slope_of_its_forces(bent: &mut Bent) {
    let at = bent.displacements.clone();
    let responses = bent.evaluate(&at);
    bent.assembler.stiffness(&at, &[], &responses, &mut bent.matrix).unwrap();
    let rows = bent.assembler.equation_numbers().to_vec();
    let h = 1e-6;
    for (k, &column) in rows.iter().enumerate().filter(|(_, row)| **row >= 0) {
        let mut moved = [bent.displacements.clone(), bent.displacements.clone()];
        moved[0].as_flattened_mut()[k] += h;
        moved[1].as_flattened_mut()[k] -= h;
        let [up, down] = moved.map(|u| bent.forces(&u));
        let mut stiffness = vec![0.0; rows.len()];
        bent.matrix.get(&rows, &[column], &mut stiffness).unwrap();
        for ((&row, entry), (up, down)) in
            rows.iter().zip(stiffness).zip(up.as_flattened().iter().zip(down.as_flattened()))
        {
            let slope = (up - down) / (2.0 * h);
            assert!(row < 0 || (slope - entry).abs() < 1e-8, "({row}, {column}): {entry}, slope {slope}");
        }
    }
}

#[test]
fn the_linearized_forces_are_the_slope_along_an_increment() {
    for mut bent in [Bent::new(), with_patches(ElementType::Tet4), with_patches(ElementType::Hex8)] {
        the_linearized_forces_are_their_slope(&mut bent);
    }
}

fn the_linearized_forces_are_their_slope(bent: &mut Bent) {
    let at = bent.displacements.clone();
    let responses = bent.evaluate(&at);
    // Only the fixed face moves.
    let held = |a: usize| bent.unknowns.equation_numbers()[3 * a] < 0;
    let increments: Vec<[f64; 3]> =
        (0..at.len()).map(|a| if held(a) { [0.3, -0.2, 0.1 * a as f64] } else { [0.0; 3] }).collect();
    let mut linear = vec![[7.0; 3]; at.len()];
    bent.assembler.linearized_forces(&at, &responses, &increments, &mut linear);
    let h = 1e-6;
    let moved = |by: f64| -> Vec<[f64; 3]> {
        at.iter().zip(&increments).map(|(u, d)| std::array::from_fn(|i| u[i] + by * d[i])).collect()
    };
    let (up, down) = (bent.forces(&moved(h)), bent.forces(&moved(-h)));
    for ((linear, up), down) in linear.as_flattened().iter().zip(up.as_flattened()).zip(down.as_flattened()) {
        assert!((linear - (up - down) / (2.0 * h)).abs() < 1e-8, "{linear}");
    }
}

#[test]
fn internal_forces_balance_and_ignore_translations() {
    let mut bent = Bent::new();
    let forces = bent.forces(&bent.displacements.clone());
    let (mut sum, mut moment) = (nalgebra::Vector3::zeros(), nalgebra::Vector3::zeros());
    for ((x, u), f) in bent.mesh.nodes().iter().zip(&bent.displacements).zip(&forces) {
        let (x, u, f) = (nalgebra::Vector3::from(*x), nalgebra::Vector3::from(*u), nalgebra::Vector3::from(*f));
        sum += f;
        moment += (x + u).cross(&f);
    }
    assert!(sum.norm() < 1e-14, "{sum}");
    assert!(moment.norm() < 1e-14, "{moment}");

    let shifted: Vec<[f64; 3]> = bent.displacements.iter().map(|u| [u[0] + 8.0, u[1] - 4.0, u[2] + 2.0]).collect();
    for (here, there) in forces.as_flattened().iter().zip(bent.forces(&shifted).as_flattened()) {
        assert!((here - there).abs() < 1e-13, "{here} {there}");
    }
}

#[test]
fn rounding_errors_stay_below_the_floor() {
    // The forces of a small rigid rotation are zero in exact arithmetic.
    let mut bent = Bent::new();
    let at_rest = vec![[0.0; 3]; bent.displacements.len()];
    let floor = {
        let tangent = bent.evaluate(&at_rest).tangent;
        bent.assembler.rounding_error(&tangent)
    };
    let turned = nalgebra::Rotation3::from_euler_angles(0.3, -0.2, 0.4).into_inner() - Matrix3::identity();
    let turned: Vec<[f64; 3]> =
        bent.mesh.nodes().iter().map(|&x| (turned * nalgebra::Vector3::from(x)).into()).collect();
    let forces = bent.forces(&turned);
    let left = forces.as_flattened().iter().map(|f| f * f).sum::<f64>().sqrt();
    assert!(left > 0.0 && left < floor, "{left:e} of {floor:e}");
    assert!(floor < 1e3 * left, "{left:e} of {floor:e}: no more than rounding");
}

#[test]
fn the_forces_of_patches_balance_and_their_points_share_a_dilatation() {
    for element_type in [ElementType::Tet4, ElementType::Hex8] {
        let mut bent = with_patches(element_type);
        let displacements = bent.displacements.clone();
        let mut gradients = Vec::new();
        bent.assembler.deformation_gradients(&displacements, &mut gradients);
        for patch in bent.mesh.patches() {
            let points = patch.iter().flat_map(|&element| bent.mesh.points().of_element(element as usize));
            let dilatations: Vec<f64> = points.map(|point| gradients[point].determinant()).collect();
            assert!(dilatations.iter().all(|j| (j - dilatations[0]).abs() < 1e-14), "{dilatations:?}");
        }
        let forces = bent.forces(&displacements);
        let (mut sum, mut moment) = (nalgebra::Vector3::zeros(), nalgebra::Vector3::zeros());
        for ((x, u), f) in bent.mesh.nodes().iter().zip(&displacements).zip(&forces) {
            let (x, u, f) = (nalgebra::Vector3::from(*x), nalgebra::Vector3::from(*u), nalgebra::Vector3::from(*f));
            sum += f;
            moment += (x + u).cross(&f);
        }
        assert!(sum.norm() < 1e-13 && moment.norm() < 1e-13, "{sum} {moment}");
    }
}
