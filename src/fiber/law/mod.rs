//! Fiber laws: the axial force of a fiber as a function of its stretch.

/// A fiber law with its parameters; moduli in Pa.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Law {
    /// `f = E A lambda g`.
    Linear {
        /// `E`.
        youngs_modulus: f64,
    },
    /// `f = (E A / B) (exp(B g) - 1)`.
    Exponential {
        /// `E`.
        youngs_modulus: f64,
        /// `B`.
        nonlinearity: f64,
    },
    /// `f = (E A / B) lambda (exp(B g) - 1)` on `[1, lambda_t]`, its tangent lines outside.
    ExponentialStretch {
        /// `E`.
        youngs_modulus: f64,
        /// `B`.
        nonlinearity: f64,
        /// `lambda_t`.
        transition: f64,
    },
}

/// What a fiber is made of: its law and its radius.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FiberMaterial {
    /// The law.
    pub law: Law,
    /// Radius of the round cross-section, in the units the modulus goes with (m for Pa).
    pub radius: f64,
    /// Mass density in kg/m^3, where a file gives one.
    pub density: Option<f64>,
}
