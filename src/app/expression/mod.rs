//! Expressions of pseudo-time and position in case files, such as `"1e3*(1 + x/0.02)*sin(pi*t)"`.
//!
//! | part | notation |
//! |---|---|
//! | numbers | `2`, `0.5`, `1e-3`; the constant `pi` |
//! | variables | `t` (pseudo-time), `x`, `y`, `z` (position in the reference state, m) |
//! | operators | `+ - * / ^`, with the usual precedence: `-x^2` is `-(x^2)`, and `2^3^2` is `2^(3^2)` |
//! | functions of one number | `sin cos tan asin acos atan sinh cosh tanh exp ln log10 sqrt abs floor ceil`; `step` (0 below 0, otherwise 1) |
//! | functions of two numbers | `min max atan2` |
//!
//! The crate `exmex` is not used: it evaluates `-x^2` as `(-x)^2`, so that `exp(-x^2)` would grow. An expression is
//! compiled to operations on a stack of fixed size.

mod factor;
mod parse;

use std::fmt;
use std::sync::Arc;

pub use factor::ExpressionFactor;
pub use parse::ExpressionError;

/// The variables of expressions, in the order of the values that [`Expression::at`] takes.
pub const VARIABLES: [&str; 4] = ["t", "x", "y", "z"];

/// The maximum number of intermediate results.
const STACK: usize = 32;

/// An expression of pseudo-time and position. Two expressions are equal if they are written alike.
#[derive(Clone)]
pub struct Expression {
    text: Arc<str>,
    code: Arc<[Operation]>,
}

/// An operation on the stack.
#[derive(Clone, Copy, Debug)]
enum Operation {
    Number(f64),
    /// Index into [`VARIABLES`].
    Variable(usize),
    Negate,
    Unary(Unary),
    Binary(Binary),
}

type Unary = fn(f64) -> f64;
type Binary = fn(f64, f64) -> f64;

const FUNCTIONS: [(&str, Unary); 17] = [
    ("sin", f64::sin),
    ("cos", f64::cos),
    ("tan", f64::tan),
    ("asin", f64::asin),
    ("acos", f64::acos),
    ("atan", f64::atan),
    ("sinh", f64::sinh),
    ("cosh", f64::cosh),
    ("tanh", f64::tanh),
    ("exp", f64::exp),
    ("ln", f64::ln),
    ("log10", f64::log10),
    ("sqrt", f64::sqrt),
    ("abs", f64::abs),
    ("floor", f64::floor),
    ("ceil", f64::ceil),
    ("step", step),
];

const FUNCTIONS_OF_TWO: [(&str, Binary); 3] = [("min", min), ("max", max), ("atan2", f64::atan2)];

fn step(x: f64) -> f64 {
    if x.is_nan() { x } else { f64::from(u8::from(x >= 0.0)) }
}

/// Unlike [`f64::min`], does not hide a NaN.
fn min(a: f64, b: f64) -> f64 {
    if a.is_nan() || a < b { a } else { b }
}

/// Unlike [`f64::max`], does not hide a NaN.
fn max(a: f64, b: f64) -> f64 {
    if a.is_nan() || a > b { a } else { b }
}

impl Expression {
    /// Parses an expression in which the variables of `allowed`, names of [`VARIABLES`], may occur: all of them, or for
    /// material parameters those of the position.
    ///
    /// # Errors
    /// Returns the first error in the text, with its column.
    pub fn parse(text: &str, allowed: &[&str]) -> Result<Self, ExpressionError> {
        let code = parse::compile(text.trim_end(), allowed)?;
        Ok(Self { code: code.into(), text: text.trim().into() })
    }

    /// Returns the text.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// Returns true if a variable, a name of [`VARIABLES`], occurs in the expression.
    pub fn contains(&self, variable: &str) -> bool {
        self.code.iter().any(|operation| matches!(operation, Operation::Variable(k) if VARIABLES[*k] == variable))
    }

    /// Returns the value of an expression without variables.
    pub fn constant(&self) -> Option<f64> {
        (!VARIABLES.iter().any(|variable| self.contains(variable))).then(|| self.at(0.0, [0.0; 3]))
    }

    /// Returns the value at pseudo-time `t` and at a position in the reference state, m. It is not finite where the
    /// expression has no value.
    pub fn at(&self, t: f64, [x, y, z]: [f64; 3]) -> f64 {
        let variables = [t, x, y, z];
        let (mut stack, mut top) = ([0.0; STACK], 0);
        for operation in &*self.code {
            // `parse::compile` limits the depth and gives every operation its operands.
            match *operation {
                Operation::Number(number) => {
                    stack[top] = number;
                    top += 1;
                }
                Operation::Variable(variable) => {
                    stack[top] = variables[variable];
                    top += 1;
                }
                Operation::Negate => stack[top - 1] = -stack[top - 1],
                Operation::Unary(function) => stack[top - 1] = function(stack[top - 1]),
                Operation::Binary(function) => {
                    top -= 1;
                    stack[top - 1] = function(stack[top - 1], stack[top]);
                }
            }
        }
        stack[0]
    }
}

impl PartialEq for Expression {
    fn eq(&self, other: &Self) -> bool {
        self.text == other.text
    }
}

impl fmt::Debug for Expression {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:?}", self.text)
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;

    fn value(text: &str) -> f64 {
        let expression = Expression::parse(text, &VARIABLES).unwrap_or_else(|error| panic!("{text}: {error}"));
        expression.at(0.5, [2.0, 3.0, -4.0])
    }

    #[test]
    fn expressions_have_their_usual_meaning() {
        for (text, expected) in [
            ("1e3*t*z", -2000.0),
            ("50*sin(pi*t)", 50.0 * (PI * 0.5).sin()),
            ("-x^2", -4.0),
            ("2^-1", 0.5),
            ("2^3^2", 512.0),
            ("2 - 3 - 4", -5.0),
            ("2/4/2", 0.25),
            ("-2*-3", 6.0),
            ("--3", 3.0),
            ("+.5e1", 5.0),
            ("1.-2", -1.0),
            ("2*(x + y)*t", 5.0),
            ("exp(-x^2)", (-4.0_f64).exp()),
            ("min(x, y) + max(x,y)", 5.0),
            ("atan2(y, x)", 3.0_f64.atan2(2.0)),
            ("step(x - 2) + step(z)", 1.0),
            ("sqrt(abs(z))", 2.0),
            ("log10(100) + ln(exp(1))", 3.0),
        ] {
            assert_eq!(value(text), expected, "{text}");
        }
        for text in ["1/0*0", "sqrt(z)", "min(sqrt(z), 1)", "max(1, sqrt(z))", "step(sqrt(z))"] {
            assert!(value(text).is_nan(), "{text}");
        }
    }

    #[test]
    fn an_expression_knows_its_variables() {
        let parse = |text| Expression::parse(text, &VARIABLES).unwrap();
        assert!(parse("2*t").contains("t") && !parse("2*tan(x)").contains("t"));
        assert_eq!((parse("2*pi").constant(), parse("x - x").constant()), (Some(2.0 * PI), None));
        assert_eq!(parse(" x + 1 "), parse("x + 1"));
        assert_ne!(parse("x+1"), parse("x + 1"));
    }
}
