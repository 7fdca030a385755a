//! `solver = { ... }`: the linear solver of a scale.

use std::fmt::Write;

use super::range::Range;
use super::table::Table;
use crate::las::{Iterative, Krylov, Method, Preconditioner};

/// Ranges of the solver tolerance (`PART`) and of the drop tolerance of an incomplete factorization (`DROPPED`).
const PART: Range = Range::between(0.0, 1.0);
const DROPPED: Range = Range::from_to(0.0, 1.0);

/// Default values of the keys.
const RESTART: usize = 50;
const TOLERANCE: f64 = 1e-12;
const DROP_TOLERANCE: f64 = 1e-4;
const FILL: usize = 50;

#[derive(Clone, Copy, PartialEq)]
enum Name {
    Direct,
    Cg,
    BiCgStab,
    Gmres,
}

#[derive(Clone, Copy, PartialEq)]
enum Inverse {
    None,
    Diagonal,
    Ilut,
    Multigrid,
}

/// Reads the method from the table `solver` of a section; the default is direct.
pub(super) fn method(section: &mut Table<'_>) -> Method {
    let Some(mut table) = section.table("solver") else { return Method::Direct };
    let names = [("direct", Name::Direct), ("cg", Name::Cg), ("bicgstab", Name::BiCgStab), ("gmres", Name::Gmres)];
    let inverses = [
        ("ilut", Inverse::Ilut),
        ("diagonal", Inverse::Diagonal),
        ("multigrid", Inverse::Multigrid),
        ("none", Inverse::None),
    ];
    if !table.has("method") {
        let expected = "how to solve: \"direct\", \"cg\", \"bicgstab\" or \"gmres\"";
        table.report("has no `method`", expected, "add `method = ...`");
        return Method::Direct;
    }
    let name = table.choice("method", &names).unwrap_or(Name::Direct);
    let method = if name == Name::Direct {
        Method::Direct
    } else {
        let krylov = match name {
            Name::Cg => Krylov::Cg,
            Name::Gmres => Krylov::Gmres { restart: table.whole("restart", 1..=10_000).unwrap_or(RESTART) },
            Name::Direct | Name::BiCgStab => Krylov::BiCgStab,
        };
        // Conjugate gradients need a symmetric positive definite preconditioner, which an incomplete LU is not.
        let asks_for_ilut = table.has("drop_tolerance") || table.has("fill");
        let suited = if name == Name::Cg && !asks_for_ilut { Inverse::Diagonal } else { Inverse::Ilut };
        let preconditioner = match table.choice("preconditioner", &inverses).unwrap_or(suited) {
            Inverse::None => Preconditioner::None,
            Inverse::Diagonal => Preconditioner::Diagonal,
            Inverse::Multigrid => Preconditioner::Multigrid,
            Inverse::Ilut => Preconditioner::Ilut {
                drop_tolerance: table.number("drop_tolerance", DROPPED).unwrap_or(DROP_TOLERANCE),
                fill: table.whole("fill", 0..=1_000_000).unwrap_or(FILL),
            },
        };
        Method::Iterative(Iterative {
            krylov,
            preconditioner,
            tolerance: table.number("tolerance", PART).unwrap_or(TOLERANCE),
            max_iterations: table.whole("max_iterations", 1..=1_000_000).unwrap_or(1000),
        })
    };
    table.finish();
    method
}

/// Writes the line that [`method`] reads back.
pub(super) fn line(method: &Method) -> String {
    let Method::Iterative(iterative) = method else { return "solver = { method = \"direct\" }".into() };
    let mut text = String::from("solver = { method = ");
    // Writing to a string does not fail.
    let _ = match iterative.krylov {
        Krylov::Cg => write!(text, "\"cg\""),
        Krylov::BiCgStab => write!(text, "\"bicgstab\""),
        Krylov::Gmres { restart } => write!(text, "\"gmres\", restart = {restart}"),
    };
    let _ = match iterative.preconditioner {
        Preconditioner::None => write!(text, ", preconditioner = \"none\""),
        Preconditioner::Diagonal => write!(text, ", preconditioner = \"diagonal\""),
        Preconditioner::Multigrid => write!(text, ", preconditioner = \"multigrid\""),
        Preconditioner::Ilut { drop_tolerance, fill } => {
            write!(text, ", preconditioner = \"ilut\", drop_tolerance = {drop_tolerance:?}, fill = {fill}")
        }
    };
    let Iterative { tolerance, max_iterations, .. } = iterative;
    let _ = write!(text, ", tolerance = {tolerance:?}, max_iterations = {max_iterations} }}");
    text
}
