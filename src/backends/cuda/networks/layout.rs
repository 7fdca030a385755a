//! The data that the host and the kernels share.

use crate::backends::networks::TileShape;

/// What is the same for all networks of a batch: the structure `Uniform` of `kernels/base.cu`, whose comments say what the
/// addresses refer to. Addresses are those of the device, or of the host where the kernels are emulated.
#[derive(Clone, Copy, Debug, Default)]
#[repr(C)]
pub(super) struct Uniform {
    pub fiber_ends: u64,
    pub fiber_sizes: u64,
    pub fiber_laws: u64,
    pub laws: u64,
    pub boundary: u64,
    pub incidents: u64,
    pub factor: u64,
    pub forward: u64,
    pub backward: u64,
    pub order: u64,
    pub caller_gradients: u64,
    pub caller_positions: u64,
    pub caller_sensitivities: u64,
    pub caller_targets: u64,
    pub caller_reached: u64,
    pub caller_results: u64,
    pub gradients: u64,
    pub positions: u64,
    pub sensitivities: u64,
    pub has_sensitivities: u64,
    pub targets: u64,
    pub reached: u64,
    pub results: u64,
    pub trial: u64,
    pub direction: u64,
    pub stiffness: u64,
    pub edges: u64,
    pub diagonal: u64,
    pub lower: u64,
    pub modes: u64,
    pub networks: u64,
    pub first: u64,
    pub interior: u32,
    pub nodes: u32,
    pub fibers: u32,
    pub blocks: u32,
    pub pairs: u32,
    pub tiles: u32,
    pub inner_ends: u32,
    pub ends: u32,
    pub max_iterations: u32,
    pub max_backtracks: u32,
    pub memory: u32,
    pub wants_tangent: u32,
    pub tolerance: f64,
    pub floor: f64,
    pub sufficient_decrease: f64,
    pub excessive_force: f64,
}

// SAFETY: a structure of numbers without padding, which the kernels take by value.
unsafe impl cudarc::driver::DeviceRepr for Uniform {}

/// Networks in a tile, whose numbers alternate.
pub(super) const LANES: usize = 32;

/// Threads of a block of the device.
pub(super) const BLOCK_THREADS: usize = 128;

/// Numbers of a fiber.
pub(super) const FIBER_LEN: usize = 5;

/// Numbers of an end of a fiber.
pub(super) const INCIDENT_LEN: usize = 6;

/// The source of the kernels.
const SOURCE: &str = concat!(
    include_str!("kernels/base.cu"),
    include_str!("kernels/laws.cu"),
    include_str!("kernels/lane.cu"),
    include_str!("kernels/factor.cu"),
    include_str!("kernels/solve.cu"),
    include_str!("kernels/modes.cu"),
    include_str!("kernels/newton.cu"),
    include_str!("kernels/kernels.cu"),
);

/// The names of the kernels.
pub(super) const KERNELS: [&str; 6] =
    ["equilibrate", "condense", "take_targets", "take_states", "give_states", "give_results"];

/// What the kernels are compiled for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct Variant {
    pub tile: TileShape,
    /// The kind of all laws, if it is the same and none of them buckles.
    pub only_law: Option<u32>,
}

/// Returns the kernels of a variant.
pub(super) fn source(Variant { tile, only_law }: Variant) -> String {
    let TileShape { columns, rows, .. } = tile;
    let only_law = only_law.map(|kind| format!("#define ONLY_LAW {kind}\n")).unwrap_or_default();
    format!("#define BLOCK_THREADS {BLOCK_THREADS}\n#define COLUMNS {columns}\n#define ROWS {rows}\n{only_law}{SOURCE}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::backends::cuda::compiler::{compile, is_missing};
    use crate::backends::cuda::networks::TILE;

    #[test]
    fn the_kernels_of_networks_compile_for_each_law() {
        if is_missing() {
            return;
        }
        for only_law in [None, Some(0), Some(1), Some(2)] {
            compile(&source(Variant { tile: TILE, only_law }), "sm_90").unwrap();
        }
    }
}
