//! Results have the same bits for any number of threads.

use nalgebra::Matrix3;

use super::*;
use crate::fem::kinematics::{Kinematics, RigidSurface};
use crate::fem::mesh::Elements;
use crate::las::conformance::Random;
use crate::parallel::tests::on_pools;

/// All that the assembler computes of a body at one state.
#[derive(PartialEq)]
struct Results {
    gradients: Vec<Matrix3<f64>>,
    responses: PointResponses,
    forces: Vec<[f64; 3]>,
    linearized: Vec<[f64; 3]>,
    volume: (f64, Vec<[f64; 3]>),
    pressure_forces: Vec<[f64; 3]>,
    stiffness: Vec<f64>,
    norms: [f64; 2],
}

/// Evaluates a body of several chunks of elements; `prescribed` says which components are.
fn evaluate(mesh: &Mesh, kinematics: &Arc<Kinematics>, prescribed: impl Fn([f64; 3], usize) -> bool) -> [Results; 3] {
    let is_prescribed = |node: usize, component: usize| {
        kinematics.rigid_surface_of(node as u32).is_some() || prescribed(mesh.nodes()[node], component)
    };
    let surfaces = vec![[false; 6]; kinematics.rigid_surfaces().len()];
    let unknowns = Unknowns::new(mesh.nodes().len(), is_prescribed).unwrap();
    let unknowns = unknowns.with_kinematics(kinematics, &surfaces).unwrap();
    let pattern = Arc::new(unknowns.pattern(mesh).unwrap());
    let mut random = Random::new(5);
    let mut nodal = || -> Vec<[f64; 3]> { mesh.nodes().iter().map(|_| [(); 3].map(|()| random.signed())).collect() };
    let (noise, increments) = (nodal(), nodal());
    let moved = mesh.nodes().iter().zip(noise);
    let displacements: Vec<[f64; 3]> = moved
        .map(|(&[x, y, z], noise)| {
            let smooth = [0.1 * x + 0.2 * y * z, -0.15 * x * x, 0.2 * x * y];
            std::array::from_fn(|i| smooth[i] + 1e-3 * noise[i])
        })
        .collect();
    let motions = vec![RigidMotion::default(); surfaces.len()];
    let pressures: Vec<f64> = (0..mesh.points().len()).map(|point| if point % 3 == 0 { 0.0 } else { 0.7 }).collect();
    let inside: Vec<bool> = pressures.iter().map(|&pressure| pressure != 0.0).collect();
    on_pools(|| {
        let mut field = FormulaField::uniform(NeoHookean { mu: 3.0, lambda: 5.0 }, mesh);
        let mut matrix = Sparse::matrix(&(), &pattern).unwrap();
        let assembler = Assembler::<Sparse>::new(geometry(mesh).unwrap(), &unknowns, &matrix).unwrap();
        let zeros = || vec![[0.0; 3]; displacements.len()];
        let (mut gradients, mut responses) = (Vec::new(), PointResponses::default());
        assembler.deformation_gradients(&displacements, &mut gradients);
        field.update(&gradients, &mut responses).unwrap();
        let [mut forces, mut linearized, mut volume_gradient, mut pressure_forces] = [(); 4].map(|()| zeros());
        assembler.internal_forces(&displacements, &responses.pk1, &mut forces);
        assembler.linearized_forces(&displacements, &responses, &increments, &mut linearized);
        let volume = assembler.geometry().add_volume_gradient((&inside, None), &displacements, &mut volume_gradient);
        let geometry = assembler.geometry();
        geometry.add_linearized_pressure_forces(&pressures, &displacements, &increments, &mut pressure_forces);
        assembler.stiffness(&displacements, &motions, &responses, &mut matrix).unwrap();
        assembler.pressure_stiffness(&pressures, &displacements, &motions, &mut matrix).unwrap();
        let norms =
            [assembler.rounding_error(&responses.tangent), assembler.free_squares(&mut forces.clone(), &motions)];
        Results {
            gradients,
            responses,
            forces,
            linearized,
            volume: (volume, volume_gradient),
            pressure_forces,
            stiffness: matrix.values().to_vec(),
            norms,
        }
    })
}

fn results_are_equal(what: &str, [one, two, five]: &[Results; 3]) {
    for (threads, many) in [(2, two), (5, five)] {
        assert!(one.gradients == many.gradients && one.responses == many.responses, "{what}: points, {threads}");
        assert!(one.forces == many.forces && one.linearized == many.linearized, "{what}: forces, {threads}");
        assert!(one.volume == many.volume && one.pressure_forces == many.pressure_forces, "{what}: volume, {threads}");
        assert!(one.stiffness == many.stiffness, "{what}: stiffness, {threads} threads");
        assert!(one.norms == many.norms, "{what}: norms, {threads} threads");
    }
}

fn on_rollers(x: [f64; 3], component: usize) -> bool {
    x[component] == 0.0
}

#[test]
fn bodies_of_all_linear_elements_have_the_same_bits() {
    use ElementType::{Hex8, Tet4, Tet10, Wedge6};
    for (element_type, cells) in [(Tet4, [9, 8, 8]), (Hex8, [13, 13, 13]), (Wedge6, [11, 10, 10]), (Tet10, [6, 8, 8])] {
        let mesh = shapes::cuboid_of(element_type, cells, [1.0, 0.9, 0.8]).unwrap();
        assert!(mesh.elements().len() > 2048, "several chunks");
        results_are_equal(&format!("{element_type:?}"), &evaluate(&mesh, &Arc::default(), on_rollers));
    }
}

#[test]
fn bodies_numbered_at_random_have_the_same_bits() {
    let mesh = shapes::cuboid([9, 8, 8], [1.0, 0.9, 0.8]).unwrap();
    let mut to: Vec<u32> = (0..mesh.nodes().len() as u32).collect();
    let mut random = Random::new(1);
    (1..to.len()).for_each(|k| to.swap(k, random.below(k + 1)));
    let mut nodes = mesh.nodes().to_vec();
    mesh.nodes().iter().zip(&to).for_each(|(&x, &node)| nodes[node as usize] = x);
    let elements: Vec<[u32; 4]> =
        mesh.elements().iter().map(|nodes| std::array::from_fn(|a| to[nodes[a] as usize])).collect();
    let region_of = vec![0; elements.len()];
    let shuffled = Mesh::new(nodes, Elements::from(elements), region_of, vec!["all".to_owned()], vec![]).unwrap();
    results_are_equal("shuffled", &evaluate(&shuffled, &Arc::default(), |x, _| x[0] == 0.0));
}

#[test]
fn frames_rigid_surfaces_and_patches_have_the_same_bits() {
    let mesh = shapes::cuboid([9, 8, 8], [1.0, 0.9, 0.8]).unwrap();
    let of_nodes = |is_wanted: &dyn Fn(&[f64; 3]) -> bool| -> Vec<u32> {
        (0..).zip(mesh.nodes()).filter(|(_, x)| is_wanted(x)).map(|(node, _)| node).collect()
    };
    let turned = nalgebra::Rotation3::from_euler_angles(0.3, -0.2, 0.4).into_inner();
    let frames = of_nodes(&|x| x[0] == 1.0 && x[2] > 0.0).into_iter().map(|node| (node, turned)).collect();
    let rigid = RigidSurface::new(0, [0.5, 0.4, 0.0], of_nodes(&|x| x[2] == 0.0), mesh.nodes());
    let kinematics = Arc::new(Kinematics::new(mesh.nodes().len(), frames, vec![rigid]));
    results_are_equal("frames", &evaluate(&mesh, &kinematics, |x, component| x[0] == 1.0 && component == 0));

    for (element_type, cells) in [(ElementType::Tet4, [8, 8, 8]), (ElementType::Hex8, [13, 13, 13])] {
        let mesh = shapes::cuboid_of(element_type, cells, [1.0, 0.9, 0.8]).unwrap().with_patches(|_| true);
        assert!(mesh.patches().len() > 64, "several chunks");
        results_are_equal("patches", &evaluate(&mesh, &Arc::default(), on_rollers));
    }
}
