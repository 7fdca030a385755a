//! Inflation of a thick sphere and of a thick cylinder in plane strain, whose outer radius is twice the inner one, of
//! nearly incompressible neo-Hookean material.
//!
//! An incompressible wall has a closed solution. With the stretches `a` and `b` of the inner and the outer surface,
//! where `b^3 = 1 + (a^3 - 1) / 8` in the sphere and `b^2 = 1 + (a^2 - 1) / 4` in the cylinder, the pressures are
//! `p / mu = 2 / b + 1 / (2 b^4) - 2 / a - 1 / (2 a^4)` and `p / mu = ln(a / b) + (1 / b^2 - 1 / a^2) / 2`
//! ([`PUBLISHED`]; R. W. Ogden, *Non-Linear Elastic Deformations* (1984), chapter 5).
//!
//! The compressible material approaches this limit as `lambda / mu = 2 nu / (1 - 2 nu)` grows; the difference is
//! proportional to `mu / lambda`. Two comparisons replace one with two errors:
//! - [`radial_pressure`] integrates the radial equilibrium for any `lambda`. Extrapolated from `lambda / mu = 1000` and
//!   2000 (`nu = 0.4995` and 0.49975) to infinity by `2 p(2000) - p(1000)`, it gives the published pressures.
//! - Finite elements are compared with the radial equilibrium for the same `lambda / mu = 1000`. The pressures of two
//!   meshes of linear hexahedra with F-bar are extrapolated to an element size of 0 by `(4 p(h) - p(2 h)) / 3`, and
//!   those of `lambda / mu = 1000` and 2000 to the incompressible limit as above.
//!
//! The pressure of the sphere has a maximum below an inner stretch of 2, where an increasing pressure has no
//! equilibrium. The displacement of the inner surface is therefore prescribed; the pressure is the work of its
//! reactions on an increment of the stretch over the increment of the enclosed volume.

use std::sync::Arc;

use biotissue::backends::sparse::Sparse;
use biotissue::fem::boundary::{Conditions, LoadCurve, PointCondition, PointLocation, Pressure};
use biotissue::fem::element::{ElementType, FaceType};
use biotissue::fem::material::NeoHookean;
use biotissue::fem::mesh::{Elements, Faces, Mesh, QuadraticHexahedron, Surface, shapes};
use biotissue::fem::point_field::FormulaField;
use biotissue::fem::reactions::PointForce;
use biotissue::fem::stepping::{StepParams, Stepper};

use crate::meshes::moved;

#[derive(Clone, Copy, Debug, PartialEq)]
enum Wall {
    Sphere,
    Cylinder,
}

/// The stretch of the inner surface, and `p / mu` of the incompressible sphere and cylinder.
const PUBLISHED: [(f64, f64, f64); 3] =
    [(1.1, 0.287_154_85, 0.131_562_28), (1.5, 0.755_433_12, 0.428_228_41), (2.0, 0.806_926_60, 0.574_053_57)];

/// The name of the inner surface: the lowest side of the box that becomes the cylinder.
const INNER: &str = "x0";

impl Wall {
    /// Number of equal stretches along the wall.
    fn circumferential(self) -> i32 {
        if self == Self::Sphere { 2 } else { 1 }
    }

    fn published(self) -> [(f64, f64); 3] {
        PUBLISHED.map(|(stretch, sphere, cylinder)| (stretch, if self == Self::Sphere { sphere } else { cylinder }))
    }
}

/// Radial and circumferential stress `P / mu` for `l = lambda / mu`.
fn stresses(n: i32, l: f64, radial: f64, around: f64) -> [f64; 2] {
    let log = radial.ln() + f64::from(n) * around.ln();
    [radial, around].map(|stretch| stretch + (l * log - 1.0) / stretch)
}

/// Returns the radial stretch at which the radial stress is `stress`.
fn radial_stretch(n: i32, l: f64, stress: f64, around: f64) -> f64 {
    let mut radial = around.powi(-n);
    for _ in 0..20 {
        let log = radial.ln() + f64::from(n) * around.ln();
        let slope = 1.0 + (l - l * log + 1.0) / (radial * radial);
        radial -= (stresses(n, l, radial, around)[0] - stress) / slope;
    }
    radial
}

/// Returns `p / mu` of a wall between the radii 1 and 2: integrates `dr/dR = lambda_r` and `dP_r/dR = n (P_theta - P_r)
/// / R` by the rule of Runge and Kutta from the inner surface, with the radial stress there that makes the outer
/// surface free.
fn radial_pressure(wall: Wall, l: f64, stretch: f64) -> f64 {
    const STEPS: usize = 400;
    let n = wall.circumferential();
    let slope = |at: f64, [r, stress]: [f64; 2]| {
        let radial = radial_stretch(n, l, stress, r / at);
        [radial, f64::from(n) * (stresses(n, l, radial, r / at)[1] - stress) / at]
    };
    let outer_stress = |inner_stress: f64| {
        let (mut y, h) = ([stretch, inner_stress], 1.0 / STEPS as f64);
        for step in 0..STEPS {
            let at = 1.0 + h * step as f64;
            let to = |k: [f64; 2], h: f64| [y[0] + h * k[0], y[1] + h * k[1]];
            let a = slope(at, y);
            let b = slope(at + 0.5 * h, to(a, 0.5 * h));
            let c = slope(at + 0.5 * h, to(b, 0.5 * h));
            let d = slope(at + h, to(c, h));
            y = [0, 1].map(|i| y[i] + h / 6.0 * (a[i] + 2.0 * (b[i] + c[i]) + d[i]));
        }
        y[1]
    };
    let area = stretch.powi(n);
    let mut pair = [-0.3 * area, -0.4 * area];
    let mut values = pair.map(outer_stress);
    for _ in 0..20 {
        let next = pair[1] - values[1] * (pair[1] - pair[0]) / (values[1] - values[0]);
        if !next.is_finite() {
            break;
        }
        (pair, values) = ([pair[1], next], [values[1], outer_stress(next)]);
    }
    -pair[1] / area
}

fn extrapolated(pressure: impl Fn(f64) -> f64) -> f64 {
    2.0 * pressure(2000.0) - pressure(1000.0)
}

#[test]
fn the_radial_equilibrium_has_the_published_limit() {
    for wall in [Wall::Sphere, Wall::Cylinder] {
        for (stretch, published) in wall.published() {
            let found = extrapolated(|l| radial_pressure(wall, l, stretch));
            println!("{wall:?}, {stretch}: radial equilibrium in the limit {found:.7} ({published})");
            assert!((found - published).abs() < 2e-6, "{wall:?}, stretch {stretch}: {found}, published {published}");
        }
    }
}

/// An octant of the sphere or a quarter of the cylinder, of hexahedra: `around` along each edge of the three
/// quadrilaterals of the octant, or along the quarter, and `through` the wall.
fn mesh(wall: Wall, element_type: ElementType, around: usize, through: usize) -> Mesh {
    match wall {
        Wall::Sphere => octant(element_type, around, through),
        Wall::Cylinder => {
            let flat = shapes::cuboid_of(element_type, [through, around, 1], [1.0, 1.0, 0.25]).unwrap();
            moved(&flat, |&[s, t, z]| {
                let (sin, cos) = (0.5 * std::f64::consts::PI * t).sin_cos();
                [(1.0 + s) * cos, (1.0 + s) * sin, z].map(|x| if x.abs() < 1e-12 { 0.0 } else { x })
            })
        }
    }
}

/// The octant is the image of a cube without its inner half: nodes keep their distance from the center in the maximum
/// norm.
fn octant(element_type: ElementType, around: usize, through: usize) -> Mesh {
    let n = around + 1;
    let on_surface: Vec<[usize; 3]> =
        (0..n * n * n).map(|k| [k % n, k / n % n, k / (n * n)]).filter(|place| place.contains(&around)).collect();
    let node = |place: [usize; 3], layer: usize| {
        let number = on_surface.iter().position(|other| *other == place).unwrap();
        (layer * on_surface.len() + number) as u32
    };
    let nodes = (0..=through).flat_map(|layer| {
        let radius = 1.0 + layer as f64 / through as f64;
        on_surface.iter().map(move |place| place.map(|i| radius * i as f64 / around as f64))
    });
    let (mut elements, mut inner) = (Elements::default(), Faces::default());
    for axis in 0..3 {
        for cell in 0..around * around {
            let corners = [[0, 0], [1, 0], [1, 1], [0, 1]].map(|[u, v]| {
                let mut place = [around; 3];
                (place[(axis + 1) % 3], place[(axis + 2) % 3]) = (cell % around + u, cell / around + v);
                place
            });
            inner.push(FaceType::Quad4, &[0, 3, 2, 1].map(|k: usize| node(corners[k], 0)));
            for layer in 0..through {
                let below = corners.map(|place| node(place, layer));
                let above = corners.map(|place| node(place, layer + 1));
                elements.push(ElementType::Hex8, &[below, above].concat());
            }
        }
    }
    let count = elements.len();
    let surface = Surface { name: INNER.into(), faces: inner };
    let cube = Mesh::new(nodes.collect(), elements, vec![0; count], vec!["wall".into()], vec![surface]).unwrap();
    let cube = match element_type {
        ElementType::Hex8 => cube,
        ElementType::Hex20 => cube.quadratic(QuadraticHexahedron::Serendipity).unwrap(),
        _ => cube.quadratic(QuadraticHexahedron::Triquadratic).unwrap(),
    };
    moved(&cube, |x| {
        let radius = x.iter().copied().fold(0.0, f64::max);
        let direction = x.map(|x| (0.25 * std::f64::consts::PI * x / radius).tan());
        let norm = direction.iter().map(|x| x * x).sum::<f64>().sqrt();
        direction.map(|x| radius * x / norm)
    })
}

/// The factors `stretch - 1` of five steps, which contain the published stretches.
const STEPS: [f64; 5] = [0.1, 0.3, 0.5, 0.75, 1.0];

fn curve() -> LoadCurve {
    let points: Vec<[f64; 2]> = (0..=5).map(|k| [k as f64 / 5.0, if k == 0 { 0.0 } else { STEPS[k - 1] }]).collect();
    LoadCurve::table(&points).unwrap()
}

/// Returns the point conditions: symmetry planes, and an inner surface that moves by its radius times a factor.
fn held(wall: Wall, mesh: &Mesh, moves_inner: bool) -> Vec<PointCondition> {
    let at_inner = mesh.surface(INNER).unwrap().nodes();
    let top = mesh.bounding_box()[1][2];
    let condition = |(node, x): (usize, &[f64; 3])| {
        let is_moved = moves_inner && at_inner.binary_search(&(node as u32)).is_ok();
        let displacement = std::array::from_fn(|i| {
            let is_axial = wall == Wall::Cylinder && i == 2;
            let is_plane = x[i] == 0.0 || (is_axial && x[2] == top);
            if is_moved && !is_axial { Some(x[i]) } else { is_plane.then_some(0.0) }
        });
        PointCondition { place: PointLocation::Node(node), displacement, curve: curve() }
    };
    let all = mesh.nodes().iter().enumerate().map(condition);
    all.filter(|point| point.displacement.iter().any(Option::is_some)).collect()
}

fn stepper(mesh: &Mesh, l: f64, conditions: &Conditions, count: usize) -> Stepper<Sparse, FormulaField> {
    let field = FormulaField::uniform(NeoHookean { mu: 1.0, lambda: l }, mesh);
    let params = StepParams { count, ..StepParams::default() };
    Stepper::<Sparse, _>::new(&(), Arc::new(mesh.clone()), conditions, field, params).unwrap()
}

/// Returns `p / mu` at the published stretches, from the reactions of the inner surface.
fn pressures(wall: Wall, mesh: &Mesh, l: f64) -> [f64; 3] {
    let conditions = Conditions { points: held(wall, mesh, true), ..Conditions::default() };
    let mut stepper = stepper(mesh, l, &conditions, STEPS.len());
    let (at_inner, dimensions) = (mesh.surface(INNER).unwrap().nodes(), wall.circumferential() + 1);
    let of_steps = STEPS.map(|factor| {
        stepper.step(&mut ()).unwrap();
        // The work of the reactions on a unit increment of the stretch; the supports in the symmetry planes do none.
        let work = |point: &PointForce| -> f64 {
            let x = mesh.nodes()[point.node as usize];
            (0..dimensions as usize).map(|i| point.force[i] * x[i]).sum()
        };
        let forces = stepper.forces();
        let inner = forces.points.iter().filter(|point| at_inner.binary_search(&point.node).is_ok());
        // The enclosed volume is proportional to the power `dimensions` of the stretch.
        let growth = f64::from(dimensions) * (1.0 + factor).powi(dimensions - 1) * enclosed(dimensions, mesh);
        inner.map(work).sum::<f64>() / growth
    });
    [of_steps[0], of_steps[2], of_steps[4]]
}

/// Returns the volume between the inner surface and the center or the axis.
fn enclosed(dimensions: i32, mesh: &Mesh) -> f64 {
    let mut volume = 0.0;
    for (face_type, nodes) in mesh.surface(INNER).unwrap().faces.typed() {
        let positions = mesh.positions_of(nodes);
        face_type.integrate(&positions, |values, area| {
            let at = |i: usize| values.iter().zip(&positions).map(|(value, x)| value * x[i]).sum::<f64>();
            volume -= (0..dimensions as usize).map(|i| at(i) * area[i]).sum::<f64>() / f64::from(dimensions);
        });
    }
    volume
}

/// Returns the pressures of linear hexahedra with F-bar on the finer of two meshes, whose error is of the order of
/// `h^2`, and their extrapolation to `h = 0`.
fn with_f_bar(wall: Wall, l: f64) -> [[f64; 3]; 2] {
    let sizes = if wall == Wall::Sphere { [[2, 3], [4, 6]] } else { [[4, 4], [8, 8]] };
    let [coarse, fine] = sizes.map(|[around, through]| {
        let mesh = mesh(wall, ElementType::Hex8, around, through).with_patches(|_| true);
        pressures(wall, &mesh, l)
    });
    [fine, std::array::from_fn(|k| (4.0 * fine[k] - coarse[k]) / 3.0)]
}

#[test]
fn linear_hexahedra_with_f_bar_approach_the_published_pressures() {
    for wall in [Wall::Sphere, Wall::Cylinder] {
        let [fine, found] = with_f_bar(wall, 1000.0);
        for (k, (stretch, published)) in wall.published().into_iter().enumerate() {
            let radial = radial_pressure(wall, 1000.0, stretch);
            println!(
                "{wall:?}, {stretch}: {published}, radial {radial:.6}, found {:.6}, finer {:.6}",
                found[k], fine[k]
            );
            let errors = [fine[k] / radial, found[k] / radial, found[k] / published].map(|ratio| (ratio - 1.0).abs());
            let bounds = [0.015, 3e-4, 5e-4];
            assert!(errors.iter().zip(bounds).all(|(error, bound)| *error < bound), "{wall:?}, {stretch}: {errors:?}");
        }
    }
    let [some, others] = [1000.0, 2000.0].map(|l| with_f_bar(Wall::Cylinder, l)[1]);
    for (k, (stretch, published)) in Wall::Cylinder.published().into_iter().enumerate() {
        let limit = 2.0 * others[k] - some[k];
        println!("Cylinder, {stretch}: incompressible limit {limit:.6} ({published})");
        assert!((limit / published - 1.0).abs() < 3e-4, "stretch {stretch}: {limit}, published {published}");
    }
}

/// Quadratic hexahedra lock at small strains on coarse meshes, but their error decreases faster, here at least
/// eightfold with half the element size.
#[test]
fn quadratic_hexahedra_approach_the_pressures_of_the_radial_equilibrium() {
    for (wall, element_type, sizes) in [
        (Wall::Sphere, ElementType::Hex27, [[1, 2], [2, 4]]),
        (Wall::Cylinder, ElementType::Hex20, [[2, 4], [4, 8]]),
        (Wall::Cylinder, ElementType::Hex27, [[2, 4], [4, 8]]),
    ] {
        let exact = wall.published().map(|(stretch, _)| radial_pressure(wall, 1000.0, stretch));
        let [coarse, fine] = sizes.map(|[around, through]| {
            let found = pressures(wall, &mesh(wall, element_type, around, through), 1000.0);
            [0, 1, 2].map(|k| (found[k] / exact[k] - 1.0).abs())
        });
        println!("{wall:?} {element_type:?}: relative errors {coarse:.5?} {fine:.5?}");
        assert!(fine[0] < coarse[0] / 8.0, "{wall:?} {element_type:?}: {coarse:?} {fine:?}");
        let bound = if wall == Wall::Sphere { 0.05 } else { 2e-3 };
        assert!(fine.iter().all(|&error| error < bound), "{wall:?} {element_type:?}: {fine:?}");
        assert!(fine[1..].iter().all(|&error| error < 3e-3), "{wall:?} {element_type:?}: {fine:?}");
    }
}

/// Follower pressure on the inner surface gives the stretch at which the reactions have that pressure.
#[test]
fn follower_pressure_gives_the_stretch_of_its_reactions() {
    for (wall, number) in [(Wall::Sphere, 0), (Wall::Sphere, 1), (Wall::Cylinder, 1), (Wall::Cylinder, 2)] {
        let mesh = mesh(wall, ElementType::Hex8, 2, 2).with_patches(|_| true);
        let value = pressures(wall, &mesh, 1000.0)[number];
        let pressure = Pressure { surface: INNER.into(), value, curve: LoadCurve::Ramp };
        let points = held(wall, &mesh, false);
        let conditions = Conditions { points, loads: vec![Arc::new(pressure)], ..Conditions::default() };
        let mut stepper = stepper(&mesh, 1000.0, &conditions, 4);
        stepper.run(&mut ()).unwrap();
        let (stretch, _) = wall.published()[number];
        let displacements = &stepper.state().displacements;
        // The mean over the nodes of the radial displacement at the inner radius 1.
        let nodes = mesh.surface(INNER).unwrap().nodes();
        let radial = |&node: &u32| -> f64 {
            let (x, u) = (mesh.nodes()[node as usize], displacements[node as usize]);
            (0..wall.circumferential() as usize + 1).map(|i| u[i] * x[i]).sum()
        };
        let found = 1.0 + nodes.iter().map(radial).sum::<f64>() / nodes.len() as f64;
        println!("{wall:?}: follower pressure gives the stretch {found:.4} ({stretch})");
        assert!((found - stretch).abs() < 0.01 * (stretch - 1.0), "{wall:?}: {found} instead of {stretch}");
    }
}
