//! The grammar of expressions, compiled by recursive descent.
//!
//! ```text
//! sum     = product (("+" | "-") product)*
//! product = factor (("*" | "/") factor)*
//! factor  = ("+" | "-") factor | power
//! power   = atom ("^" factor)?
//! atom    = number | variable | "pi" | function "(" sum ("," sum)? ")" | "(" sum ")"
//! ```

use thiserror::Error;

use super::{FUNCTIONS, FUNCTIONS_OF_TWO, Operation, STACK, VARIABLES};
use crate::input::excerpt;

/// The maximum number of nested factors, which limits the recursion.
const DEEPEST: usize = 100;

/// The reason why a text is not an expression.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("column {column}: {problem}")]
pub struct ExpressionError {
    /// The column in the text, from 1.
    pub column: usize,
    /// The problem.
    pub problem: String,
    /// The action that the user should take.
    pub cure: String,
}

/// Compiles an expression.
pub(super) fn compile(text: &str, allowed: &[&str]) -> Result<Vec<Operation>, ExpressionError> {
    let mut parser = Parser { text, at: 0, allowed, code: Vec::new(), nested: 0 };
    parser.sum()?;
    if let Some(other) = parser.peek() {
        let cure = match other {
            ')' => "remove it, or open the parenthesis",
            _ => "write an operator: + - * / ^",
        };
        return Err(parser.error(format!("`{other}` where an operator should be"), cure));
    }
    let mut depth = 0;
    for operation in &parser.code {
        match operation {
            Operation::Number(_) | Operation::Variable(_) => depth += 1,
            Operation::Negate | Operation::Unary(_) => {}
            Operation::Binary(_) => depth -= 1,
        }
        if depth > STACK {
            return Err(parser.error("too many intermediate results", "write a simpler expression"));
        }
    }
    Ok(parser.code)
}

struct Parser<'a> {
    text: &'a str,
    /// The byte that is read next.
    at: usize,
    allowed: &'a [&'a str],
    code: Vec<Operation>,
    nested: usize,
}

impl Parser<'_> {
    fn error(&self, problem: impl Into<String>, cure: impl Into<String>) -> ExpressionError {
        let column = 1 + self.text[..self.at].chars().count();
        ExpressionError { column, problem: problem.into(), cure: cure.into() }
    }

    /// Skips blanks and returns the next character.
    fn peek(&mut self) -> Option<char> {
        let rest = &self.text[self.at..];
        self.at += rest.len() - rest.trim_start().len();
        self.text[self.at..].chars().next()
    }

    /// Skips the next character if it is `wanted`.
    fn take(&mut self, wanted: char) -> bool {
        let found = self.peek() == Some(wanted);
        self.at += if found { wanted.len_utf8() } else { 0 };
        found
    }

    fn sum(&mut self) -> Result<(), ExpressionError> {
        self.product()?;
        loop {
            let function = match self.peek() {
                Some('+') => |a, b| a + b,
                Some('-') => |a: f64, b: f64| a - b,
                _ => return Ok(()),
            };
            self.at += 1;
            self.product()?;
            self.code.push(Operation::Binary(function));
        }
    }

    fn product(&mut self) -> Result<(), ExpressionError> {
        self.factor()?;
        loop {
            let function = match self.peek() {
                Some('*') => |a, b| a * b,
                Some('/') => |a: f64, b: f64| a / b,
                _ => return Ok(()),
            };
            self.at += 1;
            if self.peek() == Some('*') {
                return Err(self.error("`**` is not an operator", "write a power with ^"));
            }
            self.factor()?;
            self.code.push(Operation::Binary(function));
        }
    }

    fn factor(&mut self) -> Result<(), ExpressionError> {
        self.nested += 1;
        if self.nested > DEEPEST {
            return Err(self.error("too deeply nested", "write a simpler expression"));
        }
        if self.take('-') {
            self.factor()?;
            self.code.push(Operation::Negate);
        } else if self.take('+') {
            self.factor()?;
        } else {
            self.atom()?;
            if self.take('^') {
                self.factor()?;
                self.code.push(Operation::Binary(f64::powf));
            }
        }
        self.nested -= 1;
        Ok(())
    }

    fn atom(&mut self) -> Result<(), ExpressionError> {
        const VALUE: &str = "write a number, a variable or a function there";
        match self.peek() {
            Some('(') => {
                self.at += 1;
                self.sum()?;
                self.close()
            }
            Some(c) if c.is_ascii_digit() || c == '.' => self.number(),
            Some(c) if c.is_alphabetic() || c == '_' => self.name(),
            Some(c) => Err(self.error(format!("`{c}` where a value should be"), VALUE)),
            None => Err(self.error("the expression ends where a value should be", VALUE)),
        }
    }

    fn close(&mut self) -> Result<(), ExpressionError> {
        if self.take(')') { Ok(()) } else { Err(self.error("a parenthesis is not closed", "write `)` there")) }
    }

    fn number(&mut self) -> Result<(), ExpressionError> {
        let rest = &self.text[self.at..];
        let digits = |from: usize| rest[from..].bytes().take_while(u8::is_ascii_digit).count();
        let mut end = digits(0);
        if rest[end..].starts_with('.') {
            end += 1 + digits(end + 1);
        }
        if let Some(exponent) = rest[end..].strip_prefix(['e', 'E']) {
            let sign = usize::from(exponent.starts_with(['+', '-']));
            let count = digits(end + 1 + sign);
            // Without digits, the `e` is reported as a misplaced name.
            end += if count > 0 { 1 + sign + count } else { 0 };
        }
        let number = rest[..end].parse().ok().filter(|number: &f64| number.is_finite());
        let number = number.ok_or_else(|| {
            self.error(format!("`{}` is not a finite number", excerpt(&rest[..end])), "correct the number")
        })?;
        self.at += end;
        self.code.push(Operation::Number(number));
        Ok(())
    }

    fn name(&mut self) -> Result<(), ExpressionError> {
        let rest = &self.text[self.at..];
        let end = rest.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(rest.len());
        let name = &rest[..end];
        if let Some(variable) = VARIABLES.iter().position(|variable| *variable == name) {
            if !self.allowed.contains(&name) {
                // Only material parameters exclude a variable.
                let cure = format!("use only {}", self.allowed.join(", "));
                return Err(self.error(format!("a material parameter cannot depend on `{name}`"), cure));
            }
            self.at += end;
            self.code.push(Operation::Variable(variable));
            return Ok(());
        }
        if name == "pi" {
            self.at += end;
            self.code.push(Operation::Number(std::f64::consts::PI));
            return Ok(());
        }
        let unary = FUNCTIONS.iter().find(|(function, _)| *function == name);
        let binary = FUNCTIONS_OF_TWO.iter().find(|(function, _)| *function == name);
        let (operation, count) = match (unary, binary) {
            (Some((_, function)), _) => (Operation::Unary(*function), 1),
            (_, Some((_, function))) => (Operation::Binary(*function), 2),
            (None, None) => return Err(self.unknown(name)),
        };
        self.at += end;
        if !self.take('(') {
            let cure = format!("write `{name}(...)`");
            return Err(self.error(format!("`{name}` without its arguments"), cure));
        }
        self.sum()?;
        if count == 2 {
            if !self.take(',') {
                let cure = format!("write `{name}(..., ...)`");
                return Err(self.error(format!("`{name}` takes two arguments"), cure));
            }
            self.sum()?;
        }
        if self.peek() == Some(',') {
            let (number, form) = if count == 1 { ("one argument", "...") } else { ("two arguments", "..., ...") };
            return Err(self.error(format!("`{name}` takes {number}"), format!("write `{name}({form})`")));
        }
        self.close()?;
        self.code.push(operation);
        Ok(())
    }

    fn unknown(&self, name: &str) -> ExpressionError {
        let functions = FUNCTIONS.iter().map(|(name, _)| *name).chain(FUNCTIONS_OF_TWO.iter().map(|(name, _)| *name));
        let functions: Vec<&str> = functions.collect();
        let cure = match name {
            "log" => "write `ln` or `log10`".to_owned(),
            "pow" => "write a power with ^".to_owned(),
            "PI" | "Pi" => "write `pi`".to_owned(),
            "e" | "E" => "write `exp(1)`".to_owned(),
            _ => format!("use {}, pi and the functions {}", self.allowed.join(", "), functions.join(" ")),
        };
        self.error(format!("unknown name `{}`", excerpt(name)), cure)
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Expression, VARIABLES};

    #[test]
    fn errors_name_the_column() {
        for (text, expected) in [
            ("1 + * 2", "column 5: `*` where a value should be"),
            ("1 +", "column 4: the expression ends where a value should be"),
            ("2x", "column 2: `x` where an operator should be"),
            ("(1 + 2", "column 7: a parenthesis is not closed"),
            ("1)", "column 2: `)` where an operator should be"),
            ("2*w", "column 3: unknown name `w`"),
            ("log(x)", "column 1: unknown name `log`"),
            ("sin x", "column 5: `sin` without its arguments"),
            ("min(x)", "column 6: `min` takes two arguments"),
            ("max(x, y, z)", "column 9: `max` takes two arguments"),
            ("sin(x, y)", "column 6: `sin` takes one argument"),
            ("max(x 1)", "column 7: `max` takes two arguments"),
            ("  2*w ", "column 5: unknown name `w`"),
            (" 1 + ", "column 5: the expression ends where a value should be"),
            ("x**2", "column 3: `**` is not an operator"),
            ("1e999", "column 1: `1e999` is not a finite number"),
            ("1e", "column 2: `e` where an operator should be"),
            ("1..2", "column 3: `.` where an operator should be"),
            (".", "column 1: `.` is not a finite number"),
            ("é + ü", "column 1: unknown name `é`"),
            ("", "column 1: the expression ends where a value should be"),
        ] {
            let error = Expression::parse(text, &VARIABLES).unwrap_err();
            assert_eq!(error.to_string(), expected, "{text}");
        }
        let error = Expression::parse("2*t", &["x", "y", "z"]).unwrap_err();
        assert_eq!(error.to_string(), "column 3: a material parameter cannot depend on `t`");
    }

    #[test]
    fn deep_expressions_are_refused_before_they_overflow() {
        for text in ["(".repeat(100_000), "-".repeat(100_000), "2^".repeat(100_000), "sin(".repeat(100_000)] {
            assert!(Expression::parse(&text, &VARIABLES).unwrap_err().problem.contains("deeply"));
        }
        let long = "x + (".repeat(50) + "1" + &")".repeat(50);
        assert!(Expression::parse(&long, &VARIABLES).unwrap_err().problem.contains("intermediate"));
        let sum = "x + ".repeat(10_000) + "1";
        assert_eq!(Expression::parse(&sum, &VARIABLES).unwrap().at(0.0, [1.0, 0.0, 0.0]), 10_001.0);
    }
}
