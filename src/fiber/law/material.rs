//! Fiber materials: law and cross-section.

use thiserror::Error;

use super::{Law, RADIUS};

/// The material of a fiber: law, radius and density.
#[derive(Clone, Debug, PartialEq)]
pub struct FiberMaterial {
    /// The law.
    pub law: Law,
    /// Radius of the circular cross-section, in the unit of length consistent with the modulus (m for Pa).
    pub radius: f64,
    /// Mass density in kg/m^3, if a file gives one.
    pub density: Option<f64>,
}

/// An invalid parameter of a fiber material.
#[derive(Clone, Debug, Error, PartialEq)]
#[error("the {parameter} of a fiber is {value}; it must be {expected}")]
pub struct FiberMaterialError {
    /// The name of the parameter.
    pub parameter: &'static str,
    /// Its value.
    pub value: f64,
    /// The valid range.
    pub expected: String,
}

impl FiberMaterial {
    /// The cross-sectional area.
    pub fn area(&self) -> f64 {
        std::f64::consts::PI * self.radius * self.radius
    }

    /// Checks that every parameter is physically valid.
    ///
    /// # Errors
    /// Returns the first invalid parameter.
    pub fn check(&self) -> Result<(), FiberMaterialError> {
        RADIUS.check(self.radius)?;
        if let Some(density) = self.density
            && (density.is_nan() || density < 0.0)
        {
            return Err(FiberMaterialError {
                parameter: "density",
                value: density,
                expected: "zero or positive".into(),
            });
        }
        self.law.check()
    }
}
