//! The page of the documentation, generated from the results.

use std::error::Error;
use std::fmt::Write;

use crate::compare::{EXCEPTIONS, Row};
use crate::executed::{self, Executed, is_call};
use crate::ways::BACKENDS;

/// Cells along an edge of the cube that is assembled under callgrind.
pub const SIDE: usize = 6;

/// The five ways.
pub const WAYS: [&str; 5] = ["raw", "las", "call", "table", "object"];

/// Instructions of the assembly loop of one backend, in the five ways.
pub struct Loop {
    /// The backend.
    pub backend: &'static str,
    /// Number of executed instructions, by way.
    pub executed: [u64; 5],
}

/// Runs the loop of every backend in every way under callgrind.
///
/// # Errors
/// Returns an error if valgrind is missing or gives no output.
pub fn loops() -> Result<Vec<Loop>, Box<dyn Error>> {
    let of = |&backend: &&'static str| {
        let mut executed = [0; 5];
        for (way, executed) in WAYS.iter().zip(&mut executed) {
            *executed = executed_by(backend, way)?;
        }
        Ok(Loop { backend, executed })
    };
    BACKENDS.iter().map(of).collect()
}

fn executed_by(backend: &str, way: &str) -> Result<u64, Box<dyn Error>> {
    executed::collected(&["loop", backend, way], &format!("*assembly*{backend}*{way}*"))
}

/// Formats the instructions of every verb as a table.
#[must_use]
pub fn table(rows: &[Row]) -> String {
    let mut text = String::from(
        "| backend | verb | by hand | LAS | same | function | pointer | `dyn` | packed, single |\n\
         |---|---|---:|---:|---|---:|---:|---:|---:|\n",
    );
    for row in rows {
        let [call, pointer, object] = row.others;
        let same = match (row.is_same, row.exception()) {
            (true, _) => "yes",
            (false, None) if is_call(row.backend, row.verb) => "below",
            (false, None) => "",
            (false, Some(_)) => "exception",
        };
        let (packed, single) = row.arithmetic;
        let Row { backend, verb, raw, las, .. } = row;
        let verb = verb.replacen('_', " ", 1);
        let _ = writeln!(
            text,
            "| {backend} | {verb} | {raw} | {las} | {same} | {call} | {pointer} | {object} | {packed}, {single} |"
        );
    }
    text
}

/// Formats the whole page.
#[must_use]
pub fn page(rows: &[Row], calls: &[Executed], loops: &[Loop]) -> String {
    let (same, compared) = (rows.iter().filter(|row| row.is_same).count(), rows.len());
    let called = rows.iter().filter(|row| is_call(row.backend, row.verb)).count();
    let free = rows.iter().filter(|row| row.las <= row.raw && row.exception().is_none()).count();
    let fewer = calls.iter().filter(|one| one.las <= one.raw).count();
    let mut exceptions = String::new();
    for one in EXCEPTIONS {
        let verbs: Vec<String> = one.verbs.iter().map(|verb| verb.replacen('_', " ", 1)).collect();
        let _ = writeln!(exceptions, "* `{}`, {}: {}.", one.backend, verbs.join(", "), one.reason);
    }
    format!(
        "{}{}\nOf {compared} verbs {free} have no instruction and no call more through LAS than by hand; {same} are the same \
         instruction for instruction. {called} are calls of PETSc by hand, whose instructions are not in the program: *below* \
         compares what they execute.\n\nThe exception:\n\n{exceptions}\n{CALLS}{}\n{fewer} of {called} execute no more through \
         LAS.\n\n{}{}{}",
        HEAD,
        table(rows),
        executed::table(calls),
        LOOP,
        loop_table(loops),
        TAIL
    )
}

fn loop_table(loops: &[Loop]) -> String {
    let mut text =
        String::from("| backend | by hand | LAS | function | pointer | `dyn` |\n|---|---:|---:|---:|---:|---:|\n");
    for Loop { backend, executed } in loops {
        let _ = write!(text, "| {backend} |");
        for count in executed {
            let of_raw = *count as f64 / executed[0] as f64;
            let _ = write!(text, " {count} ({of_raw:.3}) |");
        }
        text.push('\n');
    }
    text
}

const HEAD: &str = "# What LAS costs\n\n\
    *Made by `cargo run --release --package overhead --features petsc -- page docs/overhead.md`; the same command without \
    `page` and its file is a test: it fails where a verb has more instructions through LAS than by hand. Without PETSc, leave \
    `--features petsc` away.*\n\n\
    Code that is written once for all backends calls them through the traits of `las`. Every hot verb is inlined where it is \
    called, so that what remains is what a call of the backend by hand would be. This page shows that on the program as it is \
    linked (x86-64, release profile, link-time optimization), for five ways of calling:\n\n\
    1. **by hand**: the same algorithms as loops over plain arrays without a trait, a generic backend or a `Result`, or PETSc's \
    functions with their codes tested (`benches/overhead/src/by_hand`). What is compared is the abstraction, not the \
    algorithm: `docs/backends.md` shows that `add_at` is a better one than `add` where a pattern repeats;\n\
    2. **LAS**: `VectorOps` and `MatrixOps` on a backend chosen at compile time;\n\
    3. **function**: a function of another compilation unit, which is not inlined;\n\
    4. **pointer**: a table of function pointers, as C programs have it;\n\
    5. **`dyn`**: a method of a trait object.\n\n\
    ## Instructions of each verb\n\n\
    Counted are the instructions of the function that holds the call and, in the last three ways, of the function behind it. \
    *Same* says that both have the same instructions in the same order, whatever their registers, addresses and constants. *Packed, single* are the \
    instructions of LAS that compute with several numbers at once, and with one: on `batched` an entry is four numbers, and \
    all arithmetic is packed.\n\n";

const CALLS: &str = "## Verbs that are calls of PETSc by hand\n\n\
    `MatSetValues` and its like lie in PETSc's library. Through LAS these verbs work on the arrays of the matrix, whose places \
    the pattern tells: indices are looked at (`MatSetValues` looks at none in an optimized build, and writes anywhere), and \
    PETSc is not called, so that nothing touches what its objects share. Where a pattern repeats, `locate` looks at the indices \
    once, and `add_at` adds at the places that it found: the row `petsc`, matrix add_at above, which is the path of the \
    assemblies of this crate. Executed instructions of one call, all that it calls included, on a matrix of 882 unknowns, \
    counted by valgrind's callgrind:\n\n";

const LOOP: &str = "## Instructions of an assembly loop\n\n\
    Blocks of 12 by 12, one for each of 1 296 tetrahedra, added to a matrix: executed instructions, all that is called \
    included, counted by valgrind's callgrind (in brackets: of those by hand). On `petsc` the call by hand is `MatSetValues`.\n\n";

const TAIL: &str = "\nTimes of the same loop: `cargo bench --package overhead --features petsc`.\n\n\
    ## Beside the thesis\n\n\
    W. R. Tobin, *The Adaptive Multiscale Simulation Infrastructure* (RPI 2018), section 5.9, did this for one call, \
    `MatSetValues`, with two compilers for C++ (tables 5.3 and 5.4, figure 5.1): instructions of the call, and of the function \
    behind it, as multiples of those by hand.\n\n\
    | | by hand | LAS | function | pointer | virtual |\n|---|---:|---:|---:|---:|---:|\n\
    | x86-64, Intel C++ 18 (table 5.3) | 1 | 1 | one instruction more | one instruction more | about 2 |\n\
    | PowerPC A2, IBM XL 12 (table 5.4; 8 instructions by hand) | 1 | 1 | about 2 | about 2.5 | about 3 |\n\n\
    There the traits of C++ hand PETSc's arguments through unchanged, and nothing is checked. Here LAS is safe Rust: a verb \
    looks at what it is given, and does so with fewer instructions than `MatSetValues` executes by itself.\n";
