//! The main functions of the two scales of a body, on one rank.

use std::sync::OnceLock;

use biotissue::app::run::First;
use biotissue::app::run::{Setup, Writers};
use biotissue::coupling::{ScaleError, Scales};
use biotissue::las::{Backend, Comm, Scalar};
use biotissue::tissue::macro_scale;
use biotissue::tissue::micro_scale::Library;
use biotissue::tissue::two_scale::{self, Lead, MACRO, MICRO, ScaleField, TwoScaleError};

use super::{Outcome, Ranks, Shared, agreed, ranks_failed};
use crate::cures::not_set_up;
use crate::dispatch::{Job, dispatch};
use crate::failure::Failure;
use crate::output;
use crate::run::take_steps;

/// The backend of RVEs on ranks of their own unless the dense one is requested; it runs on a single rank, also if the
/// body uses PETSc.
#[cfg(feature = "sparse")]
type Micro = biotissue::backends::sparse::Sparse;
#[cfg(all(feature = "dense", not(feature = "sparse")))]
type Micro = biotissue::backends::dense::Dense;

/// Returns true if `name` is the dense backend.
#[cfg(feature = "dense")]
fn is_dense(name: Option<&str>) -> bool {
    name == Some(biotissue::backends::BackendName::Dense.as_str())
}

/// Runs the main function of the scale that this rank belongs to.
pub(super) fn on_scale<C: Ranks>(
    world: &C,
    scales: &Scales<C>,
    shared: &Shared<'_>,
) -> Result<Option<Outcome>, Failure> {
    match scales.name(scales.own()) {
        #[cfg(feature = "dense")]
        MICRO if is_dense(shared.backend) => {
            return micro::<biotissue::backends::dense::Dense, C>(world, scales, shared);
        }
        MICRO => return micro::<Micro, C>(world, scales, shared),
        MACRO => {}
        other => return Err(ranks_failed(&ScaleError::NoMain(other.to_owned()))),
    }
    #[cfg(feature = "petsc")]
    if shared.backend == Some(biotissue::backends::BackendName::Petsc.as_str()) {
        return in_step(world, scales, shared);
    }
    match scales.comm().rank() {
        0 => dispatch(shared.backend, Leader { world, scales, shared, lead: Lead::First }).map(Some),
        _ => follow(world, scales, shared),
    }
}

/// Runs the macro scale on all its ranks together, with PETSc; only the first rank returns the outcome.
#[cfg(feature = "petsc")]
fn in_step<C: Ranks>(world: &C, scales: &Scales<C>, shared: &Shared<'_>) -> Result<Option<Outcome>, Failure> {
    let context = scales.comm().petsc()?;
    let leader = Leader { world, scales, shared, lead: Lead::All };
    let outcome = leader.run::<biotissue::backends::petsc::Petsc>(context)?;
    Ok((scales.comm().rank() == 0).then_some(outcome))
}

fn micro<M, C: Ranks>(world: &C, scales: &Scales<C>, shared: &Shared<'_>) -> Result<Option<Outcome>, Failure>
where
    M: Backend<Scalar = f64, Context = ()>,
    M::Reduced: Scalar,
{
    let read = Library::<M>::read((), &shared.case);
    // The macro scale reads the same files and reports their errors.
    let read = read.map_err(|error| ranks_failed(&error));
    if let Ok((library, _)) = agreed(world, read)? {
        two_scale::run_micro(scales, &shared.case, library).map_err(|error| ranks_failed(&error))?;
    }
    Ok(None)
}

fn follow<C: Ranks>(world: &C, scales: &Scales<C>, shared: &Shared<'_>) -> Result<Option<Outcome>, Failure> {
    let mesh = macro_scale::mesh(&shared.case).map_err(|error| ranks_failed(&error));
    if let Ok((mesh, _)) = agreed(world, mesh)? {
        two_scale::follow(scales, &mesh).map_err(|error| ranks_failed(&error))?;
    }
    Ok(None)
}

/// A rank of the macro scale that solves for the body.
struct Leader<'a, C: Comm> {
    world: &'a C,
    scales: &'a Scales<C>,
    shared: &'a Shared<'a>,
    lead: Lead,
}

impl<C: Ranks> Job for Leader<'_, C> {
    type Output = Outcome;

    fn run<B>(self, context: B::Context) -> Result<Self::Output, Failure>
    where
        B: Backend<Scalar = f64, Context: Clone>,
        B::Reduced: Scalar,
    {
        #[cfg(feature = "dense")]
        if is_dense(Some(B::NAME)) {
            return self.run_with::<B, biotissue::backends::dense::Dense>(context);
        }
        self.run_with::<B, Micro>(context)
    }
}

impl<C: Ranks> Leader<'_, C> {
    /// Runs with the body on backend `B` and the RVEs on `M`. An outer error is one unknown to the other ranks.
    fn run_with<B, M>(self, context: B::Context) -> Result<Outcome, Failure>
    where
        B: Backend<Scalar = f64, Context: Clone>,
        B::Reduced: Scalar,
        M: Backend<Scalar = f64, Context = ()>,
        M::Reduced: Scalar,
    {
        let Self { world, scales, shared, lead } = self;
        let case = shared.case.clone();
        let (file, micro) = (case.file.clone(), case.micro);
        let setup = Setup::<B, ScaleField<'_, C, M>>::with_material(context, case, |case, mesh| {
            ScaleField::new((scales, lead), (), case, mesh)
        });
        let setup = setup.map_err(|error| not_set_up(&file, &micro, error));
        let mut setup = match agreed(world, setup)? {
            Ok(setup) => setup,
            Err(failure) => return Ok(Err(failure)),
        };
        let is_first = scales.comm().rank() == 0;
        output::warn(if is_first { setup.warnings() } else { &[] });
        setup.material_mut().couple().map_err(|error: TwoScaleError| ranks_failed(&error))?;
        let broken = setup.material_mut().broken();
        let mut simulation = match setup.simulation() {
            Ok(simulation) => simulation,
            Err(error) => return or_broken(&broken, Err(not_set_up(&file, &micro, error))),
        };
        let first = First { comm: scales.comm(), dir: shared.dir, broken: &broken };
        let writers: &dyn Writers = if lead == Lead::All { &first } else { &() };
        let outcome = or_broken(&broken, take_steps(&mut simulation, writers, shared.dir, shared.resume));
        if outcome.is_err() {
            // Collective destructors, such as that of a MUMPS factorization, would wait for ranks that are lost.
            std::mem::forget(simulation);
        }
        outcome
    }
}

/// Returns a broken connection between ranks as an outer error, which ends all ranks, including those that wait.
fn or_broken(broken: &OnceLock<String>, outcome: Outcome) -> Result<Outcome, Failure> {
    match broken.get() {
        Some(reason) if outcome.is_err() => Err(ranks_failed(reason)),
        _ => Ok(outcome),
    }
}
