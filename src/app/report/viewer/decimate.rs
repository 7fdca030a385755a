//! Reduction of a fine surface by vertex clustering (Rossignac and Borrel, 1993): the nodes in each cell of a grid become
//! one, and triangles whose corners are no longer three different nodes disappear.

use std::collections::HashMap;

use super::body::Surface;

/// Reduces a surface to at most `most` triangles.
pub(super) fn reduce(surface: &Surface, points: &[[f64; 3]], most: usize) -> Surface {
    // The number of triangles grows with the number of cells along the longest edge, nearly without exception.
    let (mut coarse, mut fine) = (1, 4096);
    let mut best = clustered(surface, points, coarse);
    while fine - coarse > 1 {
        let middle = (coarse + fine) / 2;
        let reduced = clustered(surface, points, middle);
        if reduced.triangles.len() <= most {
            (coarse, best) = (middle, reduced);
        } else {
            fine = middle;
        }
    }
    best
}

/// Unites the nodes in each cell of a grid with this number of cells along the longest edge of the body. The nodes in a
/// cell become that nearest to their center, so that values and displacements of the surface are those of nodes.
fn clustered(surface: &Surface, points: &[[f64; 3]], cells: usize) -> Surface {
    let corners = || surface.triangles.iter().flatten().map(|&node| points[node as usize]);
    let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for point in corners() {
        (low, high) = (std::array::from_fn(|k| low[k].min(point[k])), std::array::from_fn(|k| high[k].max(point[k])));
    }
    let longest = (0..3).map(|k| high[k] - low[k]).fold(f64::MIN_POSITIVE, f64::max);
    let cell = |point: [f64; 3]| -> [u32; 3] {
        std::array::from_fn(|k| ((point[k] - low[k]) / longest * cells as f64 + 0.5) as u32)
    };
    let mut centers: HashMap<[u32; 3], ([f64; 3], f64)> = HashMap::new();
    for point in corners() {
        let (sum, count) = centers.entry(cell(point)).or_default();
        (0..3).for_each(|k| sum[k] += point[k]);
        *count += 1.0;
    }
    let mut nearest: HashMap<[u32; 3], (f64, u32)> = HashMap::new();
    for &node in surface.triangles.iter().flatten() {
        let point = points[node as usize];
        let (sum, count) = centers.get(&cell(point)).copied().unwrap_or_default();
        let distance = (0..3).map(|k| (sum[k] / count - point[k]).powi(2)).sum();
        let own = nearest.entry(cell(point)).or_insert((distance, node));
        if (distance, node) < *own {
            *own = (distance, node);
        }
    }
    let united = |node: u32| nearest.get(&cell(points[node as usize])).map_or(node, |&(_, node)| node);

    let mut reduced = Surface::default();
    let mut met: HashMap<[u32; 3], ()> = HashMap::new();
    for (triangle, &element) in surface.triangles.iter().zip(&surface.behind) {
        let triangle = triangle.map(united);
        let [a, b, c] = triangle;
        let mut key = triangle;
        key.sort_unstable();
        if a != b && b != c && a != c && met.insert(key, ()).is_none() {
            reduced.triangles.push(triangle);
            reduced.behind.push(element);
            reduced.lines.push([true; 3]);
        }
    }
    reduced
}
