//! `solver = { ... }`: the linear solver of a scale.

use super::SolverCase;
use super::range::Range;
use super::table::Table;
use super::value::Value;
use super::write::{Entry, entry, table};
use crate::las::{Iterative, Krylov, Method, Preconditioner};

/// The methods, with their defaults; `None` is the direct method.
const METHODS: [(&str, Option<Krylov>); 4] = [
    ("direct", None),
    ("cg", Some(Krylov::Cg)),
    ("bicgstab", Some(Krylov::BiCgStab)),
    ("gmres", Some(Krylov::Gmres { restart: 50 })),
];

/// The name of the choice by size.
const AUTO: &str = "auto";

/// The tolerance if none is given.
const TOLERANCE: f64 = 1e-12;

const ILUT: Preconditioner = Preconditioner::Ilut { drop_tolerance: 1e-4, fill: 50 };

/// The preconditioners, with their defaults.
const PRECONDITIONERS: [(&str, Preconditioner); 4] = [
    ("ilut", ILUT),
    ("diagonal", Preconditioner::Diagonal),
    ("multigrid", Preconditioner::Multigrid),
    ("none", Preconditioner::None),
];

/// What `solver` says.
enum Said {
    Auto,
    Method(SolverCase),
}

/// Reads the solver of the macro scale; `None`: by the size of the system, the default.
pub(super) fn of_newton(section: &mut Table<'_>) -> Option<SolverCase> {
    match section.get("solver").and_then(|value| read(&value, true))? {
        Said::Auto => None,
        Said::Method(solver) => Some(solver),
    }
}

/// Reads the solver of the RVEs; the default is direct.
pub(super) fn of_micro(section: &mut Table<'_>) -> Method {
    match section.get("solver").and_then(|value| read(&value, false)) {
        Some(Said::Method(solver)) => solver.method,
        Some(Said::Auto) | None => Method::Direct,
    }
}

/// Reads the name of a method, or a table of a method and its parameters.
fn read(value: &Value<'_>, allows_auto: bool) -> Option<Said> {
    let mut names: Vec<(&'static str, Option<Option<Krylov>>)> =
        METHODS.iter().map(|&(name, krylov)| (name, Some(krylov))).collect();
    if allows_auto {
        names.insert(0, (AUTO, None));
    }
    if !value.inner.is_table() {
        let preconditioner = PRECONDITIONERS.iter().find(|(name, _)| value.inner.as_str() == Some(name));
        if let Some((name, _)) = preconditioner.filter(|(name, _)| *name != "none") {
            // Conjugate gradients take no incomplete LU.
            let method = if *name == "ilut" { "gmres" } else { "cg" };
            let cure = format!("write solver = {{ method = \"{method}\", preconditioner = \"{name}\" }}");
            value.report_invalid("a method; this is a preconditioner", cure);
            return None;
        }
        return Some(match value.choice(&names)? {
            None => Said::Auto,
            Some(None) => Said::Method(SolverCase { method: Method::Direct, fixed_tolerance: true }),
            Some(Some(krylov)) => {
                Said::Method(SolverCase { method: Method::Iterative(with_defaults(krylov)), fixed_tolerance: false })
            }
        });
    }
    let mut table = value.table()?;
    if !table.has("method") {
        let of_size = if allows_auto { "\"auto\", " } else { "" };
        let expected = format!("how to solve: {of_size}\"direct\", \"cg\", \"bicgstab\" or \"gmres\"");
        table.report("has no `method`", expected, "add `method = ...`");
        return None;
    }
    let said = match table.choice("method", &names)? {
        None => Said::Auto,
        Some(None) => Said::Method(SolverCase { method: Method::Direct, fixed_tolerance: true }),
        Some(Some(krylov)) => {
            let fixed_tolerance = table.has("tolerance");
            Said::Method(SolverCase { method: Method::Iterative(iterative(&mut table, krylov)), fixed_tolerance })
        }
    };
    table.report_unknown_keys();
    Some(said)
}

/// Returns a method with its default parameters.
fn with_defaults(krylov: Krylov) -> Iterative {
    // Conjugate gradients need a symmetric positive definite preconditioner, which an incomplete LU is not.
    let preconditioner = if krylov == Krylov::Cg { Preconditioner::Diagonal } else { ILUT };
    Iterative { krylov, preconditioner, tolerance: TOLERANCE, max_iterations: 1000 }
}

fn iterative(table: &mut Table<'_>, mut krylov: Krylov) -> Iterative {
    if let Krylov::Gmres { restart } = &mut krylov {
        *restart = table.integer("restart", 1..=10_000).unwrap_or(*restart);
    }
    let asks_for_ilut = table.has("drop_tolerance") || table.has("fill");
    let suited = if asks_for_ilut { ILUT } else { with_defaults(krylov).preconditioner };
    let mut preconditioner = table.choice("preconditioner", &PRECONDITIONERS).unwrap_or(suited);
    if let Preconditioner::Ilut { drop_tolerance, fill } = &mut preconditioner {
        *drop_tolerance = table.number("drop_tolerance", Range::from_to(0.0, 1.0)).unwrap_or(*drop_tolerance);
        *fill = table.integer("fill", 0..=1_000_000).unwrap_or(*fill);
    }
    Iterative {
        krylov,
        preconditioner,
        tolerance: table.number("tolerance", Range::between(0.0, 1.0)).unwrap_or(TOLERANCE),
        max_iterations: table.integer("max_iterations", 1..=1_000_000).unwrap_or(1000),
    }
}

/// The method with its preconditioner, such as `gmres with the preconditioner multigrid`.
impl std::fmt::Display for SolverCase {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Method::Iterative(Iterative { krylov, preconditioner, .. }) = self.method else {
            return f.write_str("direct");
        };
        let krylov = match krylov {
            Krylov::Cg => "cg",
            Krylov::BiCgStab => "bicgstab",
            Krylov::Gmres { .. } => "gmres",
        };
        let preconditioner = match preconditioner {
            Preconditioner::None => return write!(f, "{krylov} without a preconditioner"),
            Preconditioner::Diagonal => "diagonal",
            Preconditioner::Multigrid => "multigrid",
            Preconditioner::Ilut { .. } => "ilut",
        };
        write!(f, "{krylov} with the preconditioner {preconditioner}")
    }
}

/// Returns the line that [`of_newton`] reads back.
pub(super) fn newton_entry(solver: Option<&SolverCase>) -> Entry<'static> {
    match solver {
        None => entry("solver", AUTO),
        Some(SolverCase { method, fixed_tolerance }) => table("solver", entries(method, *fixed_tolerance)),
    }
}

/// Returns the line that [`of_micro`] reads back.
pub(super) fn micro_entry(method: &Method) -> Entry<'static> {
    table("solver", entries(method, true))
}

fn entries(method: &Method, fixed_tolerance: bool) -> Vec<Entry<'static>> {
    let Method::Iterative(Iterative { krylov, preconditioner, tolerance, max_iterations }) = method else {
        return vec![entry("method", "direct")];
    };
    let mut entries = match krylov {
        Krylov::Cg => vec![entry("method", "cg")],
        Krylov::BiCgStab => vec![entry("method", "bicgstab")],
        Krylov::Gmres { restart } => vec![entry("method", "gmres"), entry("restart", restart)],
    };
    match preconditioner {
        Preconditioner::None => entries.push(entry("preconditioner", "none")),
        Preconditioner::Diagonal => entries.push(entry("preconditioner", "diagonal")),
        Preconditioner::Multigrid => entries.push(entry("preconditioner", "multigrid")),
        Preconditioner::Ilut { drop_tolerance, fill } => {
            let numbers = [entry("drop_tolerance", drop_tolerance), entry("fill", fill)];
            entries.extend([entry("preconditioner", "ilut")].into_iter().chain(numbers));
        }
    }
    if fixed_tolerance {
        entries.push(entry("tolerance", tolerance));
    }
    entries.push(entry("max_iterations", max_iterations));
    entries
}
