//! Parameters of dynamic relaxation.

/// The masses of the nodes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Masses {
    /// Half the mass of every fiber at each of its ends; fibers without a density get that of water, 1000 kg/m^3.
    Density,
    /// Proportional to the stiffness of the fibers at a node.
    #[default]
    Stiffness,
}

/// Parameters of dynamic relaxation.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct RelaxationParams {
    /// The choice of masses. Default [`Masses::Stiffness`].
    pub masses: Masses,
    /// Duration of the boundary motion, in units of the time that a wave takes to cross the cube: a load that is
    /// applied too fast may drive the network into another equilibrium. Default 25.
    pub load_crossings: f64,
    /// Maximum number of steps. Default 200 000.
    pub max_steps: usize,
    /// Fraction of the stable step to take. Default 0.9.
    pub safety: f64,
    /// Largest error of the energy balance, relative to the largest energy. Default 0.01.
    pub energy_error: f64,
    /// Maximum number of times that the integration is repeated with half the step. Default 3.
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
