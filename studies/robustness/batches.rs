//! The cases in batches and one by one: which of them are solved in batches, and whether the results are the same.

use biotissue::backends::sparse::Sparse;
use biotissue::fiber::batch::BatchSolver;
use biotissue::fiber::equilibrium::{EquilibriumParams, Stage, equilibrate};
use biotissue::fiber::network::generate::Kind;
use biotissue::fiber::rve::{Rve, RveModel};
use biotissue::fiber::workspace::Workspace;
use nalgebra::Matrix3;
use rayon::prelude::*;

use super::{Subject, model, random_gradients};

/// The cases of one kind of network.
#[derive(Clone, Copy, Default)]
struct Counts {
    cases: usize,
    in_batches: usize,
    /// Cases left to the solution one by one, by whether Newton's method alone solves them there.
    left_by_newton: usize,
    left_by_others: usize,
    /// Cases solved in batches, but in another stage, or not at all, one by one.
    different: usize,
    /// Cases solved in batches with another number of iterations, and all their iterations in batches and one by one.
    other_iterations: usize,
    iterations: [usize; 2],
    /// The largest differences of stress and tangent, relative to their norms.
    stress: f64,
    tangent: f64,
}

impl Counts {
    fn merge(self, other: Self) -> Self {
        Self {
            cases: self.cases + other.cases,
            in_batches: self.in_batches + other.in_batches,
            left_by_newton: self.left_by_newton + other.left_by_newton,
            left_by_others: self.left_by_others + other.left_by_others,
            different: self.different + other.different,
            other_iterations: self.other_iterations + other.other_iterations,
            iterations: [0, 1].map(|k| self.iterations[k] + other.iterations[k]),
            stress: self.stress.max(other.stress),
            tangent: self.tangent.max(other.tangent),
        }
    }
}

/// Makes the solver of the batches of a model.
pub trait Make: Fn(&RveModel<Sparse>) -> Result<Box<dyn BatchSolver>, String> + Sync {}

impl<F: Fn(&RveModel<Sparse>) -> Result<Box<dyn BatchSolver>, String> + Sync> Make for F {}

/// Solves every case from rest in batches and one by one, by all stages, and prints how the results compare.
pub fn compare(subjects: &[Subject], gradients: usize, make: impl Make) -> Result<(), String> {
    println!(
        "| network | cases | in batches | left, solved by Newton | left, by other stages or not at all | different | iterations in batches, one by one | cases with others | \
         stress | tangent |\n|---|---|---|---|---|---|---|---|---|---|"
    );
    for kind in Kind::ALL {
        let of_kind = subjects.par_iter().filter(|subject| subject.kind == kind);
        let counts =
            of_kind.map(|subject| compare_network(subject, gradients, &make)).collect::<Result<Vec<_>, _>>()?;
        let sum = counts.into_iter().fold(Counts::default(), Counts::merge);
        println!(
            "| {} | {} | {} | {} | {} | {} | {}, {} | {} | {:.0e} | {:.0e} |",
            kind.name(),
            sum.cases,
            sum.in_batches,
            sum.left_by_newton,
            sum.left_by_others,
            sum.different,
            sum.iterations[0],
            sum.iterations[1],
            sum.other_iterations,
            sum.stress,
            sum.tangent
        );
    }
    Ok(())
}

fn compare_network(subject: &Subject, gradients: usize, make: &impl Make) -> Result<Counts, String> {
    let model = model(subject)?;
    let mut batch = make(&model)?;
    let params = EquilibriumParams::default();
    let targets: Vec<Matrix3<f64>> = random_gradients(subject, gradients).collect();
    let mut rves = vec![Rve::at_rest(&subject.network); targets.len()];
    let mut all: Vec<&mut Rve> = rves.iter_mut().collect();
    let found = batch.solve(&mut all, &targets, &params, &())?;
    let mut workspace = Workspace::new(&(), &model).map_err(|error| error.to_string())?;
    let mut counts = Counts::default();
    for (target, found) in targets.iter().zip(found) {
        counts.cases += 1;
        let mut rve = Rve::at_rest(&subject.network);
        let solved = equilibrate(&model, &mut rve, target, &params, &mut workspace);
        let expected = solved.ok().and_then(|mut solved| {
            let tangent = solved.tangent().ok()?;
            Some((solved.pk1(), tangent, solved.report().stage, solved.report().iterations))
        });
        let by_newton = expected.as_ref().is_some_and(|(.., stage, _)| *stage == Some(Stage::Newton));
        let Some(found) = found else {
            *(if by_newton { &mut counts.left_by_newton } else { &mut counts.left_by_others }) += 1;
            continue;
        };
        counts.in_batches += 1;
        match expected {
            Some((pk1, tangent, _, iterations)) if by_newton => {
                counts.other_iterations += usize::from(iterations != found.iterations);
                counts.iterations[0] += found.iterations;
                counts.iterations[1] += iterations;
                counts.stress = counts.stress.max((found.pk1 - pk1).norm() / pk1.norm());
                counts.tangent = counts.tangent.max((found.tangent - tangent).norm() / tangent.norm());
            }
            _ => counts.different += 1,
        }
    }
    Ok(counts)
}
