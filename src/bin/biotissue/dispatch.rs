//! Where a run-time choice becomes a type: a backend by its name. (Which one the RVEs get on ranks of their own,
//! `ranks/mains.rs` says.)

use biotissue::backends::{self, BackendName};
use biotissue::las::{Backend, Scalar};

use crate::failure::Failure;

/// Work that is generic over the backend.
pub trait Job {
    /// What it gives.
    type Output;

    /// Does it on backend `B`, in that context.
    fn run<B>(self, context: B::Context) -> Result<Self::Output, Failure>
    where
        B: Backend<Scalar = f64, Context: Clone>,
        B::Reduced: Scalar;
}

/// Does `job` on the named backend, or on the first one compiled in.
pub fn dispatch<J: Job>(backend: Option<&str>, job: J) -> Result<J::Output, Failure> {
    let name = backend.or(backends::compiled().first().copied()).unwrap_or("sparse");
    match name.parse::<BackendName>() {
        #[cfg(feature = "sparse")]
        Ok(BackendName::Sparse) => job.run::<backends::sparse::Sparse>(()),
        #[cfg(feature = "dense")]
        Ok(BackendName::Dense) => job.run::<backends::dense::Dense>(()),
        #[cfg(feature = "petsc")]
        Ok(BackendName::Petsc) => job.run::<backends::petsc::Petsc>(one_process()?),
        // Names parse only where the backend is compiled in: this arm is for the error, whatever the features.
        outcome => {
            let error =
                outcome.err().map_or_else(|| format!("the backend `{name}` is not compiled in"), |e| e.to_string());
            Err(Failure::arguments(
                format!("--backend {name}: {error}"),
                format!("one of those compiled in: {}", backends::compiled().join(", ")),
                "choose one of these, or leave --backend out for the first",
            ))
        }
    }
}

/// PETSc in this process alone: under `mpirun` every rank would write the same results.
#[cfg(feature = "petsc")]
fn one_process() -> Result<backends::petsc::Context, Failure> {
    let context = backends::petsc::Context::world().map_err(Failure::library)?;
    match context.ranks() {
        1 => Ok(context),
        ranks => Err(Failure::arguments(
            format!("--backend petsc: started as {ranks} ranks, each of which would do all of it"),
            "one process",
            "start the program without mpirun",
        )),
    }
}
