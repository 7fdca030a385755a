//! The values of loads: numbers, or expressions of pseudo-time and position.

use std::sync::Arc;

use super::range::Range;
use super::value::Value;
use crate::app::expression::{Expression, ExpressionFactor, VARIABLES};
use crate::fem::boundary::LoadCurve;

/// A value of a load or a displacement component, in SI units.
#[derive(Clone, Debug, PartialEq)]
pub enum LoadValue {
    /// A number, which the curve multiplies.
    Number(f64),
    /// An expression with variables. The curve multiplies it unless it contains `t`.
    Expression(Expression),
}

impl From<f64> for LoadValue {
    fn from(number: f64) -> Self {
        Self::Number(number)
    }
}

impl LoadValue {
    /// Reads a finite number, or an expression in quotes; one without variables becomes a number.
    pub(super) fn read(value: &Value<'_>, unit: &'static str) -> Option<Self> {
        let expected = format!("a number in {unit}, or an expression of t, x, y and z in quotes");
        if value.inner.as_str().is_none() {
            return value.number_or(Range::any(unit), expected).map(Self::Number);
        }
        let expression = value.expression(&expected, &VARIABLES)?;
        match expression.constant() {
            None => Some(Self::Expression(expression)),
            Some(number) if number.is_finite() => Some(Self::Number(number)),
            Some(number) => {
                value.report_error(&format!("has the value {number}"), expected, "write a finite number");
                None
            }
        }
    }

    /// Reads three values: x, y, z.
    pub(super) fn read_vector(value: &Value<'_>, unit: &'static str) -> Option<[Self; 3]> {
        let [x, y, z] = value.components(Range::any(unit))?.map(|component| Self::read(&component, unit));
        Some([x?, y?, z?])
    }

    /// Returns true for the number 0.
    pub fn is_zero(&self) -> bool {
        matches!(self, Self::Number(number) if *number == 0.0)
    }

    /// Returns true for an expression that contains `t`; no curve multiplies it.
    pub fn contains_time(&self) -> bool {
        matches!(self, Self::Expression(expression) if expression.contains("t"))
    }

    /// Splits the value into a number and the factor over pseudo-time and position, given the curve of its load.
    pub fn with_curve(&self, curve: &LoadCurve) -> (f64, LoadCurve) {
        let factor = match self {
            Self::Number(number) => return (*number, curve.clone()),
            Self::Expression(expression) if expression.contains("t") => ExpressionFactor::new(expression.clone()),
            Self::Expression(expression) => ExpressionFactor::times(expression.clone(), curve.clone()),
        };
        (1.0, LoadCurve::Function(Arc::new(factor)))
    }
}

/// Divides three components into terms with one curve each: the numbers, if there are any, and each expression. A
/// component that does not belong to a term, or is absent, is `None`.
pub(crate) fn terms(components: &[Option<&LoadValue>; 3], curve: &LoadCurve) -> Vec<([Option<f64>; 3], LoadCurve)> {
    let numbers = components.map(|component| match component {
        Some(LoadValue::Number(number)) => Some(*number),
        _ => None,
    });
    let mut terms = Vec::new();
    if numbers != [None; 3] {
        terms.push((numbers, curve.clone()));
    }
    for (k, value) in components.iter().enumerate() {
        if let Some(value @ LoadValue::Expression(_)) = value {
            let (number, curve) = value.with_curve(curve);
            terms.push((std::array::from_fn(|i| (i == k).then_some(number)), curve));
        }
    }
    terms
}
