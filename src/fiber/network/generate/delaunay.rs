//! Delaunay networks: the edges of the Delaunay triangulation of the points.

use glam::DVec3;
use meshless_voronoi::{Dimensionality, Voronoi};

use super::clip::Graph;
use super::cloud::Cloud;

/// Creates the graph whose nodes are the points of the cloud, those in the cube first.
pub(super) fn graph(cloud: &Cloud) -> Graph {
    Graph { places: cloud.places.clone(), inner: cloud.inner, edges: edges(&cloud.points, cloud.inner) }
}

/// Returns the Delaunay edges, ascending, with an end among the first `inner` points: an edge joins two points whose
/// Voronoi cells share a face.
pub(super) fn edges(points: &[[f64; 3]], inner: usize) -> Vec<[usize; 2]> {
    let generators: Vec<DVec3> = points.iter().map(|&point| DVec3::from_array(point)).collect();
    let mask: Vec<bool> = (0..points.len()).map(|point| point < inner).collect();
    let (corner, width) = walls(points);
    let cells = Voronoi::build_partial(&generators, &mask, corner, width, Dimensionality::ThreeD, false);
    let mut edges: Vec<[usize; 2]> = cells
        .faces()
        .iter()
        .filter_map(|face| face.right().map(|right| [face.left().min(right), face.left().max(right)]))
        .collect();
    edges.sort_unstable();
    edges.dedup();
    edges
}

/// Returns the lower corner and the widths of a box so large that it does not cut the cell of any point in the cube.
pub(super) fn walls(points: &[[f64; 3]]) -> (DVec3, DVec3) {
    let reach = points.iter().flatten().fold(0.5, |m: f64, x| m.max(x.abs()));
    let wall = 10.0 * reach;
    (DVec3::splat(-wall), DVec3::splat(2.0 * wall))
}
