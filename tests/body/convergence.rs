//! Manufactured solutions: body force, traction and prescribed displacements of a smooth displacement field, which
//! every element type approximates with the order of its shape functions, in linear elasticity and at finite strain.

use std::sync::Arc;

use biotissue::backends::sparse::Sparse;
use biotissue::fem::boundary::{
    BodyForce, Conditions, LoadCondition, LoadCurve, LoadFunction, SurfaceCondition, Traction,
};
use biotissue::fem::element::reference::{Element, Hex8, Hex20, Hex27, QuadraturePoint, Tet4, Tet10, Wedge6};
use biotissue::fem::element::{ElementType, PointGeometry};
use biotissue::fem::material::{LinearElastic, NeoHookean};
use biotissue::fem::mesh::Mesh;
use biotissue::fem::point_field::FormulaField;
use biotissue::fem::stepping::{StepParams, Stepper};
use nalgebra::{Matrix3, Vector3};

use crate::meshes::distorted;

const MU: f64 = 1.0;
const LAMBDA: f64 = 1.5;

/// The law of the material. The stresses and their divergence are written out here, independently of the library.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Law {
    /// `P = 2 mu sym(H) + lambda tr(H) I` with `H = du/dX`.
    LinearElastic,
    /// `P = mu F + (lambda ln J - mu) F^-T`.
    NeoHookean,
}

/// The exact displacement `u_i = AMPLITUDE_i sin(WAVE_i . X + PHASE_i)`, whose gradient reaches 0.3.
const AMPLITUDE: [f64; 3] = [0.1, -0.08, 0.09];
const WAVE: [[f64; 3]; 3] = [[2.0, 1.0, -1.5], [-1.0, 2.5, 1.0], [1.5, -0.5, 2.0]];
const PHASE: [f64; 3] = [0.3, 1.1, -0.7];

fn phase(i: usize, x: [f64; 3]) -> f64 {
    PHASE[i] + (0..3).map(|j| WAVE[i][j] * x[j]).sum::<f64>()
}

fn exact(x: [f64; 3]) -> Vector3<f64> {
    Vector3::from_fn(|i, _| AMPLITUDE[i] * phase(i, x).sin())
}

fn exact_gradient(x: [f64; 3]) -> Matrix3<f64> {
    Matrix3::from_fn(|i, j| AMPLITUDE[i] * WAVE[i][j] * phase(i, x).cos())
}

/// `d2 u_i / dX_j dX_k`.
fn second(i: usize, j: usize, k: usize, x: [f64; 3]) -> f64 {
    -AMPLITUDE[i] * WAVE[i][j] * WAVE[i][k] * phase(i, x).sin()
}

impl Law {
    fn stress(self, x: [f64; 3]) -> Matrix3<f64> {
        let h = exact_gradient(x);
        match self {
            Self::LinearElastic => (h + h.transpose()) * MU + Matrix3::from_diagonal_element(LAMBDA * h.trace()),
            Self::NeoHookean => {
                let f = Matrix3::identity() + h;
                f * MU + f.try_inverse().unwrap().transpose() * (LAMBDA * f.determinant().ln() - MU)
            }
        }
    }

    /// Returns the body force `-dP_iJ/dX_J`. With `G = F^-1`, `d(ln J)/dX_L = G_Jk u_k,JL` and
    /// `dG_Ji/dX_L = -G_Jk u_k,ML G_Mi`; linear elasticity is the limit `G = I`, `ln J = 0`.
    fn body_force(self, i: usize, x: [f64; 3]) -> f64 {
        let (g, log) = match self {
            Self::LinearElastic => (Matrix3::identity(), 0.0),
            Self::NeoHookean => {
                let f = Matrix3::identity() + exact_gradient(x);
                (f.try_inverse().unwrap(), f.determinant().ln())
            }
        };
        let log_slope = |l: usize| pairs().map(|(j, k)| g[(j, k)] * second(k, j, l, x)).sum::<f64>();
        let mut divergence = 0.0;
        for j in 0..3 {
            let inverse_slope: f64 = pairs().map(|(k, m)| -g[(j, k)] * second(k, m, j, x) * g[(m, i)]).sum();
            divergence +=
                MU * second(i, j, j, x) + LAMBDA * log_slope(j) * g[(j, i)] + (LAMBDA * log - MU) * inverse_slope;
        }
        -divergence
    }
}

fn pairs() -> impl Iterator<Item = (usize, usize)> {
    (0..9).map(|n| (n / 3, n % 3))
}

/// A component of the displacement, of the body force, or of the traction on the face with the normal x.
#[derive(Clone, Copy, Debug)]
enum Quantity {
    Displacement,
    BodyForce(Law),
    Traction(Law),
}

#[derive(Debug)]
struct Component(Quantity, usize);

impl LoadFunction for Component {
    fn factor(&self, t: f64, x: [f64; 3]) -> f64 {
        let Self(quantity, i) = *self;
        t * match quantity {
            Quantity::Displacement => exact(x)[i],
            Quantity::BodyForce(law) => law.body_force(i, x),
            Quantity::Traction(law) => law.stress(x)[(i, 0)],
        }
    }
}

/// Returns the conditions of the exact solution: a traction on `x1`, displacements on the other sides.
fn conditions(law: Law) -> Conditions {
    let (mut surfaces, mut loads) = (Vec::new(), Vec::<Arc<dyn LoadCondition>>::new());
    for i in 0..3 {
        let curve = |quantity| LoadCurve::Function(Arc::new(Component(quantity, i)));
        let value: [f64; 3] = std::array::from_fn(|j| if i == j { 1.0 } else { 0.0 });
        let prescribed = curve(Quantity::Displacement);
        surfaces.extend(["x0", "y0", "y1", "z0", "z1"].map(|surface| SurfaceCondition {
            surface: surface.into(),
            displacement: std::array::from_fn(|j| (i == j).then_some(1.0)),
            curve: prescribed.clone(),
        }));
        loads.push(Arc::new(Traction { surface: "x1".into(), value, curve: curve(Quantity::Traction(law)) }));
        loads.push(Arc::new(BodyForce { region: "*".into(), value, curve: curve(Quantity::BodyForce(law)) }));
    }
    Conditions { surfaces, loads, ..Conditions::default() }
}

/// Returns the displacements of all nodes.
fn solve(law: Law, mesh: &Arc<Mesh>) -> Vec<[f64; 3]> {
    let field = match law {
        Law::LinearElastic => FormulaField::uniform(LinearElastic { mu: MU, lambda: LAMBDA }, mesh),
        Law::NeoHookean => FormulaField::uniform(NeoHookean { mu: MU, lambda: LAMBDA }, mesh),
    };
    let params = StepParams { count: 1, ..StepParams::default() };
    let mut stepper = Stepper::<Sparse, _>::new(&(), Arc::clone(mesh), &conditions(law), field, params).unwrap();
    let reports = stepper.run(&mut ()).unwrap();
    if law == Law::LinearElastic {
        assert_eq!(reports[0].iterations(), 0, "a linear problem is solved by the linear first guess");
    }
    stepper.state().displacements.clone()
}

/// Gauss's rule of four points on `[0, 1]`: positions and weights.
const GAUSS_4: [(f64, f64); 4] = [
    (0.069_431_844_202_973_71, 0.173_927_422_568_726_93),
    (0.330_009_478_207_571_9, 0.326_072_577_431_273_07),
    (0.669_990_521_792_428_1, 0.326_072_577_431_273_07),
    (0.930_568_155_797_026_3, 0.173_927_422_568_726_93),
];

/// Returns a rule of higher degree than that of the stiffness, at whose points the gradients are more accurate than
/// elsewhere. Triangles and tetrahedra are collapsed squares and cubes.
fn rule(element_type: ElementType) -> Vec<QuadraturePoint<3>> {
    let cube = (0..64).map(|n| [GAUSS_4[n % 4], GAUSS_4[n / 4 % 4], GAUSS_4[n / 16]]);
    let point = |[(a, u), (b, v), (c, w)]: [(f64, f64); 3]| {
        let (xi, scale) = match element_type {
            ElementType::Tet4 | ElementType::Tet10 => {
                ([a, b * (1.0 - a), c * (1.0 - a) * (1.0 - b)], (1.0 - a) * (1.0 - a) * (1.0 - b))
            }
            ElementType::Wedge6 => ([a, b * (1.0 - a), 2.0 * c - 1.0], 2.0 * (1.0 - a)),
            _ => ([2.0 * a - 1.0, 2.0 * b - 1.0, 2.0 * c - 1.0], 8.0),
        };
        QuadraturePoint { xi, weight: u * v * w * scale }
    };
    cube.map(point).collect()
}

/// Returns the L2 norms of the errors of the displacements and of their gradients.
fn errors_of<E: Element<3, N, Q>, const N: usize, const Q: usize>(mesh: &Mesh, displacements: &[[f64; 3]]) -> [f64; 2] {
    let mut squares = [0.0; 2];
    for (element, (element_type, nodes)) in mesh.elements().typed().enumerate() {
        let positions: [[f64; 3]; N] = mesh.positions(element).try_into().unwrap();
        let u: [[f64; 3]; N] = std::array::from_fn(|a| displacements[nodes[a] as usize]);
        for point in rule(element_type) {
            let geometry = PointGeometry::new::<E, Q>(&positions, &point).unwrap();
            let values = E::values(point.xi);
            let at = |of: &[[f64; 3]; N]| -> [f64; 3] {
                std::array::from_fn(|i| values.iter().zip(of).map(|(value, x)| value * x[i]).sum())
            };
            let x = at(&positions);
            squares[0] += geometry.volume * (exact(x) - Vector3::from(at(&u))).norm_squared();
            squares[1] += geometry.volume * (exact_gradient(x) - geometry.displacement_gradient(&u)).norm_squared();
        }
    }
    squares.map(f64::sqrt)
}

fn errors(law: Law, element_type: ElementType, cells: usize) -> [f64; 2] {
    let mesh = Arc::new(distorted(element_type, cells));
    let u = solve(law, &mesh);
    match element_type {
        ElementType::Tet4 => errors_of::<Tet4, _, _>(&mesh, &u),
        ElementType::Tet10 => errors_of::<Tet10, _, _>(&mesh, &u),
        ElementType::Hex8 => errors_of::<Hex8, _, _>(&mesh, &u),
        ElementType::Hex20 => errors_of::<Hex20, _, _>(&mesh, &u),
        ElementType::Hex27 => errors_of::<Hex27, _, _>(&mesh, &u),
        ElementType::Wedge6 => errors_of::<Wedge6, _, _>(&mesh, &u),
    }
}

type Row = (Law, ElementType, [usize; 3], [[f64; 2]; 3]);

/// Law, element type, cells along each edge of the cube, and the errors in L2 and of the gradients for each number of
/// cells, as this crate found them when the table was made.
#[rustfmt::skip]
const TABLE: [Row; 12] = [
    (Law::LinearElastic, ElementType::Tet4,   [2, 4, 8], [[1.7120e-2, 1.3122e-1], [4.6956e-3, 6.8064e-2], [1.3235e-3, 3.4898e-2]]),
    (Law::LinearElastic, ElementType::Tet10,  [2, 3, 4], [[1.2640e-3, 1.9552e-2], [3.9455e-4, 9.2386e-3], [1.6975e-4, 5.2961e-3]]),
    (Law::LinearElastic, ElementType::Hex8,   [2, 4, 8], [[1.5904e-2, 8.9344e-2], [4.0996e-3, 4.4277e-2], [1.0558e-3, 2.2007e-2]]),
    (Law::LinearElastic, ElementType::Hex20,  [2, 3, 4], [[1.0130e-3, 1.2277e-2], [2.9850e-4, 5.4978e-3], [1.2904e-4, 3.1756e-3]]),
    (Law::LinearElastic, ElementType::Hex27,  [2, 3, 4], [[9.1670e-4, 1.1502e-2], [2.7260e-4, 5.1674e-3], [1.1532e-4, 2.9330e-3]]),
    (Law::LinearElastic, ElementType::Wedge6, [2, 4, 8], [[1.7849e-2, 1.0391e-1], [4.5397e-3, 5.2983e-2], [1.2068e-3, 2.6898e-2]]),
    (Law::NeoHookean,    ElementType::Tet4,   [2, 4, 8], [[1.6909e-2, 1.3133e-1], [4.5719e-3, 6.8039e-2], [1.2680e-3, 3.4831e-2]]),
    (Law::NeoHookean,    ElementType::Tet10,  [2, 3, 4], [[1.2372e-3, 1.9464e-2], [3.8815e-4, 9.1860e-3], [1.6685e-4, 5.2636e-3]]),
    (Law::NeoHookean,    ElementType::Hex8,   [2, 4, 8], [[1.5644e-2, 8.8834e-2], [3.9982e-3, 4.4179e-2], [1.0234e-3, 2.1986e-2]]),
    (Law::NeoHookean,    ElementType::Hex20,  [2, 3, 4], [[1.0018e-3, 1.2227e-2], [2.9597e-4, 5.4748e-3], [1.2771e-4, 3.1590e-3]]),
    (Law::NeoHookean,    ElementType::Hex27,  [2, 3, 4], [[9.1130e-4, 1.1438e-2], [2.7090e-4, 5.1421e-3], [1.1458e-4, 2.9192e-3]]),
    (Law::NeoHookean,    ElementType::Wedge6, [2, 4, 8], [[1.7558e-2, 1.0384e-1], [4.4191e-3, 5.2986e-2], [1.1647e-3, 2.6872e-2]]),
];

/// Errors keep within 1 % of the table, and decrease with the orders `k + 1` and `k` of shape functions of degree `k`.
#[test]
fn smooth_solutions_converge_at_the_rates_of_every_element_type() {
    for (law, element_type, cells, stored) in TABLE {
        let found = cells.map(|cells| errors(law, element_type, cells));
        let context = format!("{law:?}, {}, {cells:?} cells: {found:?}", element_type.name());
        let [_, coarse, fine] = found;
        let refinement = (cells[2] as f64 / cells[1] as f64).ln();
        let degree = if element_type.is_quadratic() { 2.0 } else { 1.0 };
        for (k, order) in [degree + 1.0, degree].into_iter().enumerate() {
            let rate = (coarse[k] / fine[k]).ln() / refinement;
            assert!((rate - order).abs() < 0.25, "rate {rate:.2} instead of {order}: {context}");
        }
        for (found, stored) in found.as_flattened().iter().zip(stored.as_flattened()) {
            assert!((found / stored - 1.0).abs() < 0.01, "{found:.4e} instead of {stored:.4e}: {context}");
        }
    }
}
