//! Run-time dispatch to a backend type by its name.

use biotissue::backends::{self, BackendName};
use biotissue::las::{Backend, RealBackend};

use crate::failure::Failure;

/// A backend that the program can run on.
pub trait ProgramBackend: RealBackend<Context: Clone> {
    /// Whether several macro ranks divide the work on the body.
    const DISTRIBUTES: bool = false;

    /// The backend of the RVEs if they have ranks of their own; an RVE is solved by a single rank.
    #[cfg(any(feature = "sparse", feature = "dense"))]
    type Micro: RealBackend<Context = ()>;

    /// The backend of the RVEs in the process that solves for the body.
    type Local: RealBackend;

    /// Returns the context of [`ProgramBackend::Local`].
    fn local(context: &Self::Context) -> <Self::Local as Backend>::Context;
}

#[cfg(feature = "sparse")]
impl ProgramBackend for backends::sparse::Sparse {
    type Micro = Self;
    type Local = Self;

    fn local((): &()) {}
}

#[cfg(feature = "dense")]
impl ProgramBackend for backends::dense::Dense {
    type Micro = Self;
    type Local = Self;

    fn local((): &()) {}
}

#[cfg(feature = "petsc")]
impl ProgramBackend for backends::petsc::Petsc {
    const DISTRIBUTES: bool = true;

    #[cfg(feature = "sparse")]
    type Micro = backends::sparse::Sparse;
    #[cfg(all(feature = "dense", not(feature = "sparse")))]
    type Micro = backends::dense::Dense;
    type Local = Self;

    fn local(context: &Self::Context) -> Self::Context {
        context.clone()
    }
}

/// The systems of an RVE are too small for a device.
#[cfg(feature = "cuda")]
impl ProgramBackend for backends::cuda::Cuda {
    type Micro = backends::sparse::Sparse;
    type Local = backends::sparse::Sparse;

    fn local(_: &Self::Context) {}
}

/// A computation that is generic over the backend.
pub trait Job {
    /// The result.
    type Output;

    /// Runs the computation on backend `B` with the given context.
    fn run<B: ProgramBackend>(self, context: B::Context) -> Result<Self::Output, Failure>;
}

/// Runs `job` on the named backend, or on the first one compiled in.
pub fn dispatch<J: Job>(backend: Option<&str>, job: J) -> Result<J::Output, Failure> {
    let name = backend.or(backends::compiled().first().copied()).unwrap_or("sparse");
    match name.parse::<BackendName>() {
        #[cfg(feature = "sparse")]
        Ok(BackendName::Sparse) => job.run::<backends::sparse::Sparse>(()),
        #[cfg(feature = "dense")]
        Ok(BackendName::Dense) => job.run::<backends::dense::Dense>(()),
        #[cfg(feature = "petsc")]
        Ok(BackendName::Petsc) => job.run::<backends::petsc::Petsc>(one_process()?),
        #[cfg(feature = "cuda")]
        Ok(BackendName::Cuda) => job.run::<backends::cuda::Cuda>(first_device()?),
        // A name parses only if its backend is compiled in; this arm reports the error for any set of features.
        outcome => {
            let error =
                outcome.err().map_or_else(|| format!("the backend `{name}` is not compiled in"), |e| e.to_string());
            Err(Failure::arguments(
                format!("--backend {name}: {error}"),
                format!("one of those compiled in: {}", backends::compiled().join(", ")),
                "choose one of these, or omit --backend to use the first",
            ))
        }
    }
}

/// Opens the first device that the driver lists, which the environment variable `CUDA_VISIBLE_DEVICES` may change.
#[cfg(feature = "cuda")]
fn first_device() -> Result<backends::cuda::Device, Failure> {
    use backends::cuda::{CudaErrorKind, Device};
    // The kernels are compiled before the run begins, and not in its first load step.
    let open = || Device::open(0).and_then(|device| device.prepare().map(|()| device));
    open().map_err(|error| {
        let expected = match error.kind() {
            CudaErrorKind::Compile { .. } => "an NVRTC that compiles the kernels: version 12 or later",
            _ if error.is_out_of_memory() => "a device with free memory",
            _ => "a machine with an NVIDIA device, its driver and NVRTC",
        };
        let cure = "run there, or choose another backend, for example --backend sparse";
        Failure::arguments(format!("--backend cuda: {error}"), expected, cure)
    })
}

/// Returns the PETSc context of a single process. Under `mpirun` every rank would write the same results, so several
/// ranks are an error.
#[cfg(feature = "petsc")]
fn one_process() -> Result<backends::petsc::Context, Failure> {
    let context = backends::petsc::Context::world().map_err(Failure::library)?;
    match context.ranks() {
        1 => Ok(context),
        ranks => Err(Failure::arguments(
            format!("--backend petsc: started as {ranks} ranks, each of which would do the same work"),
            "one process",
            "start the program without mpirun",
        )),
    }
}
