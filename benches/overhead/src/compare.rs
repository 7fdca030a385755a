//! Comparison of the five ways of calling each verb, and the limits on LAS relative to a call by hand.

use std::error::Error;

use crate::executed::is_call;
use crate::image::Image;
use crate::ways::{self, Place};

/// Instructions of one verb: those of the calling function and of the functions called.
pub struct Row {
    /// The backend.
    pub backend: &'static str,
    /// The verb.
    pub verb: &'static str,
    /// By hand.
    pub raw: usize,
    /// Through LAS.
    pub las: usize,
    /// Through a function of another compilation unit, a function pointer, a trait object.
    pub others: [usize; 3],
    /// Whether `raw` and `las` are equal apart from registers and addresses.
    pub is_same: bool,
    /// Number of instructions of `las` that compute with several numbers at once, and with one.
    pub arithmetic: (usize, usize),
    /// Functions of LAS and its backends that `las` does not inline, except for rare cases; and the number of calls
    /// that `las` has more than `raw`.
    pub calls: (Vec<String>, usize),
}

/// Verbs of a backend that may have more instructions than their calls by hand.
pub struct Exception {
    /// The backend.
    pub backend: &'static str,
    /// The verbs.
    pub verbs: &'static [&'static str],
    /// The reason.
    pub reason: &'static str,
}

/// All exceptions.
pub const EXCEPTIONS: &[Exception] = &[
    Exception {
        backend: "petsc",
        verbs: &["matrix_finish"],
        reason: "a function called once per assembly, which waits for calls of other threads and obtains the arrays",
    },
    Exception {
        backend: "petsc",
        verbs: &["vector_finish"],
        reason: "a test, once per assembly, whether each rank holds a part of the vector and must update its ghosts",
    },
    Exception {
        backend: "cuda",
        verbs: &["vector_local"],
        reason: "the compiler writes the end of the function several times, once for each way to it; a call executes no more \
                 instructions",
    },
];

/// Counts the instructions of all verbs.
///
/// # Errors
/// Returns an error if the program cannot be read.
pub fn rows(image: &Image) -> Result<Vec<Row>, Box<dyn Error>> {
    let places = ways::all();
    let all =
        places.iter().flat_map(|place| [place.raw, place.las].into_iter().chain(place.behind)).collect::<Vec<_>>();
    places.iter().map(|place| row(image, place, &all)).collect()
}

fn row(image: &Image, place: &Place, all: &[*const ()]) -> Result<Row, Box<dyn Error>> {
    let &Place { backend, verb, raw, las, others, behind } = place;
    let (raw, las) = (image.followed(raw, all)?, image.followed(las, all)?);
    let mut sums = [0; 3];
    for ((sum, at), behind) in sums.iter_mut().zip(others).zip(behind) {
        *sum = image.listing(at)?.len() + image.followed(behind, all)?.len();
    }
    let (is_same, arithmetic) = (raw.codes() == las.codes(), las.arithmetic());
    let is_ours = |name: &String| name.trim_start_matches('<').starts_with("biotissue::");
    let is_rare = |name: &String| RARE.iter().any(|rare| name.ends_with(rare));
    let ours = las.leaves_for.iter().flatten().filter(|name| is_ours(name) && !is_rare(name)).cloned().collect();
    let calls = (ours, las.leaves_for.len().saturating_sub(raw.leaves_for.len()));
    Ok(Row { backend, verb, raw: raw.len(), las: las.len(), others: sums, is_same, arithmetic, calls })
}

/// Functions for rare cases and for long vectors, which are deliberately not inlined.
const RARE: [&str; 10] = [
    "fetch",
    "scaled_norm",
    "sum_scaled",
    "norm_together",
    "dot_together",
    "axpy_together",
    "update_ghosts",
    "long_norm",
    "long_dot",
    "long_axpy",
];

impl Row {
    /// Returns the exception that allows more instructions, if there is one.
    pub fn exception(&self) -> Option<&'static Exception> {
        EXCEPTIONS.iter().find(|one| one.backend == self.backend && one.verbs.contains(&self.verb))
    }
}

/// Returns the violations: verbs with more instructions or calls through LAS than by hand, functions of LAS that are
/// not inlined, and arithmetic on `batched` that is not packed. Verbs that are calls of PETSc by hand are compared by
/// executed instructions, in [`crate::executed`].
pub fn violations(rows: &[Row]) -> Vec<String> {
    let mut violations = Vec::new();
    for row in rows {
        let Row { backend, verb, raw, las, calls, .. } = row;
        let is_compared = row.exception().is_none() && !is_call(backend, verb);
        if is_compared && las > raw {
            violations.push(format!("{verb} on {backend}: {las} instructions through LAS, {raw} by hand"));
        }
        let (ours, more) = calls;
        if is_compared && (!ours.is_empty() || *more > 0) {
            violations.push(format!("{verb} on {backend}: {more} calls more than by hand; not inlined: {ours:?}"));
        }
        let computes = ["vector_add", "vector_dot", "vector_axpy", "matrix_add", "matrix_add_at"].contains(verb);
        let (packed, single) = row.arithmetic;
        if *backend == "batched" && computes && (packed == 0 || single > 0) {
            violations.push(format!("{verb} on batched: {packed} packed instructions, {single} of single numbers"));
        }
    }
    violations
}
