//! The five ways of every verb side by side, and what LAS must not have more of than a call by hand.

use std::error::Error;

use crate::image::Image;
use crate::ways::{self, Place};

/// Instructions of one verb: the place of the call and what stands behind it.
pub struct Row {
    /// The backend.
    pub backend: &'static str,
    /// The verb.
    pub verb: &'static str,
    /// By hand.
    pub raw: usize,
    /// Through LAS.
    pub las: usize,
    /// Through a function of another unit, a function pointer, a trait object.
    pub others: [usize; 3],
    /// Whether `raw` and `las` are the same but for registers and addresses.
    pub is_same: bool,
    /// What `las` computes with several numbers at once, and with one.
    pub arithmetic: (usize, usize),
}

/// A verb that may have more instructions than its call by hand.
pub struct Exception {
    /// The backend.
    pub backend: &'static str,
    /// The verbs.
    pub verbs: &'static [&'static str],
    /// Why.
    pub reason: &'static str,
}

/// All of them.
pub const EXCEPTIONS: &[Exception] = &[
    Exception {
        backend: "petsc",
        verbs: &["matrix_add", "matrix_set"],
        reason: "`MatSetValues` looks at no index in an optimised build of PETSc, and writes anywhere: LAS looks first, in \
                 one pass over the indices. It also keeps additions and settings apart, between which PETSc asks for an \
                 assembly. In the loop of blocks below both do not show",
    },
    Exception {
        backend: "petsc",
        verbs: &["matrix_zero", "matrix_zero_rows", "matrix_get"],
        reason: "by hand these are calls of PETSc, whose own instructions are not counted here; LAS works on the arrays of \
                 the matrix in place",
    },
    Exception {
        backend: "petsc",
        verbs: &["vector_dot", "vector_axpy"],
        reason: "what is done about vectors of two lengths: a call that never returns to the loop",
    },
];

/// Counts all.
///
/// # Errors
/// The program cannot be read.
pub fn rows(image: &Image) -> Result<Vec<Row>, Box<dyn Error>> {
    ways::all().iter().map(|place| row(image, place)).collect()
}

fn row(image: &Image, place: &Place) -> Result<Row, Box<dyn Error>> {
    let &Place { backend, verb, raw, las, others, behind } = place;
    let (raw, las) = (image.followed(raw)?, image.followed(las)?);
    let mut sums = [0; 3];
    for ((sum, at), behind) in sums.iter_mut().zip(others).zip(behind) {
        *sum = image.listing(at)?.len() + image.followed(behind)?.len();
    }
    let (is_same, arithmetic) = (raw.codes() == las.codes(), las.arithmetic());
    Ok(Row { backend, verb, raw: raw.len(), las: las.len(), others: sums, is_same, arithmetic })
}

impl Row {
    /// Why it may have more, if it may.
    #[must_use]
    pub fn exception(&self) -> Option<&'static Exception> {
        EXCEPTIONS.iter().find(|one| one.backend == self.backend && one.verbs.contains(&self.verb))
    }
}

/// What is wrong: verbs whose call through LAS has more instructions than the one by hand, and lanes that are not computed
/// with at once.
#[must_use]
pub fn faults(rows: &[Row]) -> Vec<String> {
    let mut faults = Vec::new();
    for row in rows {
        let Row { backend, verb, raw, las, .. } = row;
        if las > raw && row.exception().is_none() {
            faults.push(format!("{verb} on {backend}: {las} instructions through LAS, {raw} by hand"));
        }
        let computes = ["vector_add", "vector_dot", "vector_axpy", "matrix_add", "matrix_add_at"].contains(verb);
        let (packed, single) = row.arithmetic;
        if *backend == "batched" && computes && (packed == 0 || single > 0) {
            faults.push(format!("{verb} on batched: {packed} packed instructions, {single} of single numbers"));
        }
    }
    faults
}
