//! Expressions as load factors.

use super::{Expression, VARIABLES};
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

    fn depends_on_position(&self) -> bool {
        let expression = VARIABLES.iter().any(|variable| *variable != "t" && self.expression.contains(variable));
        expression || self.times.as_ref().is_some_and(LoadCurve::depends_on_position)
    }

    fn is_separable(&self) -> bool {
        !self.expression.contains("t") && self.times.as_ref().is_none_or(LoadCurve::is_separable)
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;

    #[test]
    fn a_factor_knows_what_it_depends_on() {
        let parse = |text: &str| Expression::parse(text, &VARIABLES).unwrap();
        let alone = |text| ExpressionFactor::new(parse(text));
        let times =
            |text, curve: ExpressionFactor| ExpressionFactor::times(parse(text), LoadCurve::Function(Arc::new(curve)));
        for (factor, depends_on_position, is_separable) in [
            (alone("sin(pi*t)"), false, false),
            (alone("t*y"), true, false),
            (alone("z"), true, true),
            (ExpressionFactor::times(parse("x"), LoadCurve::Ramp), true, true),
            (times("2 + 0", alone("t^2")), false, false),
            (times("2 + 0", alone("x")), true, true),
        ] {
            assert_eq!(
                (factor.depends_on_position(), factor.is_separable()),
                (depends_on_position, is_separable),
                "{factor:?}"
            );
        }
    }
}
