//! How a relaxation is to be carried out.

/// The masses of the nodes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Masses {
    /// Half the mass of every fiber at each of its ends; fibers without a density get that of water, 1000 kg/m^3.
    Density,
    /// In proportion to the stiffness of the fibers at a node.
    #[default]
    Stiffness,
}

/// How a relaxation is to be carried out.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct RelaxationParams {
    /// The masses. Default [`Masses::Stiffness`].
    pub masses: Masses,
    /// How long the boundary moves, in times that a wave takes to cross the cube: a load that is too fast may throw the
    /// network into another equilibrium. Default 25.
    pub load_crossings: f64,
    /// Steps in all. Default 200 000.
    pub max_steps: usize,
    /// The part of the stable step that is taken. Default 0.9.
    pub safety: f64,
    /// How much of the largest energy may be missing from the balance. Default 0.01.
    pub energy_error: f64,
    /// Times that the integration may be repeated with half the step. Default 3.
    pub max_repeats: u32,
}

impl Default for RelaxationParams {
    fn default() -> Self {
        Self {
            masses: Masses::default(),
            load_crossings: 25.0,
            max_steps: 200_000,
            safety: 0.9,
            energy_error: 0.01,
            max_repeats: 3,
        }
    }
}
