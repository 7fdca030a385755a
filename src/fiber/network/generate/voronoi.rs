//! Voronoi networks: the edges of the Voronoi cells of the points, four of which meet at every vertex.
//!
//! A vertex is the center of an empty sphere through four points, and an edge belongs to the three points whose cells
//! meet along it. The library determines these points in exact arithmetic; the positions are computed here, from the
//! four points in ascending order, so that they do not depend on the cell from which a vertex is reached.

use glam::DVec3;
use meshless_voronoi::{Dimensionality, VoronoiIntegrator};
use nalgebra::Vector3;

use super::clip::Graph;
use super::cloud::{Cloud, MARGIN};
use super::delaunay::walls;

/// The three points of an edge and the four points of the vertex at one of its ends, both ascending.
type End = ([u32; 3], [u32; 4]);

/// Creates the graph of all edges with an end in the cube; its nodes are the vertices of these edges, those in the cube
/// first.
pub(super) fn graph(cloud: &Cloud) -> Graph {
    let ends = ends(cloud);
    // The two ends of an edge are adjacent in the list. An edge with a single end leaves the cloud.
    let pairs = ends.windows(2).filter(|pair| pair[0].0 == pair[1].0).map(|pair| [pair[0].1, pair[1].1]);
    let mut vertices: Vec<([u32; 4], [f64; 3], bool)> = Vec::new();
    let mut edges: Vec<[[u32; 4]; 2]> = Vec::new();
    for pair in pairs {
        let both = pair.map(|vertex| {
            let place = cloud.stretch.to_cube(circumcenter(vertex.map(|point| cloud.points[point as usize])));
            (vertex, place, place.iter().all(|x| x.abs() < 0.5))
        });
        if both.iter().any(|&(.., inside)| inside) {
            vertices.extend(both);
            edges.push(pair);
        }
    }
    vertices.sort_unstable_by(|a, b| b.2.cmp(&a.2).then(a.0.cmp(&b.0)));
    vertices.dedup_by_key(|vertex| vertex.0);
    let mut numbers: Vec<([u32; 4], usize)> = vertices.iter().enumerate().map(|(k, vertex)| (vertex.0, k)).collect();
    numbers.sort_unstable();
    let number = |vertex: &[u32; 4]| {
        let at = numbers.binary_search_by_key(vertex, |entry| entry.0).unwrap_or_else(|next| next);
        numbers[at].1
    };
    let mut edges: Vec<[usize; 2]> =
        edges.iter().map(|[a, b]| (number(a), number(b))).map(|(a, b)| [a.min(b), a.max(b)]).collect();
    edges.sort_unstable();
    let inner = vertices.iter().take_while(|vertex| vertex.2).count();
    Graph { places: vertices.into_iter().map(|vertex| vertex.1).collect(), inner, edges }
}

/// Returns the ends of all edges of cells in and near the cube, ascending.
fn ends(cloud: &Cloud) -> Vec<End> {
    let generators: Vec<DVec3> = cloud.points.iter().map(|&point| DVec3::from_array(point)).collect();
    // Cells farther away have no vertex in the cube: a ball of this radius around the vertex would have to be empty.
    let mask: Vec<bool> = (0..generators.len()).map(|point| cloud.outside(point) < 0.7 * MARGIN).collect();
    let (corner, width) = walls(&cloud.points);
    let cells = VoronoiIntegrator::build(&generators, Some(&mask), corner, width, Dimensionality::ThreeD, false);
    let mut ends: Vec<End> = Vec::new();
    for cell in cells.cells_iter() {
        for vertex in &cell.vertices {
            let neighbors = vertex.dual.map(|plane| cell.clipping_planes[plane].right_idx);
            let [Some(a), Some(b), Some(c)] = neighbors else { continue };
            let mut four = [cell.idx as u32, a as u32, b as u32, c as u32];
            four.sort_unstable();
            for [p, q] in [[a, b], [b, c], [c, a]] {
                // Each edge is visited in one of its three cells only.
                if [p, q].iter().all(|&other| cell.idx < other || !mask[other]) {
                    let mut three = [cell.idx as u32, p as u32, q as u32];
                    three.sort_unstable();
                    ends.push((three, four));
                }
            }
        }
    }
    ends.sort_unstable();
    ends.dedup();
    ends
}

/// Returns the center of the sphere through four points, by Cramer's rule.
pub(super) fn circumcenter(p: [[f64; 3]; 4]) -> [f64; 3] {
    let p = p.map(Vector3::<f64>::from);
    let d = [p[1] - p[0], p[2] - p[0], p[3] - p[0]];
    let normals = [d[1].cross(&d[2]), d[2].cross(&d[0]), d[0].cross(&d[1])];
    let twice = 2.0 * d[0].dot(&normals[0]);
    let sum = normals[0] * d[0].dot(&d[0]) + normals[1] * d[1].dot(&d[1]) + normals[2] * d[2].dot(&d[2]);
    (p[0] + sum / twice).into()
}
