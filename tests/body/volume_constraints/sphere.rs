//! A thick sphere of mapped boxes.

use std::collections::HashMap;

use biotissue::fem::element::ElementType;
use biotissue::fem::mesh::{Elements, Faces, Mesh, Surface, shapes};

/// A thick sphere of hexahedra between the radii 1 and 2: six mapped boxes of `n` by `n` elements and `layers` layers,
/// with the surfaces `inner` and `outer`.
pub fn sphere(element_type: ElementType, n: usize, layers: usize) -> Mesh {
    let cell = shapes::cuboid_of(element_type, [n, n, layers], [1.0; 3]).unwrap();
    let (mut nodes, mut elements) = (Vec::<[f64; 3]>::new(), Elements::default());
    let mut surfaces = [Faces::default(), Faces::default()];
    let mut known: HashMap<[i64; 3], u32> = HashMap::new();
    for (axis, side) in [(0, 1.0), (1, 1.0), (2, 1.0), (0, -1.0), (1, -1.0), (2, -1.0)] {
        let (first, second) = if side > 0.0 { (1, 2) } else { (2, 1) };
        let mut place = |&[u, v, w]: &[f64; 3]| {
            let tangent = |u: f64| (std::f64::consts::FRAC_PI_2 * (u - 0.5)).tan();
            let mut x = [0.0; 3];
            x[axis] = side;
            x[(axis + first) % 3] = tangent(u);
            x[(axis + second) % 3] = tangent(v);
            let scale = (1.0 + w) / x.iter().map(|x| x * x).sum::<f64>().sqrt();
            let x = x.map(|x| scale * x);
            *known.entry(x.map(|x| (x * 1e9).round() as i64)).or_insert_with(|| {
                nodes.push(x);
                nodes.len() as u32 - 1
            })
        };
        let number: Vec<u32> = cell.nodes().iter().map(&mut place).collect();
        elements.extend(&cell.elements().map(|node| number[node as usize]));
        for (surface, name) in surfaces.iter_mut().zip(["z0", "z1"]) {
            surface.extend(&cell.surface(name).unwrap().faces.map(|node| number[node as usize]));
        }
    }
    let named = ["inner", "outer"].into_iter().zip(surfaces);
    let surfaces = named.map(|(name, faces)| Surface { name: name.into(), faces }).collect();
    let regions = vec![0; elements.len()];
    Mesh::new(nodes, elements, regions, vec!["shell".into()], surfaces).unwrap()
}
