//! A box with a cavity.

use std::collections::HashMap;

use biotissue::fem::element::{ElementType, FaceType};
use biotissue::fem::mesh::{Elements, Faces, Mesh, Surface, shapes};

/// A box of 3 x 3 x 3 cells without the one in the middle, in the cube from 0 to 3. Surfaces: `x0` to `z1`, and the wall of
/// the cavity in two parts, `floor` (its lower side) and `walls` (all others).
pub fn hollow_box(element_type: ElementType) -> Mesh {
    let whole = shapes::cuboid_of(element_type, [3; 3], [3.0; 3]).unwrap();
    let is_inside = |element: usize| whole.center(element).iter().all(|x| *x > 1.0 && *x < 2.0);
    let mut elements = Elements::default();
    let mut kept = vec![u32::MAX; whole.nodes().len()];
    let mut inner: HashMap<Vec<u32>, (FaceType, Vec<u32>, usize)> = HashMap::new();
    for (element, (of_type, nodes)) in whole.elements().typed().enumerate() {
        if !is_inside(element) {
            elements.push(of_type, nodes);
            nodes.iter().for_each(|&node| kept[node as usize] = 0);
            continue;
        }
        for face in of_type.faces() {
            let on_face: Vec<u32> = face.nodes.iter().map(|&local| nodes[local]).collect();
            let mut key = on_face.clone();
            key.sort_unstable();
            inner.entry(key).or_insert((face.face_type, on_face, 0)).2 += 1;
        }
    }
    let mut nodes = Vec::new();
    for (old, new) in kept.iter_mut().enumerate().filter(|(_, new)| **new == 0) {
        *new = nodes.len() as u32;
        nodes.push(whole.nodes()[old]);
    }
    let renumbered = |node: u32| kept[node as usize];
    let mut wall: Vec<(FaceType, Vec<u32>)> =
        inner.into_values().filter(|(_, _, count)| *count == 1).map(|(of, nodes, _)| (of, nodes)).collect();
    wall.sort();
    let is_floor = |nodes: &[u32]| nodes.iter().all(|&node| whole.nodes()[node as usize][2] == 1.0);
    let part = |floor: bool| {
        let faces: Faces =
            wall.iter().filter(|(_, n)| is_floor(n) == floor).map(|(of, n)| (*of, n.as_slice())).collect();
        faces.map(renumbered)
    };
    let mut surfaces: Vec<Surface> = whole
        .surfaces()
        .iter()
        .map(|surface| Surface { name: surface.name.clone(), faces: surface.faces.map(renumbered) })
        .collect();
    surfaces.push(Surface { name: "floor".into(), faces: part(true) });
    surfaces.push(Surface { name: "walls".into(), faces: part(false) });
    let regions = vec![0; elements.len()];
    Mesh::new(nodes, elements.map(renumbered), regions, vec!["body".into()], surfaces).unwrap()
}
