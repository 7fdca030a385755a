//! Panels against factorizations without them.

use super::*;
use crate::backends::networks::lanes::portable::Portable;
use crate::backends::networks::lanes::simd::{numbers_of, numbers_of_mut};
use crate::backends::networks::{PanelShape, TileShape};
use crate::las::conformance::Random;

/// Returns the factor of a diagonally dominant matrix, the solution of `L y = b`, and the ratio of the pivots.
fn factor<O: OffDiagonal, const C: usize>(nodes: usize, edges: &[[u32; 2]], least: usize) -> Vec<f64> {
    const PER_EDGE: usize = 9;
    let panels = Some(PanelShape { tiles: 3, depth: 2, least });
    let schedule = Schedule::new(nodes, edges, TileShape { columns: C, rows: 1, panels });
    let mut random = Random::new(7);
    let mut numbers = |count: usize, base: [f64; 6]| {
        let mut array = vec![bytemuck::Zeroable::zeroed(); count];
        for (at, number) in numbers_of_mut::<Portable>(&mut array).iter_mut().enumerate() {
            *number = base[at / Portable::LANES % 6] + random.signed();
        }
        array
    };
    let most = edges.len() as f64;
    let matrix_diagonal = numbers(6 * nodes, [most, 0.0, most, 0.0, 0.0, most].map(|entry| 3.0 * entry));
    let off_diagonal = numbers(PER_EDGE * edges.len(), [0.0; 6]);
    let (mut diagonal, mut right) = (numbers(6 * nodes, [0.0; 6]), numbers(3 * nodes, [0.0; 6]));
    let mut lower = numbers(9 * (schedule.blocks() + 1), [0.0; 6]);
    let pivots = Portable.vectorize(Factor::<Portable, O, C> {
        schedule: &schedule,
        matrix_diagonal: &matrix_diagonal,
        off_diagonal: &off_diagonal,
        diagonal: &mut diagonal,
        lower: &mut lower,
        right: &mut right,
        stored: PhantomData,
    });
    let all = [diagonal, lower, right];
    let mut all: Vec<f64> = all.iter().flat_map(|array| numbers_of::<Portable>(array).to_vec()).collect();
    all.extend(pivots.smallest.numbers().iter().chain(&pivots.positive.numbers()));
    all
}

/// Panels, also with tiles that are not full, change no bit.
#[test]
fn panels_do_not_change_the_factor() {
    let mut random = Random::new(2);
    let nodes = 40;
    let mut node = || ((random.signed().abs() * nodes as f64) as u32).min(nodes as u32 - 1);
    let mut edges: Vec<[u32; 2]> = (0..80).map(|_| [node(), node()]).filter(|[a, b]| a != b).collect();
    edges.iter_mut().for_each(|edge| edge.sort_unstable());
    edges.sort_unstable();
    edges.dedup();
    for least in [1, 4, 12] {
        let with_panels = Schedule::new(
            nodes,
            &edges,
            TileShape { columns: 2, rows: 1, panels: Some(PanelShape { tiles: 3, depth: 2, least }) },
        );
        assert!(with_panels.updates.len() > 2 * with_panels.panels, "no panel is updated");
        let none = usize::MAX;
        assert_eq!(
            factor::<NegatedSymmetric, 1>(nodes, &edges, least),
            factor::<NegatedSymmetric, 1>(nodes, &edges, none)
        );
        assert_eq!(
            factor::<NegatedSymmetric, 2>(nodes, &edges, least),
            factor::<NegatedSymmetric, 2>(nodes, &edges, none)
        );
        #[cfg(feature = "batched")]
        assert_eq!(factor::<Full, 2>(nodes, &edges, least), factor::<Full, 2>(nodes, &edges, none));
    }
}
