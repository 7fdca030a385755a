//! A cube of 24 tetrahedra extended by 25 %, and the numbers that the single-scale program of MuMFiM printed for this
//! uniaxial extension. The surfaces are `left` (x = -1) and `right` (x = 1), the region is `body`.

use biotissue::fem::mesh::{Mesh, Surface};

pub const NODES: [[f64; 3]; 14] = [
    [-1.0, -1.0, 2.0],
    [-1.0, 1.0, 2.0],
    [1.0, 1.0, 2.0],
    [1.0, -1.0, 2.0],
    [1.0, 1.0, 0.0],
    [-1.0, 1.0, 0.0],
    [-1.0, -1.0, 0.0],
    [1.0, -1.0, 0.0],
    [0.0, 0.0, 2.0],
    [0.0, -1.0, 1.0],
    [-1.0, 0.0, 1.0],
    [0.0, 1.0, 1.0],
    [0.0, 0.0, 0.0],
    [1.0, 0.0, 1.0],
];

#[rustfmt::skip]
pub const TETS: [[u32; 4]; 24] = [
    [2, 3, 8, 13], [0, 1, 8, 10], [6, 7, 9, 12], [0, 3, 8, 9], [0, 6, 9, 10], [1, 5, 10, 11],
    [5, 6, 10, 12], [3, 7, 9, 13], [3, 8, 9, 13], [1, 8, 10, 11], [7, 9, 12, 13], [0, 8, 9, 10],
    [6, 9, 10, 12], [8, 10, 11, 13], [9, 10, 12, 13], [8, 9, 10, 13], [1, 2, 8, 11], [2, 4, 11, 13],
    [4, 7, 12, 13], [5, 10, 11, 12], [2, 8, 11, 13], [4, 11, 12, 13], [4, 5, 11, 12], [10, 11, 12, 13],
];

/// For every step, the norm of the residual before every Newton update, and the displacement of the lateral side.
#[rustfmt::skip]
pub const RECORDED: [(&[f64], f64); 10] = [
    (&[6.811962213373, 0.0007404433841], -0.01480445),
    (&[1248.885716843, 9.992832194304, 0.001682810842], -0.02923012),
    (&[1218.334421612, 9.604529951258, 0.001564768592], -0.04329455),
    (&[1189.865557715, 9.240923275245, 0.001457761015], -0.05701411),
    (&[1163.287149048, 8.899924336551, 0.001360514235], -0.07040406),
    (&[1138.429044819, 8.57965770143, 0.001271927071], -0.0834787),
    (&[1115.1400175, 8.278435832728, 0.001191044473], -0.09625141),
    (&[1093.285297822, 7.994737655086, 0.001117035455], -0.10873475),
    (&[1072.744473758, 7.727189787425, 0.001049174764], -0.12094051),
    (&[1053.409693846, 7.474550095319, 0.0009868275428], -0.13287979),
];

/// Returns the mesh, with the nodes of every element ordered such that its volume is positive.
pub fn mesh() -> Mesh {
    let elements = TETS.map(|[a, b, c, d]| {
        let x = [a, b, c, d].map(|n| nalgebra::Vector3::from(NODES[n as usize]));
        let volume = (x[1] - x[0]).cross(&(x[2] - x[0])).dot(&(x[3] - x[0]));
        if volume > 0.0 { [a, b, c, d] } else { [b, a, c, d] }
    });
    let at = |x: f64| -> Vec<[u32; 3]> {
        let faces = elements.iter().flat_map(|&[a, b, c, d]| [[b, c, d], [a, c, d], [a, b, d], [a, b, c]]);
        faces.filter(|face| face.iter().all(|&n| NODES[n as usize][0] == x)).collect()
    };
    let surface = |name: &str, x| Surface { name: name.into(), faces: at(x).into() };
    let surfaces = vec![surface("left", -1.0), surface("right", 1.0)];
    Mesh::new(NODES.to_vec(), elements.to_vec(), vec![0; 24], vec!["body".into()], surfaces).unwrap()
}
