//! Reference elements: nodes, shape functions, quadrature and faces of every element type.
//!
//! | type | reference domain | nodes | points | integrates exactly |
//! |---|---|---|---|---|
//! | [`Tet4`], [`Tet10`] | `xi_i >= 0`, `sum xi_i <= 1` | 4, 10 | 1, 4 | degree 1, 2 |
//! | [`Hex8`], [`Hex20`], [`Hex27`] | `-1 <= xi_i <= 1` | 8, 20, 27 | 8, 27, 27 | degree 3, 5, 5 in each coordinate |
//! | [`Wedge6`] | triangle in `xi_1, xi_2`, times `-1 <= xi_3 <= 1` | 6 | 6 | degree 2 in the triangle, 3 along `xi_3` |
//! | [`Tri3`], [`Tri6`] | `xi_i >= 0`, `sum xi_i <= 1` | 3, 6 | 3, 6 | degree 2, 4 |
//! | [`Quad4`], [`Quad8`], [`Quad9`] | `-1 <= xi_i <= 1` | 4, 8, 9 | 4, 9, 9 | degree 3, 5, 5 in each coordinate |
//!
//! Corners come first, then the nodes on edges, faces and the volume, each in the order of VTK's cell types. Only the
//! wedge differs: its corners have the order of Gmsh and Abaqus, in which its volume is positive.
//!
//! Shape functions and product rules: T. J. R. Hughes, *The Finite Element Method* (2000), chapter 3. Rule of four
//! points on tetrahedra: P. Keast, Comput. Methods Appl. Mech. Eng. 55 (1986) 339-348. Rules on triangles: D. A.
//! Dunavant, Int. J. Numer. Methods Eng. 21 (1985) 1129-1148.
//!
//! ```
//! use biotissue::fem::element::reference::{Element, Tet10};
//!
//! let volume: f64 = Tet10::quadrature().iter().map(|point| point.weight).sum();
//! assert!((volume - 1.0 / 6.0).abs() < 1e-15);
//! let values = Tet10::values(Tet10::nodes()[7]);
//! assert_eq!(values[7], 1.0);
//! ```

use std::array::from_fn;

/// A point of a quadrature rule on a reference domain of `DIM` dimensions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct QuadraturePoint<const DIM: usize> {
    /// Position on the reference domain.
    pub xi: [f64; DIM],
    /// Weight; the weights of a rule sum to the volume of the domain.
    pub weight: f64,
}

/// An element type of `NODES` nodes and `POINTS` integration points on a reference domain of `DIM` dimensions. Faces of
/// elements are element types of two dimensions.
pub trait Element<const DIM: usize, const NODES: usize, const POINTS: usize> {
    /// Number of corners; the other nodes lie between them.
    const CORNERS: usize;
    /// The two corners of each edge, in the order of the nodes on the edges.
    const EDGES: &'static [[usize; 2]];
    /// The corners of each face (of elements of three dimensions), ordered so that the normal points outward.
    const FACES: &'static [&'static [usize]];

    /// Returns the positions of the nodes on the reference domain.
    fn nodes() -> [[f64; DIM]; NODES];

    /// Returns the shape functions `N_a` at `xi`: one at node `a`, zero at the others; their sum is one.
    fn values(xi: [f64; DIM]) -> [f64; NODES];

    /// Returns the derivatives `dN_a / dxi_j` at `xi`, one row per node.
    fn gradients(xi: [f64; DIM]) -> [[f64; DIM]; NODES];

    /// Returns the quadrature rule of the stiffness.
    fn quadrature() -> [QuadraturePoint<DIM>; POINTS];
}

/// A one-dimensional factor of a product shape function, and its derivative.
type Factor = (f64, f64);

/// `(1 + s xi) / 2`, one at `s` and zero at `-s`.
fn linear(s: f64, xi: f64) -> Factor {
    (0.5 * (1.0 + s * xi), 0.5 * s)
}

/// The quadratic polynomial that is one at `s` and zero at the two others of -1, 0 and 1.
fn quadratic(s: f64, xi: f64) -> Factor {
    if s == 0.0 { (1.0 - xi * xi, -2.0 * xi) } else { (0.5 * xi * (xi + s), xi + 0.5 * s) }
}

/// Returns the product of the factors.
fn product<const DIM: usize>(factors: [Factor; DIM]) -> f64 {
    factors.iter().map(|(value, _)| value).product()
}

/// Returns the gradient of the product of factors, the `j`-th of which depends on coordinate `j`.
fn product_gradient<const DIM: usize>(factors: [Factor; DIM]) -> [f64; DIM] {
    from_fn(|j| (0..DIM).map(|i| if i == j { factors[i].1 } else { factors[i].0 }).product())
}

/// Returns the barycentric coordinates of a point of a simplex: that of the origin first.
fn barycentric<const DIM: usize, const CORNERS: usize>(xi: [f64; DIM]) -> [f64; CORNERS] {
    from_fn(|a| if a == 0 { 1.0 - xi.iter().sum::<f64>() } else { xi[a - 1] })
}

/// Returns the derivative of barycentric coordinate `a` by coordinate `j`.
fn barycentric_gradient(a: usize, j: usize) -> f64 {
    if a == 0 { -1.0 } else { f64::from(a == j + 1) }
}

/// Returns the midpoint of an edge, or a corner itself, from the positions of the corners.
fn node_position<const DIM: usize>(corners: &[[f64; DIM]], edges: &[[usize; 2]], node: usize) -> [f64; DIM] {
    match node.checked_sub(corners.len()) {
        None => corners[node],
        Some(edge) => from_fn(|j| 0.5 * (corners[edges[edge][0]][j] + corners[edges[edge][1]][j])),
    }
}

/// Defines a simplex element of the given dimension with linear or quadratic shape functions.
macro_rules! simplex {
    ($(#[$doc:meta])* $name:ident, $dim:literal, $nodes:literal, $points:literal, $edges:expr, $faces:expr, $rule:expr) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug)]
        pub struct $name;

        impl Element<$dim, $nodes, $points> for $name {
            const CORNERS: usize = $dim + 1;
            const EDGES: &'static [[usize; 2]] = &$edges;
            const FACES: &'static [&'static [usize]] = &$faces;

            fn nodes() -> [[f64; $dim]; $nodes] {
                let corners: [[f64; $dim]; $dim + 1] = from_fn(|a| from_fn(|j| f64::from(a == j + 1)));
                from_fn(|node| node_position(&corners, Self::EDGES, node))
            }

            fn values(xi: [f64; $dim]) -> [f64; $nodes] {
                let l: [f64; $dim + 1] = barycentric(xi);
                if $nodes == $dim + 1 {
                    return from_fn(|a| l[a]);
                }
                from_fn(|node| match node.checked_sub(Self::CORNERS) {
                    None => l[node] * (2.0 * l[node] - 1.0),
                    Some(edge) => 4.0 * l[Self::EDGES[edge][0]] * l[Self::EDGES[edge][1]],
                })
            }

            fn gradients(xi: [f64; $dim]) -> [[f64; $dim]; $nodes] {
                let l: [f64; $dim + 1] = barycentric(xi);
                let d = barycentric_gradient;
                from_fn(|node| match node.checked_sub(Self::CORNERS) {
                    None if $nodes == $dim + 1 => from_fn(|j| d(node, j)),
                    None => from_fn(|j| (4.0 * l[node] - 1.0) * d(node, j)),
                    Some(edge) => {
                        let [a, b] = Self::EDGES[edge];
                        from_fn(|j| 4.0 * (d(a, j) * l[b] + l[a] * d(b, j)))
                    }
                })
            }

            fn quadrature() -> [QuadraturePoint<$dim>; $points] {
                $rule
            }
        }
    };
}

/// Defines an element on `[-1, 1]^DIM`. `$shape` returns the factors of the shape function of the node at the given
/// position, and `$bubble` what multiplies it (one, except for corners of serendipity elements), with its gradient.
macro_rules! cube {
    ($(#[$doc:meta])* $name:ident, $dim:literal, $nodes:literal, $points:literal, $positions:expr, $edges:expr, $faces:expr, $order:ident) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug)]
        pub struct $name;

        impl Element<$dim, $nodes, $points> for $name {
            const CORNERS: usize = 1 << $dim;
            const EDGES: &'static [[usize; 2]] = $edges;
            const FACES: &'static [&'static [usize]] = $faces;

            fn nodes() -> [[f64; $dim]; $nodes] {
                from_fn(|node| $positions[node].map(f64::from))
            }

            fn values(xi: [f64; $dim]) -> [f64; $nodes] {
                Self::nodes().map(|s| $order::value(s, xi))
            }

            fn gradients(xi: [f64; $dim]) -> [[f64; $dim]; $nodes] {
                Self::nodes().map(|s| $order::gradient(s, xi))
            }

            fn quadrature() -> [QuadraturePoint<$dim>; $points] {
                gauss_product($order::GAUSS)
            }
        }
    };
}

/// Products of linear functions.
mod trilinear {
    use super::{from_fn, linear, product, product_gradient};

    pub const GAUSS: &[(f64, f64)] = super::GAUSS_2;

    pub fn value<const DIM: usize>(s: [f64; DIM], xi: [f64; DIM]) -> f64 {
        product::<DIM>(from_fn(|j| linear(s[j], xi[j])))
    }

    pub fn gradient<const DIM: usize>(s: [f64; DIM], xi: [f64; DIM]) -> [f64; DIM] {
        product_gradient(from_fn(|j| linear(s[j], xi[j])))
    }
}

/// Products of quadratic functions.
mod triquadratic {
    use super::{from_fn, product, product_gradient, quadratic};

    pub const GAUSS: &[(f64, f64)] = super::GAUSS_3;

    pub fn value<const DIM: usize>(s: [f64; DIM], xi: [f64; DIM]) -> f64 {
        product::<DIM>(from_fn(|j| quadratic(s[j], xi[j])))
    }

    pub fn gradient<const DIM: usize>(s: [f64; DIM], xi: [f64; DIM]) -> [f64; DIM] {
        product_gradient(from_fn(|j| quadratic(s[j], xi[j])))
    }
}

/// Quadratic functions without nodes inside faces or the volume.
mod serendipity {
    use super::{from_fn, linear, product, product_gradient, quadratic};

    pub const GAUSS: &[(f64, f64)] = super::GAUSS_3;

    /// Quadratic along the edge on which the node lies, linear in the other directions.
    fn factors<const DIM: usize>(s: [f64; DIM], xi: [f64; DIM]) -> [super::Factor; DIM] {
        from_fn(|j| if s[j] == 0.0 { quadratic(0.0, xi[j]) } else { linear(s[j], xi[j]) })
    }

    /// `s . xi - (DIM - 1)` for corners, which vanishes at the nodes on the adjacent edges; `None` for other nodes.
    fn plane<const DIM: usize>(s: [f64; DIM], xi: [f64; DIM]) -> Option<f64> {
        let is_corner = s.iter().all(|&s| s != 0.0);
        is_corner.then(|| s.iter().zip(xi).map(|(s, xi)| s * xi).sum::<f64>() - (DIM - 1) as f64)
    }

    pub fn value<const DIM: usize>(s: [f64; DIM], xi: [f64; DIM]) -> f64 {
        product(factors(s, xi)) * plane(s, xi).unwrap_or(1.0)
    }

    pub fn gradient<const DIM: usize>(s: [f64; DIM], xi: [f64; DIM]) -> [f64; DIM] {
        let (factors, gradient) = (factors(s, xi), product_gradient(factors(s, xi)));
        match plane(s, xi) {
            None => gradient,
            Some(plane) => from_fn(|j| gradient[j] * plane + product(factors) * s[j]),
        }
    }
}

/// The rule of two points by Gauss: `1 / sqrt 3`.
const GAUSS_2: &[(f64, f64)] = &[(-0.577_350_269_189_625_8, 1.0), (0.577_350_269_189_625_8, 1.0)];
/// The rule of three points by Gauss: `sqrt 0.6`.
const GAUSS_3: &[(f64, f64)] =
    &[(-0.774_596_669_241_483_4, 5.0 / 9.0), (0.0, 8.0 / 9.0), (0.774_596_669_241_483_4, 5.0 / 9.0)];

/// Returns the products of a rule on `[-1, 1]`; the first coordinate changes fastest.
fn gauss_product<const DIM: usize, const POINTS: usize>(rule: &[(f64, f64)]) -> [QuadraturePoint<DIM>; POINTS] {
    from_fn(|point| {
        let of = |j: usize| rule[point / rule.len().pow(j as u32) % rule.len()];
        QuadraturePoint { xi: from_fn(|j| of(j).0), weight: (0..DIM).map(|j| of(j).1).product() }
    })
}

/// The centroid of the tetrahedron.
fn tetrahedron_1() -> [QuadraturePoint<3>; 1] {
    [QuadraturePoint { xi: [0.25; 3], weight: 1.0 / 6.0 }]
}

/// Four points, one towards each corner: `(5 - sqrt 5) / 20` and `(5 + 3 sqrt 5) / 20`.
fn tetrahedron_4() -> [QuadraturePoint<3>; 4] {
    const FAR: f64 = 0.138_196_601_125_010_5;
    const NEAR: f64 = 0.585_410_196_624_968_5;
    from_fn(|a| QuadraturePoint { xi: from_fn(|j| if a == j + 1 { NEAR } else { FAR }), weight: 1.0 / 24.0 })
}

/// Three points inside the triangle, one towards each corner.
fn triangle_3() -> [QuadraturePoint<2>; 3] {
    from_fn(|a| QuadraturePoint { xi: from_fn(|j| if a == j + 1 { 2.0 / 3.0 } else { 1.0 / 6.0 }), weight: 1.0 / 6.0 })
}

/// Six points: three near the corners and three near the edges.
fn triangle_6() -> [QuadraturePoint<2>; 6] {
    const ORBITS: [(f64, f64); 2] =
        [(0.091_576_213_509_770_74, 0.054_975_871_827_660_93), (0.445_948_490_915_964_9, 0.111_690_794_839_005_73)];
    from_fn(|point| {
        let (b, weight) = ORBITS[point / 3];
        QuadraturePoint { xi: from_fn(|j| if point % 3 == j + 1 { 1.0 - 2.0 * b } else { b }), weight }
    })
}

const TETRAHEDRON_EDGES: [[usize; 2]; 6] = [[0, 1], [1, 2], [2, 0], [0, 3], [1, 3], [2, 3]];
/// Face `k` is opposite to corner `k`.
const TETRAHEDRON_FACES: [&[usize]; 4] = [&[1, 2, 3], &[0, 3, 2], &[0, 1, 3], &[0, 2, 1]];

simplex!(
    /// The linear tetrahedron.
    Tet4, 3, 4, 1, TETRAHEDRON_EDGES, TETRAHEDRON_FACES, tetrahedron_1()
);
simplex!(
    /// The quadratic tetrahedron.
    Tet10, 3, 10, 4, TETRAHEDRON_EDGES, TETRAHEDRON_FACES, tetrahedron_4()
);
simplex!(
    /// The linear triangle, a face of [`Tet4`] and [`Wedge6`].
    Tri3, 2, 3, 3, [[0, 1], [1, 2], [2, 0]], [], triangle_3()
);
simplex!(
    /// The quadratic triangle, a face of [`Tet10`].
    Tri6, 2, 6, 6, [[0, 1], [1, 2], [2, 0]], [], triangle_6()
);

/// The nodes of [`Quad9`]; those of [`Quad4`] and [`Quad8`] come first.
const QUADRILATERAL_NODES: [[i8; 2]; 9] =
    [[-1, -1], [1, -1], [1, 1], [-1, 1], [0, -1], [1, 0], [0, 1], [-1, 0], [0, 0]];
const QUADRILATERAL_EDGES: &[[usize; 2]] = &[[0, 1], [1, 2], [2, 3], [3, 0]];

cube!(
    /// The bilinear quadrilateral, a face of [`Hex8`] and [`Wedge6`].
    Quad4, 2, 4, 4, QUADRILATERAL_NODES, QUADRILATERAL_EDGES, &[], trilinear
);
cube!(
    /// The serendipity quadrilateral, a face of [`Hex20`].
    Quad8, 2, 8, 9, QUADRILATERAL_NODES, QUADRILATERAL_EDGES, &[], serendipity
);
cube!(
    /// The biquadratic quadrilateral, a face of [`Hex27`].
    Quad9, 2, 9, 9, QUADRILATERAL_NODES, QUADRILATERAL_EDGES, &[], triquadratic
);

/// The nodes of [`Hex27`]; those of [`Hex8`] and [`Hex20`] come first.
#[rustfmt::skip]
const HEXAHEDRON_NODES: [[i8; 3]; 27] = [
    [-1, -1, -1], [1, -1, -1], [1, 1, -1], [-1, 1, -1], [-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1],
    [0, -1, -1], [1, 0, -1], [0, 1, -1], [-1, 0, -1], [0, -1, 1], [1, 0, 1], [0, 1, 1], [-1, 0, 1],
    [-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0],
    [-1, 0, 0], [1, 0, 0], [0, -1, 0], [0, 1, 0], [0, 0, -1], [0, 0, 1], [0, 0, 0],
];
#[rustfmt::skip]
const HEXAHEDRON_EDGES: &[[usize; 2]] = &[
    [0, 1], [1, 2], [2, 3], [3, 0], [4, 5], [5, 6], [6, 7], [7, 4], [0, 4], [1, 5], [2, 6], [3, 7],
];
/// In the order of the nodes of [`Hex27`] inside the faces.
const HEXAHEDRON_FACES: &[&[usize]] =
    &[&[0, 4, 7, 3], &[1, 2, 6, 5], &[0, 1, 5, 4], &[2, 3, 7, 6], &[0, 3, 2, 1], &[4, 5, 6, 7]];

cube!(
    /// The trilinear hexahedron.
    Hex8, 3, 8, 8, HEXAHEDRON_NODES, HEXAHEDRON_EDGES, HEXAHEDRON_FACES, trilinear
);
cube!(
    /// The serendipity hexahedron.
    Hex20, 3, 20, 27, HEXAHEDRON_NODES, HEXAHEDRON_EDGES, HEXAHEDRON_FACES, serendipity
);
cube!(
    /// The triquadratic hexahedron.
    Hex27, 3, 27, 27, HEXAHEDRON_NODES, HEXAHEDRON_EDGES, HEXAHEDRON_FACES, triquadratic
);

/// The linear wedge (prism): the triangle of corners 0 to 2 at `xi_3 = -1`, that of corners 3 to 5 at `xi_3 = 1`.
#[derive(Clone, Copy, Debug)]
pub struct Wedge6;

impl Wedge6 {
    /// Returns the factor along `xi_3` of the shape function of a node.
    fn along(node: usize, xi: [f64; 3]) -> Factor {
        linear(if node < 3 { -1.0 } else { 1.0 }, xi[2])
    }
}

impl Element<3, 6, 6> for Wedge6 {
    const CORNERS: usize = 6;
    const EDGES: &'static [[usize; 2]] = &[[0, 1], [1, 2], [2, 0], [3, 4], [4, 5], [5, 3], [0, 3], [1, 4], [2, 5]];
    const FACES: &'static [&'static [usize]] = &[&[0, 2, 1], &[3, 4, 5], &[0, 1, 4, 3], &[1, 2, 5, 4], &[2, 0, 3, 5]];

    fn nodes() -> [[f64; 3]; 6] {
        let triangle = Tri3::nodes();
        from_fn(|node| {
            let [x, y] = triangle[node % 3];
            [x, y, if node < 3 { -1.0 } else { 1.0 }]
        })
    }

    fn values(xi: [f64; 3]) -> [f64; 6] {
        let triangle = Tri3::values([xi[0], xi[1]]);
        from_fn(|node| triangle[node % 3] * Self::along(node, xi).0)
    }

    fn gradients(xi: [f64; 3]) -> [[f64; 3]; 6] {
        let at = [xi[0], xi[1]];
        let (values, gradients) = (Tri3::values(at), Tri3::gradients(at));
        from_fn(|node| {
            let ([dx, dy], (along, slope)) = (gradients[node % 3], Self::along(node, xi));
            [dx * along, dy * along, values[node % 3] * slope]
        })
    }

    fn quadrature() -> [QuadraturePoint<3>; 6] {
        let triangle = triangle_3();
        from_fn(|point| {
            let (QuadraturePoint { xi: [x, y], weight }, (z, w)) = (triangle[point % 3], GAUSS_2[point / 3]);
            QuadraturePoint { xi: [x, y, z], weight: weight * w }
        })
    }
}

#[cfg(test)]
mod tests;
