//! The start of a solution: the state moved with the deformation gradient, plus the first-order prediction.

use nalgebra::{Matrix3, Vector3};

use super::arrays::Arrays;
use super::network::Network;
use super::pause::Paused;
use super::simd::{Double, Kernel, Lanes, MOST_LANES, numbers_of_mut, store};
use crate::backends::networks::MODES;

/// The state of a network, and the deformation gradient to reach.
#[derive(Clone, Copy, Debug)]
pub struct LaneStart<'a> {
    /// The deformation gradient of the state, row by row.
    pub gradient: [f64; 9],
    /// The deformation gradient to reach, row by row.
    pub target: [f64; 9],
    /// The positions of the interior nodes.
    pub positions: &'a [[f64; 3]],
    /// Eighteen numbers for each interior node, if the start is to be predicted: the sensitivities of its position to the
    /// six unit strains, minus those of the affine motion.
    pub sensitivities: Option<&'a [[f32; 3 * MODES]]>,
    /// Where the solution paused, if it goes on. The target must then be that of before; the state does not matter.
    pub paused: Option<&'a Paused>,
}

/// How the interior moves from the state to the start.
struct Increment {
    gradient: Matrix3<f64>,
    /// The rotation, and the six strains after which it comes.
    predicted: Option<(Matrix3<f64>, [f64; MODES])>,
}

impl Increment {
    /// Returns `None` if the interior does not move.
    fn new(start: &LaneStart<'_>) -> Option<Self> {
        if start.gradient == start.target {
            return None;
        }
        let (from, to) = (Matrix3::from_row_slice(&start.gradient), Matrix3::from_row_slice(&start.target));
        let not_invertible = Matrix3::from_element(f64::NAN);
        let gradient = to * from.try_inverse().unwrap_or(not_invertible);
        let predicted = start.sensitivities.map(|_| {
            let rotation = rotation_of(gradient);
            let u = rotation.transpose() * gradient;
            (rotation, [u[(0, 0)] - 1.0, u[(1, 1)] - 1.0, u[(2, 2)] - 1.0, u[(1, 2)], u[(0, 2)], u[(0, 1)]])
        });
        Some(Self { gradient, predicted })
    }
}

/// The rotation of the polar decomposition, by Newton's iteration for the matrix sign (Higham 1986).
fn rotation_of(mut matrix: Matrix3<f64>) -> Matrix3<f64> {
    for _ in 0..12 {
        let Some(inverse) = matrix.try_inverse() else { break };
        let next = 0.5 * (matrix + inverse.transpose());
        let change = (next - matrix).amax();
        matrix = next;
        let goes_on = change > 1e-15;
        if !goes_on {
            break;
        }
    }
    matrix
}

/// Writes the positions of networks at their starts, or where they paused; lanes without a network are copies of the first one.
pub(super) fn write_starts<S: Double>(
    simd: S,
    network: &Network,
    starts: &[LaneStart<'_>],
    arrays: &mut Arrays<'_, S>,
) {
    let mut targets = [[0.0; MOST_LANES]; 9];
    for lane in 0..S::LANES {
        let Some(start) = starts.get(lane).or(starts.first()) else { return };
        targets.iter_mut().zip(start.target).for_each(|(of_lanes, entry)| of_lanes[lane] = entry);
        match start.paused {
            Some(paused) => paused.write(arrays, lane),
            None => write_interior::<S>(network, start, lane, arrays.positions),
        }
    }
    simd.vectorize(WriteBoundary { network, targets: &targets, positions: arrays.positions });
}

/// Writes the positions of the interior nodes of a network at its start into a lane.
fn write_interior<S: Double>(network: &Network, start: &LaneStart<'_>, lane: usize, positions: &mut [S::Stored]) {
    let increment = Increment::new(start);
    let numbers = numbers_of_mut::<S>(positions);
    let mut write = |node: usize, x: Vector3<f64>| {
        for k in 0..3 {
            numbers[(3 * node + k) * S::LANES + lane] = x[k];
        }
    };
    for (place, &node) in network.order.iter().enumerate() {
        let x = Vector3::from(start.positions[node as usize]);
        let Some(Increment { gradient, predicted }) = &increment else {
            write(place, x);
            continue;
        };
        let mut moved = gradient * x;
        if let (Some((rotation, strains)), Some(sensitivities)) = (predicted, start.sensitivities) {
            let of_node = &sensitivities[node as usize];
            let correction = Vector3::from_fn(|i, _| {
                strains.iter().enumerate().map(|(k, strain)| strain * f64::from(of_node[3 * k + i])).sum()
            });
            moved += rotation * correction;
        }
        write(place, moved);
    }
}

/// Moves the boundary nodes from rest by the deformation gradients of the lanes, given row by row.
struct WriteBoundary<'a, S: Double> {
    network: &'a Network,
    targets: &'a [[f64; MOST_LANES]; 9],
    positions: &'a mut [S::Stored],
}

impl<S: Double> Kernel<S> for WriteBoundary<'_, S> {
    type Output = ();

    #[inline(always)]
    fn run(self, simd: S) {
        let mut target = [Lanes::splat(simd, 0.0); 9];
        for k in 0..9 {
            target[k] = Lanes::of_numbers(simd, &self.targets[k]);
        }
        for (rest, node) in self.network.boundary.iter().zip(self.network.interior..) {
            let mut x = [Lanes::splat(simd, 0.0); 3];
            for p in 0..3 {
                x[p] = target[3 * p] * rest[0] + target[3 * p + 1] * rest[1] + target[3 * p + 2] * rest[2];
            }
            store(&x, self.positions, node);
        }
    }
}
