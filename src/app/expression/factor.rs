//! Expressions as load factors.

use super::Expression;
use crate::fem::boundary::{LoadCurve, LoadFunction};

/// A load factor given by an expression, alone or times a curve.
#[derive(Clone, Debug)]
pub struct ExpressionFactor {
    expression: Expression,
    times: Option<LoadCurve>,
    formula: String,
}

impl ExpressionFactor {
    /// The expression alone.
    pub fn new(expression: Expression) -> Self {
        let formula = expression.text().to_owned();
        Self { expression, times: None, formula }
    }

    /// The expression times a curve.
    pub fn times(expression: Expression, curve: LoadCurve) -> Self {
        let factor = match &curve {
            LoadCurve::Ramp => Some("ramp".to_owned()),
            LoadCurve::Table(table) => Some(format!("{:?}", table.points())),
            LoadCurve::Function(function) => function.formula().map(|formula| format!("({formula})")),
        };
        // A function without a formula is written by its debug representation, which names it.
        let factor = factor.unwrap_or_else(|| format!("{curve:?}"));
        let formula = format!("({}) * {factor}", expression.text());
        Self { expression, times: Some(curve), formula }
    }
}

impl LoadFunction for ExpressionFactor {
    fn factor(&self, t: f64, x: [f64; 3]) -> f64 {
        let factor = self.times.as_ref().map_or(1.0, |curve| curve.factor(t, x));
        self.expression.at(t, x) * factor
    }

    fn break_points(&self) -> Vec<f64> {
        self.times.as_ref().map_or_else(Vec::new, LoadCurve::break_points)
    }

    fn formula(&self) -> Option<&str> {
        Some(&self.formula)
    }
}
