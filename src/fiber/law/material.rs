//! What a fiber is made of: its law and its cross-section.

use thiserror::Error;

use super::Law;
use super::named::positive;

/// What a fiber is made of: its law and its radius.
#[derive(Clone, Debug, PartialEq)]
pub struct FiberMaterial {
    /// The law.
    pub law: Law,
    /// Radius of the round cross-section, in the units the modulus goes with (m for Pa).
    pub radius: f64,
    /// Mass density in kg/m^3, where a file gives one.
    pub density: Option<f64>,
}

/// A parameter without physical sense.
#[derive(Clone, Debug, Error, PartialEq)]
#[error("the {parameter} of a fiber is {value}; it must be {expected}")]
pub struct FiberMaterialError {
    /// Which one.
    pub parameter: &'static str,
    /// Its value.
    pub value: f64,
    /// What it must be.
    pub expected: &'static str,
}

impl FiberMaterial {
    /// Area of the cross-section.
    #[must_use]
    pub fn area(&self) -> f64 {
        std::f64::consts::PI * self.radius * self.radius
    }

    /// Checks that every parameter has physical sense.
    ///
    /// # Errors
    /// The first that has none.
    pub fn check(&self) -> Result<(), FiberMaterialError> {
        positive("radius", self.radius)?;
        if let Some(density) = self.density
            && (density.is_nan() || density < 0.0)
        {
            return Err(FiberMaterialError { parameter: "density", value: density, expected: "zero or positive" });
        }
        self.law.check()
    }
}
