use super::*;

/// Calls `check` for every element type.
macro_rules! each {
    ($check:ident) => {
        $check::<Tet4, 3, 4, 1>();
        $check::<Tet10, 3, 10, 4>();
        $check::<Hex8, 3, 8, 8>();
        $check::<Hex20, 3, 20, 27>();
        $check::<Hex27, 3, 27, 27>();
        $check::<Wedge6, 3, 6, 6>();
        $check::<Tri3, 2, 3, 3>();
        $check::<Tri6, 2, 6, 6>();
        $check::<Quad4, 2, 4, 4>();
        $check::<Quad8, 2, 8, 9>();
        $check::<Quad9, 2, 9, 9>();
    };
}

/// A point inside every reference domain that no symmetry maps to itself.
fn inside<const D: usize>() -> [f64; D] {
    from_fn(|j| [0.21, 0.34, 0.17][j])
}

fn name<E>() -> &'static str {
    std::any::type_name::<E>()
}

fn nodal_basis<E: Element<D, N, P>, const D: usize, const N: usize, const P: usize>() {
    for (a, node) in E::nodes().into_iter().enumerate() {
        for (b, value) in E::values(node).into_iter().enumerate() {
            assert!((value - f64::from(a == b)).abs() < 1e-14, "{} {a} {b}: {value}", name::<E>());
        }
    }
    assert!((E::values(inside()).iter().sum::<f64>() - 1.0).abs() < 1e-14, "{}", name::<E>());
}

#[test]
fn shape_functions_are_one_at_their_node_and_zero_at_the_others() {
    each!(nodal_basis);
}

fn gradients_by_differences<E: Element<D, N, P>, const D: usize, const N: usize, const P: usize>() {
    const STEP: f64 = 1e-5;
    let gradients = E::gradients(inside());
    for j in 0..D {
        let shifted = |by: f64| {
            let mut xi = inside();
            xi[j] += by;
            E::values(xi)
        };
        let (plus, minus) = (shifted(STEP), shifted(-STEP));
        for a in 0..N {
            let expected = (plus[a] - minus[a]) / (2.0 * STEP);
            assert!((gradients[a][j] - expected).abs() < 1e-9, "{} {a} {j}", name::<E>());
        }
    }
}

#[test]
fn gradients_are_the_derivatives_of_the_shape_functions() {
    each!(gradients_by_differences);
}

/// Returns `integral x^p y^q dx dy` over the triangle: `p! q! / (p + q + 2)!`; likewise for the tetrahedron.
fn simplex_integral(powers: &[u32]) -> f64 {
    let factorial = |n: u32| (1..=n).map(f64::from).product::<f64>();
    let dimension = powers.len() as u32;
    powers.iter().map(|&p| factorial(p)).product::<f64>() / factorial(powers.iter().sum::<u32>() + dimension)
}

/// Returns `integral x^p dx` over `[-1, 1]`.
fn line_integral(p: u32) -> f64 {
    if p.is_multiple_of(2) { 2.0 / f64::from(p + 1) } else { 0.0 }
}

/// Checks the rule of `E` with all monomials that `exact` accepts, and that it fails for some monomial of one degree more.
fn rule<E: Element<D, N, P>, const D: usize, const N: usize, const P: usize>(
    integral: fn(&[u32]) -> f64,
    exact: fn(&[u32], u32) -> bool,
    degree: u32,
) {
    let mut powers = vec![0; D];
    let mut some_fails = false;
    for code in 0..(degree + 2).pow(D as u32) {
        powers.iter_mut().enumerate().for_each(|(j, p)| *p = code / (degree + 2).pow(j as u32) % (degree + 2));
        let monomial = |xi: &[f64; D]| xi.iter().zip(&powers).map(|(x, &p)| x.powi(p as i32)).product::<f64>();
        let sum: f64 = E::quadrature().iter().map(|point| point.weight * monomial(&point.xi)).sum();
        let error = (sum - integral(&powers)).abs();
        if exact(&powers, degree) {
            assert!(error < 1e-14, "{} {powers:?}: {error:e}", name::<E>());
        } else if exact(&powers, degree + 1) {
            some_fails |= error > 1e-6;
        }
    }
    assert!(some_fails, "{} is exact for a higher degree than stated", name::<E>());
}

#[test]
fn quadrature_is_exact_for_the_stated_degrees() {
    let total = |powers: &[u32], degree: u32| powers.iter().sum::<u32>() <= degree;
    let each = |powers: &[u32], degree: u32| powers.iter().all(|&p| p <= degree);
    let cube = |powers: &[u32]| powers.iter().map(|&p| line_integral(p)).product();
    let wedge = |powers: &[u32]| simplex_integral(&powers[..2]) * line_integral(powers[2]);
    rule::<Tet4, 3, 4, 1>(simplex_integral, total, 1);
    rule::<Tet10, 3, 10, 4>(simplex_integral, total, 2);
    rule::<Tri3, 2, 3, 3>(simplex_integral, total, 2);
    rule::<Tri6, 2, 6, 6>(simplex_integral, total, 4);
    rule::<Hex8, 3, 8, 8>(cube, each, 3);
    rule::<Hex20, 3, 20, 27>(cube, each, 5);
    rule::<Hex27, 3, 27, 27>(cube, each, 5);
    rule::<Quad4, 2, 4, 4>(cube, each, 3);
    rule::<Quad8, 2, 8, 9>(cube, each, 5);
    rule::<Quad9, 2, 9, 9>(cube, each, 5);
    rule::<Wedge6, 3, 6, 6>(wedge, |powers, degree| powers[0] + powers[1] <= degree && powers[2] <= degree + 1, 2);
}

/// Nodes after the corners lie in the middle of their edges, and of the faces and the volume after those.
fn middles<E: Element<D, N, P>, const D: usize, const N: usize, const P: usize>() {
    let nodes = E::nodes();
    let middle =
        |of: &[usize]| -> [f64; D] { from_fn(|j| of.iter().map(|&a| nodes[a][j]).sum::<f64>() / of.len() as f64) };
    let all: Vec<usize> = (0..E::CORNERS).collect();
    let expected = E::EDGES.iter().map(|edge| middle(edge)).chain(E::FACES.iter().map(|face| middle(face)));
    for (node, expected) in nodes[E::CORNERS..].iter().zip(expected.chain([middle(&all)])) {
        assert_eq!(*node, expected, "{}", name::<E>());
    }
}

#[test]
fn nodes_between_corners_lie_in_the_middle() {
    each!(middles);
}

/// The faces enclose the element: their area vectors sum to zero, and the divergence theorem gives its volume.
fn closed<E: Element<3, N, P>, const N: usize, const P: usize>() {
    let nodes = E::nodes();
    let (mut sum, mut volume) = ([0.0; 3], 0.0);
    for face in E::FACES {
        for k in 1..face.len() - 1 {
            let [a, b, c] = [face[0], face[k], face[k + 1]].map(|node| nodes[node]);
            let (u, v): ([f64; 3], [f64; 3]) = (from_fn(|j| b[j] - a[j]), from_fn(|j| c[j] - a[j]));
            let area: [f64; 3] = from_fn(|j| 0.5 * (u[(j + 1) % 3] * v[(j + 2) % 3] - u[(j + 2) % 3] * v[(j + 1) % 3]));
            volume += (0..3).map(|j| a[j] * area[j]).sum::<f64>() / 3.0;
            sum.iter_mut().zip(area).for_each(|(sum, area)| *sum += area);
        }
    }
    let expected: f64 = E::quadrature().iter().map(|point| point.weight).sum();
    assert!(
        sum.iter().all(|s| s.abs() < 1e-14) && (volume - expected).abs() < 1e-14,
        "{} {sum:?} {volume}",
        name::<E>()
    );
}

#[test]
fn the_faces_enclose_the_element_with_outward_normals() {
    closed::<Tet4, 4, 1>();
    closed::<Tet10, 10, 4>();
    closed::<Hex8, 8, 8>();
    closed::<Hex20, 20, 27>();
    closed::<Hex27, 27, 27>();
    closed::<Wedge6, 6, 6>();
}
