//! Verbs that are calls of PETSc by hand: their instructions are in PETSc's library, so this module compares the
//! executed instructions, counted by valgrind's callgrind.

use std::error::Error;
use std::fmt::Write;
use std::process::Command;

/// Instructions executed by one call, including all functions that it calls.
pub struct Executed {
    /// The verb.
    pub verb: &'static str,
    /// By hand.
    pub raw: f64,
    /// Through LAS.
    pub las: f64,
}

/// The verbs, the number of calls of each, and their arguments.
const VERBS: &[(&str, usize, &str)] = &[
    ("matrix_add", CALLS, "a block of 12 by 12"),
    ("matrix_set", CALLS, "a block of 12 by 12"),
    ("matrix_get", CALLS, "a block of 12 by 12"),
    ("matrix_zero_rows", CALLS, "12 rows"),
    ("matrix_zero", CALLS, "the whole matrix"),
];

/// Tetrahedra of a cube with six cells per edge, without those at the fixed bottom.
const CALLS: usize = 1080;

/// Returns whether a verb is a call of PETSc by hand.
pub fn is_call(backend: &str, verb: &str) -> bool {
    backend == "petsc" && VERBS.iter().any(|&(name, ..)| name == verb)
}

/// Counts the instructions of all verbs.
///
/// # Errors
/// Returns an error if valgrind is missing or gives no output.
pub fn all() -> Result<Vec<Executed>, Box<dyn Error>> {
    let count = |verb: &str, calls: usize, way: &str| -> Result<f64, Box<dyn Error>> {
        Ok(collected(&["call", verb, way], &format!("*ways*petsc*{way}*{verb}*"))? as f64 / calls as f64)
    };
    let of = |&(verb, calls, _): &(&'static str, usize, &str)| {
        Ok(Executed { verb, raw: count(verb, calls, "raw")?, las: count(verb, calls, "las")? })
    };
    VERBS.iter().map(of).collect()
}

/// Returns the number of instructions that this program, started with `words`, executes in the functions that match a
/// pattern.
///
/// # Errors
/// Returns an error if valgrind is missing or gives no output.
pub fn collected(words: &[&str], pattern: &str) -> Result<u64, Box<dyn Error>> {
    let output = Command::new("valgrind")
        .args(["--tool=callgrind", "--callgrind-out-file=/dev/null", "--collect-atstart=no"])
        .arg(format!("--toggle-collect={pattern}"))
        .arg(std::env::current_exe()?)
        .args(words)
        // Excludes kernels for processors that valgrind does not support.
        .envs([("OPENBLAS_CORETYPE", "Haswell"), ("OPENBLAS_NUM_THREADS", "1")])
        .output()
        .map_err(|error| format!("valgrind does not run: {error}\n  cure: install it"))?;
    let text = String::from_utf8_lossy(&output.stderr);
    let collected = text.lines().find_map(|line| line.split_once("Collected :")?.1.trim().parse().ok());
    match collected {
        Some(count) if count > 0 => Ok(count),
        _ => Err(format!("callgrind counts nothing in {pattern}, {words:?}:\n{text}").into()),
    }
}

/// Returns whether this build has PETSc and valgrind is installed.
pub fn is_possible() -> bool {
    cfg!(feature = "petsc") && Command::new("valgrind").arg("--version").output().is_ok()
}

/// Returns the violations: verbs that execute more instructions through LAS than by hand.
pub fn violations(all: &[Executed]) -> Vec<String> {
    let is_more = |one: &&Executed| one.las > one.raw;
    let say = |Executed { verb, raw, las }: &Executed| {
        format!("{verb} on petsc: {las:.0} instructions executed through LAS, {raw:.0} by hand")
    };
    all.iter().filter(is_more).map(say).collect()
}

/// Formats all verbs as a table.
pub fn table(all: &[Executed]) -> String {
    let mut text = String::from("| verb | argument | by hand | LAS | ratio |\n|---|---|---:|---:|---:|\n");
    for Executed { verb, raw, las } in all {
        let of = VERBS.iter().find(|(name, ..)| name == verb).map_or("", |&(.., of)| of);
        let verb = verb.replacen('_', " ", 1);
        let _ = writeln!(text, "| {verb} | {of} | {raw:.0} | {las:.0} | {:.2} |", las / raw);
    }
    text
}

/// Calls a verb `CALLS` times, for callgrind.
///
/// # Errors
/// Returns an error if the verb or the way does not exist, or if PETSc fails.
#[cfg(feature = "petsc")]
pub fn call(verb: &str, way: &str) -> Result<(), Box<dyn Error>> {
    use biotissue::backends::petsc::{Context, Petsc};
    use biotissue::las::Backend;

    use crate::assembly::{Cube, ENTRIES};
    use crate::by_hand::petsc::Matrix;
    use crate::ways::petsc::{las, raw};

    let cube = Cube::new(6)?;
    let context = Context::world()?;
    let (mut matrix, other) = (Petsc::matrix(&context, &cube.pattern)?, Petsc::matrix(&context, &cube.pattern)?);
    let by_hand = Matrix { mat: other.as_ptr(), array: std::ptr::null_mut(), len: 0 };
    let code = |code: i32| format!("PETSc error {code}");
    let mut by_hand = by_hand.keep_pattern().map_err(code)?;
    let block: [f64; ENTRIES] = std::array::from_fn(|k| k as f64);
    let mut read = [0.0; ENTRIES];
    // `MatZeroRows` does not accept negative rows.
    let elements: Vec<_> = cube.elements.iter().filter(|rows| rows.iter().all(|&row| row >= 0)).collect();
    assert_eq!(elements.len(), CALLS, "as many as are divided by");
    for rows in elements {
        match (way, verb) {
            ("raw", "matrix_add") => raw::matrix_add(&mut by_hand, rows, rows, &block).map_err(code)?,
            ("raw", "matrix_set") => raw::matrix_set(&mut by_hand, rows, rows, &block).map_err(code)?,
            ("raw", "matrix_get") => raw::matrix_get(&by_hand, rows, rows, &mut read).map_err(code)?,
            ("raw", "matrix_zero_rows") => raw::matrix_zero_rows(&mut by_hand, rows).map_err(code)?,
            ("raw", "matrix_zero") => raw::matrix_zero(&mut by_hand).map_err(code)?,
            ("las", "matrix_add") => las::matrix_add(&mut matrix, rows, rows, &block)?,
            ("las", "matrix_set") => las::matrix_set(&mut matrix, rows, rows, &block)?,
            ("las", "matrix_get") => las::matrix_get(&matrix, rows, rows, &mut read)?,
            ("las", "matrix_zero_rows") => las::matrix_zero_rows(&mut matrix, rows)?,
            ("las", "matrix_zero") => las::matrix_zero(&mut matrix)?,
            _ => return Err("there is no such verb or way".into()),
        }
    }
    std::hint::black_box(read);
    Ok(())
}

/// The substitute in a build without PETSc.
///
/// # Errors
/// Always returns an error.
#[cfg(not(feature = "petsc"))]
pub fn call(_: &str, _: &str) -> Result<(), Box<dyn Error>> {
    Err("this build has no PETSc".into())
}
