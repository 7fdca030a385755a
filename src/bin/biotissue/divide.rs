//! `biotissue divide`: divides the body of a case among ranks, once.

use std::path::PathBuf;

use clap::Args;

use crate::failure::Failure;
use crate::number::count;

/// Divide the body of a case among ranks, once: each rank of `run --divided` reads its part, and none holds the whole mesh
#[derive(Args)]
pub struct DivideCommand {
    /// The case file
    case: PathBuf,
    /// Ranks of the body (`macro` of [scales])
    #[arg(long, value_name = "N", value_parser = count, allow_hyphen_values = true)]
    ranks: usize,
    /// Folder for the parts
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

/// Runs the command. Only PETSc solves for a divided body, and only local backends for the RVEs of its ranks.
#[cfg(all(feature = "petsc", any(feature = "sparse", feature = "dense")))]
pub fn run(command: DivideCommand) -> Result<(), Failure> {
    use biotissue::app::run::{BodyFiles, DivisionReport};
    use biotissue::backends::petsc::{Context, Petsc};

    use crate::dispatch::ProgramBackend;
    use crate::error_hints::{CaseHints, not_set_up};
    use crate::{output, ranks::started_by_mpirun};

    let DivideCommand { case, ranks, out } = command;
    if started_by_mpirun().is_some_and(|processes| processes > 1) {
        return Err(Failure::arguments(
            "`biotissue divide` was started as several processes, each of which would do the same",
            "one process",
            "start it without mpirun",
        ));
    }
    let case = crate::run::read(&case)?;
    let context = Context::world().map_err(Failure::library)?;
    let divided = BodyFiles::create::<Petsc, <Petsc as ProgramBackend>::Micro>(context, (), &case, ranks, &out);
    let divided = divided.map_err(|error| not_set_up(&CaseHints::of(&case), error))?;
    let DivisionReport { elements, largest, warnings } = divided;
    output::warn(&warnings);
    let (out, largest) = (out.display(), 1e-6 * largest as f64);
    output::print(&format!("{elements} elements in {ranks} parts in {out}, the largest of {largest:.3} MB"))
}

/// Reports that this program has no backend for a divided body.
#[cfg(not(all(feature = "petsc", any(feature = "sparse", feature = "dense"))))]
pub fn run(command: DivideCommand) -> Result<(), Failure> {
    let DivideCommand { case, ranks, out } = command;
    let of = format!("{} among {ranks} ranks in {}", case.display(), out.display());
    Err(Failure::arguments(
        format!("the body of {of} cannot be divided by this build"),
        "a build with the cargo features `petsc` and `sparse`",
        "build it with --features petsc,sparse, or run the case without a division",
    ))
}
