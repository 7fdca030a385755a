//! The start of a solution: the state moved with the deformation gradient, plus the first-order prediction.

use nalgebra::Matrix3;

use super::arrays::Arrays;
use super::blocks::Node;
use super::network::Network;
use super::pause::Paused;
use super::simd::{Double, Kernel, Lanes, MOST_LANES, load, numbers_of_mut, store};
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

impl LaneStart<'_> {
    /// Returns true if the interior moves from the state to the start.
    fn moves(&self) -> bool {
        self.gradient != self.target
    }
}

/// How the interior moves from the state to the start: by a deformation gradient and, if it is predicted, by six strains
/// and a rotation after them.
struct Increment {
    gradient: Matrix3<f64>,
    rotation: Matrix3<f64>,
    strains: [f64; MODES],
}

impl Increment {
    /// An increment without any motion.
    fn none() -> Self {
        Self { gradient: Matrix3::identity(), rotation: Matrix3::zeros(), strains: [0.0; MODES] }
    }

    fn new(start: &LaneStart<'_>) -> Self {
        if !start.moves() {
            return Self::none();
        }
        let (from, to) = (Matrix3::from_row_slice(&start.gradient), Matrix3::from_row_slice(&start.target));
        let not_invertible = Matrix3::from_element(f64::NAN);
        let gradient = to * from.try_inverse().unwrap_or(not_invertible);
        if start.sensitivities.is_none() {
            return Self { gradient, ..Self::none() };
        }
        let rotation = rotation_of(gradient);
        let u = rotation.transpose() * gradient;
        let strains = [u[(0, 0)] - 1.0, u[(1, 1)] - 1.0, u[(2, 2)] - 1.0, u[(1, 2)], u[(0, 2)], u[(0, 1)]];
        Self { gradient, rotation, strains }
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

/// Writes the positions of networks at their starts, or where they paused; lanes without a network are copies of the
/// first one.
pub(super) fn write_starts<S: Double>(
    simd: S,
    network: &Network,
    starts: &[LaneStart<'_>],
    arrays: &mut Arrays<'_, S>,
) {
    let Some(first) = starts.first() else { return };
    let starts: [&LaneStart<'_>; MOST_LANES] = std::array::from_fn(|lane| starts.get(lane).unwrap_or(first));
    let starts = &starts[..S::LANES];
    simd.vectorize(WriteInterior { network, starts, positions: arrays.positions });
    for (lane, start) in starts.iter().enumerate() {
        if let Some(paused) = start.paused {
            paused.write(arrays, lane);
        }
    }
    let targets = std::array::from_fn(|k| by_lane(starts, |start| start.target[k]));
    simd.vectorize(WriteBoundary { network, targets: &targets, positions: arrays.positions });
}

/// Returns a number of each lane.
fn by_lane<T>(of_lanes: &[T], number: impl Fn(&T) -> f64) -> [f64; MOST_LANES] {
    std::array::from_fn(|lane| of_lanes.get(lane).map_or(0.0, &number))
}

/// Moves the interior nodes from the states of the lanes to their starts.
struct WriteInterior<'a, S: Double> {
    network: &'a Network,
    starts: &'a [&'a LaneStart<'a>],
    positions: &'a mut [S::Stored],
}

impl<S: Double> Kernel<S> for WriteInterior<'_, S> {
    type Output = ();

    #[inline(always)]
    fn run(self, simd: S) {
        let Self { network, starts, positions } = self;
        let increments: Vec<Increment> = starts.iter().map(|start| Increment::new(start)).collect();
        let sensitivities_of: Vec<_> =
            starts.iter().map(|start| start.sensitivities.filter(|_| start.moves())).collect();
        let (mut gradient, mut rotation) = ([Lanes::splat(simd, 0.0); 9], [Lanes::splat(simd, 0.0); 9]);
        for k in 0..9 {
            let entry = (k / 3, k % 3);
            gradient[k] = Lanes::of_numbers(simd, &by_lane(&increments, |increment| increment.gradient[entry]));
            rotation[k] = Lanes::of_numbers(simd, &by_lane(&increments, |increment| increment.rotation[entry]));
        }
        let mut strains = [Lanes::splat(simd, 0.0); MODES];
        for k in 0..MODES {
            strains[k] = Lanes::of_numbers(simd, &by_lane(&increments, |increment| increment.strains[k]));
        }
        // The numbers of a node in all lanes: the position, and the sensitivities.
        let mut state = [<S::Stored as bytemuck::Zeroable>::zeroed(); 3];
        let mut sensitivities = [<S::Stored as bytemuck::Zeroable>::zeroed(); 3 * MODES];
        for (node, &place) in network.places.iter().enumerate() {
            for (lane, start) in starts.iter().enumerate() {
                write_lane::<S>(&start.positions[node], &mut state, lane);
                if let Some(of_lane) = sensitivities_of[lane] {
                    write_lane::<S>(&of_lane[node], &mut sensitivities, lane);
                }
            }
            let x: Node<S> = load(simd, &state, 0);
            let mut correction: Node<S> = [Lanes::splat(simd, 0.0); 3];
            for mode in 0..MODES {
                let v: Node<S> = load(simd, &sensitivities, mode);
                for i in 0..3 {
                    correction[i] = strains[mode].mul_add(v[i], correction[i]);
                }
            }
            let mut moved = x;
            for p in 0..3 {
                moved[p] = row_times(&gradient, p, &x) + row_times(&rotation, p, &correction);
            }
            store(&moved, positions, place as usize);
        }
    }
}

/// Writes numbers into a lane.
#[inline(always)]
fn write_lane<S: Double>(from: &[impl Copy + Into<f64>], to: &mut [S::Stored], lane: usize) {
    let to = numbers_of_mut::<S>(to);
    for (k, &number) in from.iter().enumerate() {
        to[k * S::LANES + lane] = number.into();
    }
}

/// The product of the row `p` of matrices, given row by row, with vectors.
#[inline(always)]
fn row_times<S: Double>(matrix: &[Lanes<S>; 9], p: usize, x: &Node<S>) -> Lanes<S> {
    matrix[3 * p].mul_add(x[0], matrix[3 * p + 1].mul_add(x[1], matrix[3 * p + 2] * x[2]))
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
