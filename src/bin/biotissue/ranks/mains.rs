//! The main functions of the two scales of a body, on one rank.

use std::sync::OnceLock;

use biotissue::app::Examination;
use biotissue::app::run::{BodyFiles, ExchangeError, RootWriter, ScaleRanks, Setup, WriterGroup};
use biotissue::app::rve_device;
use biotissue::backends::BackendName;
use biotissue::coupling::{ScaleError, Scales};
use biotissue::las::Comm;
use biotissue::tissue::micro_scale::Library;
use biotissue::tissue::two_scale::{
    self, BodySolve, MACRO, MICRO, MicroOutput, ProgressChannel, ScaleField, TwoScaleError,
};

use super::{Outcome, Ranks, RunContext, agreed, not_divided, ranks_failed};
use crate::dispatch::{Job, ProgramBackend, dispatch};
use crate::error_hints::{CaseHints, no_device, not_set_up};
use crate::failure::Failure;
use crate::output;
use crate::progress::of_undeformed_body;
use crate::run::take_steps;

/// Runs the main function of the scale that this rank belongs to.
pub(super) fn on_scale<C: Ranks>(
    world: &C,
    scales: &Scales<C>,
    run: &RunContext<'_>,
) -> Result<Option<Outcome>, Failure> {
    // All ranks hold it until they end, because freeing it is collective.
    let progress = ProgressChannel::new(world, run.steps.report_every, run.time_out);
    let progress = &progress.map_err(|error| ranks_failed(&error))?;
    let name = scales.name(scales.own());
    let files = match body_files(world, scales, run)? {
        Ok(files) => files,
        // The first rank of the body reports what all ranks know.
        Err(failure) => return Ok((name == MACRO && scales.comm().rank() == 0).then_some(Err(failure))),
    };
    let files = files.as_ref();
    match name {
        MICRO => {
            // PETSc and CUDA solve only for the body. The RVEs then use the first compiled backend, which
            // `ProgramBackend::Micro` of these must equal.
            let of_body = [BackendName::Petsc, BackendName::Cuda].map(BackendName::as_str);
            let backend = run.backend.filter(|name| !of_body.contains(name));
            return dispatch(backend, MicroRank { world, scales, run, files, progress });
        }
        MACRO => {}
        other => return Err(ranks_failed(&ScaleError::NoMain(other.to_owned()))),
    }
    #[cfg(feature = "petsc")]
    if run.backend == Some(BackendName::Petsc.as_str()) {
        return run_distributed(MacroRank { world, scales, run, files, progress, body_solve: BodySolve::Distributed });
    }
    match scales.comm().rank() {
        0 => {
            let rank = MacroRank { world, scales, run, files, progress, body_solve: BodySolve::Root };
            dispatch(run.backend, rank).map(Some)
        }
        _ => run_follower(world, scales),
    }
}

/// Runs the macro scale on all its ranks with PETSc; only the root returns the outcome.
#[cfg(feature = "petsc")]
fn run_distributed<C: Ranks>(rank: MacroRank<'_, C>) -> Result<Option<Outcome>, Failure> {
    let ranks = rank.scales.comm();
    let outcome = rank.run::<biotissue::backends::petsc::Petsc>(ranks.petsc()?)?;
    Ok((ranks.rank() == 0).then_some(outcome))
}

fn run_follower<C: Ranks>(world: &C, scales: &Scales<C>) -> Result<Option<Outcome>, Failure> {
    if let Ok(()) = agreed(world, Ok(()))? {
        two_scale::follow(scales).map_err(|error| ranks_failed(&error))?;
    }
    Ok(None)
}

/// Opens the files of the body on its first rank, if the run names them, for all ranks. The inner error is known to all.
fn body_files<C: Ranks>(
    world: &C,
    scales: &Scales<C>,
    run: &RunContext<'_>,
) -> Result<Result<Option<BodyFiles>, Failure>, Failure> {
    let Some(folder) = run.divided else { return Ok(Ok(None)) };
    let petsc = BackendName::Petsc.as_str();
    let ranks = scales.find(MACRO).map_or(&[][..], |scale| scales.ranks(scale));
    let (Some(&root), true) = (ranks.first(), ranks.len() > 1 && run.backend == Some(petsc)) else {
        return Ok(Err(not_divided()));
    };
    let opened = (world.rank() == root).then(|| BodyFiles::open(folder, &run.case, petsc, ranks.len()));
    Ok(match agreed(world, opened.transpose().map_err(Failure::from))? {
        Ok(opened) => Ok(Some(BodyFiles::on_all(opened, world, root, folder).map_err(|error| ranks_failed(&error))?)),
        Err(failure) => Err(failure),
    })
}

/// A rank of the micro scale.
struct MicroRank<'a, C: Comm> {
    world: &'a C,
    scales: &'a Scales<C>,
    run: &'a RunContext<'a>,
    files: Option<&'a BodyFiles>,
    progress: &'a ProgressChannel<C>,
}

impl<C: Ranks> Job for MicroRank<'_, C> {
    type Output = Option<Outcome>;

    fn run<B: ProgramBackend>(self, _: B::Context) -> Result<Self::Output, Failure> {
        let Self { world, scales, run, files, progress } = self;
        let device = rve_device::open(run.case.micro.device, scales.comm().rank());
        let of_rank = device.as_ref().ok().and_then(Option::as_ref);
        let sharing = rve_device::ranks_of_device(scales.comm(), of_rank).map_err(|error| ranks_failed(&error))?;
        // The macro scale reads the same files and reports their errors.
        let ranks = ScaleRanks { world, scales, divides: false, files };
        let materials = ranks.materials(&run.case).map_err(|error| match error {
            ExchangeError::File(errors) => errors.into(),
            ExchangeError::Ranks(reason) => ranks_failed(&reason),
        });
        let read = materials.and_then(|materials| {
            let (mut library, warnings) =
                Library::<B::Micro>::read((), materials).map_err(|error| ranks_failed(&error))?;
            let failed = |error| no_device(&run.case.file, &error);
            if let Some(device) = device.map_err(failed)? {
                let solvers = device.batch_solvers(sharing, library.models(), library.predicts()).map_err(failed)?;
                let mut solvers = solvers.into_iter();
                library.solve_in_batches(|_| Ok(solvers.next().flatten())).map_err(failed)?;
            }
            Ok((library, warnings))
        });
        if let Ok((library, _)) = agreed(world, read)? {
            let case = &run.case;
            let output = MicroOutput { networks: case.output.rve.clone(), costs: case.output.costs };
            two_scale::run_micro(scales, library, output, case.scales.balance, Some(progress))
                .map_err(|error| ranks_failed(&error))?;
        }
        Ok(None)
    }
}

/// A rank of the macro scale that solves for the body.
struct MacroRank<'a, C: Comm> {
    world: &'a C,
    scales: &'a Scales<C>,
    run: &'a RunContext<'a>,
    files: Option<&'a BodyFiles>,
    progress: &'a ProgressChannel<C>,
    body_solve: BodySolve,
}

impl<C: Ranks> Job for MacroRank<'_, C> {
    type Output = Outcome;

    /// Runs with the body on backend `B`. An outer error is one unknown to the other ranks.
    fn run<B: ProgramBackend>(self, context: B::Context) -> Result<Self::Output, Failure> {
        let Self { world, scales, run, files, progress, body_solve } = self;
        let case = run.case.clone();
        let hints = CaseHints::of(&case);
        let balances = case.scales.balance.map(|balance| balance.when);
        let divides = body_solve == BodySolve::Distributed && scales.comm().size() > 1;
        let among = ScaleRanks { world, scales, divides, files };
        let setup = Setup::<B, ScaleField<'_, C, B::Micro>>::with_material(context, case, &among, |materials, mesh| {
            ScaleField::new((scales, body_solve, balances), (), materials, mesh)
        });
        let setup = setup.map_err(|error| not_set_up(&hints, error));
        let mut setup = match agreed(world, setup)? {
            Ok(setup) => setup,
            Err(failure) => return Ok(Err(failure)),
        };
        let is_root = scales.comm().rank() == 0;
        if is_root {
            output::warn(setup.warnings());
            output::warn(&setup.floppy_networks(Examination::Quick).warnings);
        }
        setup.material_mut().receive_progress(progress).map_err(|error| ranks_failed(&error))?;
        setup.material_mut().couple().map_err(|error: TwoScaleError| ranks_failed(&error))?;
        let broken = setup.material_mut().broken();
        let progress = is_root.then(|| of_undeformed_body(&setup, run.steps.report_every));
        let simulation = setup.simulation();
        drop(progress);
        let mut simulation = match simulation {
            Ok(simulation) => simulation,
            Err(error) => return or_broken(&broken, Err(not_set_up(&hints, error))),
        };
        let root = RootWriter { comm: scales.comm(), broken: &broken };
        let writers: &dyn WriterGroup = if body_solve == BodySolve::Distributed { &root } else { &() };
        let outcome = or_broken(&broken, take_steps(&mut simulation, writers, run.steps));
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
