//! `solver = { ... }`: the linear solver of a scale.

use super::range::Range;
use super::table::Table;
use super::write::{Entry, entry};
use crate::las::{Iterative, Krylov, Method, Preconditioner};

/// The methods, with their defaults; `None` is the direct method.
const METHODS: [(&str, Option<Krylov>); 4] = [
    ("direct", None),
    ("cg", Some(Krylov::Cg)),
    ("bicgstab", Some(Krylov::BiCgStab)),
    ("gmres", Some(Krylov::Gmres { restart: 50 })),
];

const ILUT: Preconditioner = Preconditioner::Ilut { drop_tolerance: 1e-4, fill: 50 };

/// The preconditioners, with their defaults.
const PRECONDITIONERS: [(&str, Preconditioner); 4] = [
    ("ilut", ILUT),
    ("diagonal", Preconditioner::Diagonal),
    ("multigrid", Preconditioner::Multigrid),
    ("none", Preconditioner::None),
];

/// Reads the method from the table `solver` of a section; the default is direct.
pub(super) fn method(section: &mut Table<'_>) -> Method {
    let Some(mut table) = section.table("solver") else { return Method::Direct };
    if !table.has("method") {
        let expected = "how to solve: \"direct\", \"cg\", \"bicgstab\" or \"gmres\"";
        table.report("has no `method`", expected, "add `method = ...`");
        return Method::Direct;
    }
    let krylov = table.choice("method", &METHODS).flatten();
    let method = krylov.map_or(Method::Direct, |krylov| Method::Iterative(iterative(&mut table, krylov)));
    table.report_unknown_keys();
    method
}

fn iterative(table: &mut Table<'_>, mut krylov: Krylov) -> Iterative {
    if let Krylov::Gmres { restart } = &mut krylov {
        *restart = table.integer("restart", 1..=10_000).unwrap_or(*restart);
    }
    // Conjugate gradients need a symmetric positive definite preconditioner, which an incomplete LU is not.
    let asks_for_ilut = table.has("drop_tolerance") || table.has("fill");
    let suited = if krylov == Krylov::Cg && !asks_for_ilut { Preconditioner::Diagonal } else { ILUT };
    let mut preconditioner = table.choice("preconditioner", &PRECONDITIONERS).unwrap_or(suited);
    if let Preconditioner::Ilut { drop_tolerance, fill } = &mut preconditioner {
        *drop_tolerance = table.number("drop_tolerance", Range::from_to(0.0, 1.0)).unwrap_or(*drop_tolerance);
        *fill = table.integer("fill", 0..=1_000_000).unwrap_or(*fill);
    }
    Iterative {
        krylov,
        preconditioner,
        tolerance: table.number("tolerance", Range::between(0.0, 1.0)).unwrap_or(1e-12),
        max_iterations: table.integer("max_iterations", 1..=1_000_000).unwrap_or(1000),
    }
}

/// Returns the entries that [`method`] reads back.
pub(super) fn entries(method: &Method) -> Vec<Entry<'static>> {
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
    entries.extend([entry("tolerance", tolerance), entry("max_iterations", max_iterations)]);
    entries
}
