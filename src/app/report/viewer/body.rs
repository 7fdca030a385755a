//! The body as the page draws it: triangles of its surface, lines of its mesh, and the tetrahedra inside of a small body.

use std::collections::HashMap;

use super::decimate;
use crate::app::report::skin::BoundaryMesh;
use crate::app::results::Fields;
use crate::fem::element::ElementType;

/// Most triangles of the surface; a finer one is reduced.
const MOST_TRIANGLES: usize = 60_000;
/// Most tetrahedra inside of the body that the page holds, for cuts.
const MOST_TETRAHEDRA: usize = 60_000;

/// The parts of the body that the page draws. A vertex is a node as a part of one region, so that a value at a node of an
/// interface is averaged over the elements of each side alone.
#[derive(Clone, Debug, Default)]
pub(super) struct Body {
    /// The node of each vertex.
    pub nodes: Vec<u32>,
    /// The elements around each vertex: of vertex `v` those from `offsets[v]` to `offsets[v + 1]`.
    around: Vec<u32>,
    offsets: Vec<usize>,
    /// The three vertices of each triangle of the surface, counterclockwise when seen from outside.
    pub triangles: Vec<[u32; 3]>,
    /// The place in `elements` of the element behind each triangle.
    pub behind: Vec<u32>,
    /// The elements that the page knows.
    pub elements: Vec<u32>,
    /// The edges of the triangles: two vertices and the triangles on both sides. Those of the mesh come first; those
    /// after them divide faces into triangles.
    pub edges: Vec<[u32; 4]>,
    /// Number of edges that are lines of the mesh.
    pub mesh_edges: usize,
    /// The vertices of the tetrahedra inside, and the place in `elements` of the element of each; without any, cuts show
    /// the surface from inside.
    pub tetrahedra: Vec<([u32; 4], u32)>,
    /// The number of triangles before the surface was reduced, if it was.
    pub reduced_from: Option<usize>,
}

/// A surface in nodes: triangles, the element behind each, and whether the side after each corner is a line of the mesh.
#[derive(Clone, Debug, Default)]
pub(super) struct Surface {
    pub triangles: Vec<[u32; 3]>,
    pub behind: Vec<u32>,
    pub lines: Vec<[bool; 3]>,
}

impl Body {
    /// Collects the parts of a body.
    pub fn of(fields: &Fields) -> Self {
        Self::within(fields, MOST_TRIANGLES, MOST_TETRAHEDRA)
    }

    fn within(fields: &Fields, most_triangles: usize, most_tetrahedra: usize) -> Self {
        let mut surface = Surface::of(&BoundaryMesh::of(&fields.elements));
        let count: usize = fields.elements.typed().map(|(element_type, _)| divided(element_type).len()).sum();
        let has_inside = count <= most_tetrahedra;
        let mut body = Self::default();
        if surface.triangles.len() > most_triangles {
            body.reduced_from = Some(surface.triangles.len());
            surface = decimate::reduce(&surface, &fields.points, most_triangles);
        }
        let region = fields.cell_integer("region");
        let region = |element: u32| region.and_then(|all| all.get(element as usize).copied()).unwrap_or(0);

        let mut elements = surface.behind.clone();
        if has_inside {
            elements.extend(0..fields.elements.len() as u32);
        }
        elements.sort_unstable();
        elements.dedup();
        let place = |element: u32| elements.binary_search(&element).unwrap_or(0) as u32;

        let mut vertices: HashMap<(u32, i64), u32> = HashMap::new();
        let nodes = &mut body.nodes;
        let mut vertex = |node: u32, element: u32| {
            *vertices.entry((node, region(element))).or_insert_with(|| {
                nodes.push(node);
                nodes.len() as u32 - 1
            })
        };
        for (triangle, &element) in surface.triangles.iter().zip(&surface.behind) {
            body.triangles.push(triangle.map(|node| vertex(node, element)));
            body.behind.push(place(element));
        }
        if has_inside {
            for (element, (element_type, nodes)) in (0..).zip(fields.elements.typed()) {
                let corners = divided(element_type).iter();
                body.tetrahedra.extend(
                    corners.map(|corners| (corners.map(|corner| vertex(nodes[corner], element)), place(element))),
                );
            }
        }
        body.connect(fields, &vertices, region);
        body.find_edges(&surface);
        body.elements = elements;
        body
    }

    /// Finds the elements around each vertex.
    fn connect(&mut self, fields: &Fields, vertices: &HashMap<(u32, i64), u32>, region: impl Fn(u32) -> i64) {
        let mut pairs: Vec<(u32, u32)> = Vec::new();
        for (element, nodes) in (0..).zip(fields.elements.iter()) {
            let region = region(element);
            let met = nodes.iter().filter_map(|&node| vertices.get(&(node, region)));
            pairs.extend(met.map(|&vertex| (vertex, element)));
        }
        pairs.sort_unstable();
        self.offsets =
            (0..=self.nodes.len()).map(|v| pairs.partition_point(|&(vertex, _)| (vertex as usize) < v)).collect();
        self.around = pairs.into_iter().map(|(_, element)| element).collect();
    }

    /// Finds the edges of the triangles, through their nodes: the vertices differ where regions meet.
    fn find_edges(&mut self, surface: &Surface) {
        let mut met: HashMap<[u32; 2], usize> = HashMap::new();
        let mut edges: Vec<([u32; 4], bool)> = Vec::new();
        for (number, (triangle, lines)) in (0..).zip(surface.triangles.iter().zip(&surface.lines)) {
            for k in 0..3 {
                let ends = [triangle[k], triangle[(k + 1) % 3]];
                let key = [ends[0].min(ends[1]), ends[0].max(ends[1])];
                match met.remove(&key) {
                    Some(edge) => {
                        edges[edge].0[3] = number;
                        edges[edge].1 |= lines[k];
                    }
                    None => {
                        met.insert(key, edges.len());
                        let of = &self.triangles[number as usize];
                        edges.push(([of[k], of[(k + 1) % 3], number, number], lines[k]));
                    }
                }
            }
        }
        edges.sort_by_key(|(_, is_line)| !is_line);
        self.mesh_edges = edges.iter().filter(|(_, is_line)| *is_line).count();
        self.edges = edges.into_iter().map(|(edge, _)| edge).collect();
    }

    /// Returns the mean of the values of the elements around each vertex; elements without a value (NaN) do not count.
    pub fn averages(&self, of_elements: &[f64]) -> Vec<f64> {
        let mean = |around: &[u32]| {
            let values = around.iter().filter_map(|&element| of_elements.get(element as usize));
            let [sum, count] = (values.filter(|value| !value.is_nan()))
                .fold([0.0, 0.0], |[sum, count], value| [sum + value, count + 1.0]);
            sum / count
        };
        self.offsets.windows(2).map(|ends| mean(&self.around[ends[0]..ends[1]])).collect()
    }
}

impl Surface {
    /// Divides the faces of a boundary into triangles.
    fn of(skin: &BoundaryMesh) -> Self {
        let mut surface = Self::default();
        for face in &skin.faces {
            let points = &face.points;
            let mut add = |corners: [usize; 3], lines: [bool; 3]| {
                surface.triangles.push(corners.map(|k| points[k]));
                surface.behind.push(face.element as u32);
                surface.lines.push(lines);
            };
            let count = points.len();
            // A face of order 2 has a node between any two corners: its corners are cut off first.
            let ring: Vec<usize> = if count >= 6 {
                (0..count).step_by(2).for_each(|k| add([(k + count - 1) % count, k, k + 1], [true, true, false]));
                (1..count).step_by(2).collect()
            } else {
                (0..count).collect()
            };
            let is_line = count < 6;
            for k in 1..ring.len() - 1 {
                let lines = [is_line && k == 1, is_line, is_line && k + 2 == ring.len()];
                add([ring[0], ring[k], ring[k + 1]], lines);
            }
        }
        surface
    }
}

/// Returns the tetrahedra of corners into which an element is divided.
fn divided(element_type: ElementType) -> &'static [[usize; 4]] {
    match element_type {
        ElementType::Tet4 | ElementType::Tet10 => &[[0, 1, 2, 3]],
        ElementType::Wedge6 => &[[0, 1, 2, 5], [0, 1, 5, 4], [0, 4, 5, 3]],
        ElementType::Hex8 | ElementType::Hex20 | ElementType::Hex27 => {
            &[[0, 1, 2, 6], [0, 2, 3, 6], [0, 3, 7, 6], [0, 7, 4, 6], [0, 4, 5, 6], [0, 5, 1, 6]]
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::fem::mesh::Elements;

    /// Returns a row of `n` cubes of six tetrahedra each, the first half of region 1 and the rest of region 2.
    fn row(n: u32) -> Fields {
        let points = (0..4 * (n + 1)).map(|k| [f64::from(k / 4), f64::from(k & 1), f64::from(k >> 1 & 1)]).collect();
        let mut elements = Vec::new();
        for cube in 0..n {
            let corner = |c: u32| 4 * (cube + (c & 1)) + (c >> 1);
            for tet in [[0, 1, 3, 7], [0, 3, 2, 7], [0, 2, 6, 7], [0, 6, 4, 7], [0, 4, 5, 7], [0, 5, 1, 7]] {
                elements.push(tet.map(corner));
            }
        }
        let region = (0..6 * i64::from(n)).map(|element| 1 + element / 6 / i64::from(n.div_ceil(2))).collect();
        Fields {
            points,
            elements: elements.into(),
            cell_integers: vec![("region".into(), region)],
            ..Fields::default()
        }
    }

    #[test]
    fn values_are_averaged_within_regions() {
        let fields = row(2);
        let body = Body::of(&fields);
        assert_eq!((body.triangles.len(), body.tetrahedra.len(), body.elements.len()), (20, 12, 12));
        // The four nodes between the cubes are vertices of both regions.
        assert_eq!(body.nodes.len(), 12 + 4);
        let region: Vec<f64> = fields.cell_integers[0].1.iter().map(|&region| region as f64).collect();
        assert!(body.averages(&region).iter().all(|&value| value == 1.0 || value == 2.0));
        let first: Vec<f64> = (0..12).map(|element| if element == 0 { 1.0 } else { 0.0 }).collect();
        let of_tet: Vec<f64> = body.averages(&first).into_iter().filter(|&value| value > 0.0).collect();
        assert_eq!(of_tet.len(), 4);
        // Only the first element has a value, and only its vertices have a mean.
        let alone: Vec<f64> = first.iter().map(|&value| if value == 0.0 { f64::NAN } else { 3.0 }).collect();
        let of_tet = body.averages(&alone);
        assert_eq!(of_tet.iter().filter(|&&value| value == 3.0).count(), 4);
        assert_eq!(of_tet.iter().filter(|value| value.is_nan()).count(), body.nodes.len() - 4);
        assert_eq!(body.edges.len(), 30, "every edge has two sides");
        assert!(body.edges.iter().all(|edge| edge[2] != edge[3]) && body.mesh_edges == 30);
    }

    #[test]
    fn a_fine_surface_is_reduced_and_has_no_inside() {
        // A cube of 12 hexahedra along each edge.
        let points: Vec<[f64; 3]> = (0..13 * 13 * 13).map(|k| [k % 13, k / 13 % 13, k / 169].map(f64::from)).collect();
        let mut elements = Elements::default();
        for k in 0..12 * 12 * 12 {
            let first = k % 12 + 13 * (k / 12 % 12) + 169 * (k / 144);
            let nodes = [0, 1, 14, 13, 169, 170, 183, 182].map(|offset| first + offset);
            elements.push(ElementType::Hex8, &nodes);
        }
        let fields = Fields { points: points.clone(), elements, ..Fields::default() };
        let body = Body::within(&fields, 500, 10);
        assert_eq!(body.reduced_from, Some(6 * 2 * 144));
        assert!(body.tetrahedra.is_empty() && (100..=500).contains(&body.triangles.len()), "{}", body.triangles.len());
        assert!(body.triangles.len() == body.behind.len() && body.averages(&[2.0; 1728]).iter().all(|&x| x == 2.0));
        // The reduced surface is nearly that of the cube, and closed.
        let at = |vertex: u32| Vector3::from(points[body.nodes[vertex as usize] as usize]);
        let volume = |t: &[u32; 3]| at(t[0]).dot(&at(t[1]).cross(&at(t[2]))) / 6.0;
        let volume: f64 = body.triangles.iter().map(volume).sum();
        assert!((volume / 1728.0 - 1.0).abs() < 0.2, "{volume}");
        assert!(body.edges.iter().all(|edge| edge[2] != edge[3]));
    }

    #[test]
    fn faces_of_all_types_become_triangles_that_cover_them() {
        for element_type in ElementType::ALL {
            let points: Vec<[f64; 3]> = element_type.reference_nodes();
            let mut elements = Elements::default();
            elements.push(element_type, &(0..points.len() as u32).collect::<Vec<_>>());
            let body = Body::of(&Fields { points: points.clone(), elements, ..Fields::default() });
            let at = |vertex: u32| Vector3::from(points[body.nodes[vertex as usize] as usize]);
            // Twice the sum of the areas as vectors is zero for a closed surface; the volume follows from them.
            let areas = body.triangles.iter().map(|t| (at(t[1]) - at(t[0])).cross(&(at(t[2]) - at(t[0]))));
            assert!(areas.sum::<Vector3<f64>>().norm() < 1e-12, "{element_type:?}");
            let volume = |[a, b, c]: [Vector3<f64>; 3]| a.dot(&b.cross(&c)) / 6.0;
            let outside: f64 = body.triangles.iter().map(|t| volume(t.map(at))).sum();
            let inside: f64 =
                body.tetrahedra.iter().map(|(t, _)| volume([1, 2, 3].map(|k| at(t[k]) - at(t[0]))).abs()).sum();
            assert!((outside - inside).abs() < 1e-12 && inside > 0.0, "{element_type:?}: {outside} {inside}");
            let lines = element_type.edges().len() * if element_type.is_quadratic() { 2 } else { 1 };
            assert_eq!(body.mesh_edges, lines, "{element_type:?}");
        }
    }
}
