//! Starts, stopping criteria and factorizations of Newton's method in load steps of a body.

use std::sync::Arc;

use biotissue::backends::sparse::Sparse;
use biotissue::fem::boundary::{Conditions, LoadCurve, SurfaceCondition};
use biotissue::fem::constraint::{ConstrainedVolume, ConstraintMethod, VolumeConstraint};
use biotissue::fem::element::ElementType;
use biotissue::fem::material::NeoHookean;
use biotissue::fem::mesh::shapes;
use biotissue::fem::point_field::{FormulaField, PointError, PointField, PointResponses};
use biotissue::fem::stepping::{StepParams, StepReport, StepStart, Stepper};
use biotissue::las::{SolverParams, Symmetry};
use nalgebra::Matrix3;

type Run = Stepper<Sparse, FormulaField>;

/// A box of length 1, held at `x0`, whose side `x1` moves along x by 0.3.
fn conditions(constraints: Vec<VolumeConstraint>) -> Conditions {
    let moved = |surface: &str, x| SurfaceCondition {
        surface: surface.into(),
        displacement: [Some(x), Some(0.0), Some(0.0)],
        curve: LoadCurve::Ramp,
    };
    Conditions { surfaces: vec![moved("x0", 0.0), moved("x1", 0.3)], constraints, ..Conditions::default() }
}

fn constant_volume() -> VolumeConstraint {
    VolumeConstraint {
        name: "volume".into(),
        of: ConstrainedVolume::Region("*".into()),
        curve: None,
        method: ConstraintMethod::Multiplier,
    }
}

/// Returns the run after its last step, and the numbers of iterations of the steps.
fn run(conditions: &Conditions, params: StepParams) -> (Run, Vec<usize>) {
    let mesh = shapes::cuboid_of(ElementType::Hex8, [6, 3, 3], [1.0, 0.4, 0.4]).unwrap();
    let field = FormulaField::uniform(NeoHookean { mu: 3.0e3, lambda: 5.0e3 }, &mesh);
    let mut run = Run::new(&(), Arc::new(mesh), conditions, field, params).unwrap();
    let reports = run.run(&mut ()).unwrap();
    assert!(reports.iter().all(|report| report.cuts == 0 && report.solves.len() == 1), "{reports:?}");
    (run, reports.iter().map(|report| report.iterations()).collect())
}

/// Returns the largest difference of two states in a displacement component, m.
fn distance(one: &Run, other: &Run) -> f64 {
    let pairs = one.state().displacements.iter().zip(&other.state().displacements);
    pairs.flat_map(|(u, v)| (0..3).map(move |i| (u[i] - v[i]).abs())).fold(0.0, f64::max)
}

/// The first step always starts from the linear-elastic solution, so that both take 3 iterations; then the linearized
/// start takes 3 and the other one 5.
#[test]
fn linearized_starts_take_fewer_iterations_to_the_same_state() {
    let from = |start| {
        let mut params = StepParams { count: 3, start, ..StepParams::default() };
        params.newton.tolerance = 1e-11;
        run(&conditions(Vec::new()), params)
    };
    let ((tangent, fewer), (prescribed, more)) = (from(StepStart::Tangent), from(StepStart::Prescribed));
    assert!(distance(&tangent, &prescribed) < 1e-11, "{:e}", distance(&tangent, &prescribed));
    assert_eq!(fewer[0], more[0]);
    assert!((1..3).all(|step| fewer[step] + 2 <= more[step]), "{fewer:?} {more:?}");
}

/// With a residual tolerance of 2 %, each additional criterion alone continues the iteration toward the converged state.
#[test]
fn each_additional_criterion_brings_the_state_closer_to_equilibrium() {
    for constraints in [Vec::new(), vec![constant_volume()]] {
        let conditions = conditions(constraints);
        let with = |tolerance, step_tolerance, energy_tolerance| {
            let mut params = StepParams { count: 1, ..StepParams::default() };
            params.newton.tolerance = tolerance;
            (params.newton.step_tolerance, params.newton.energy_tolerance) = (step_tolerance, energy_tolerance);
            let (run, iterations) = run(&conditions, params);
            (run, iterations[0])
        };
        let (converged, most) = with(1e-12, None, None);
        let (loose, least) = with(0.02, None, None);
        let far = distance(&loose, &converged);
        for (step, energy) in [(Some(1e-4), None), (None, Some(1e-6))] {
            let (closer, iterations) = with(0.02, step, energy);
            let near = distance(&closer, &converged);
            assert!(iterations > least && iterations <= most, "{step:?} {energy:?}: {iterations}, {least} to {most}");
            assert!(near < 0.01 * far, "{step:?} {energy:?}: {near:e}, {far:e}");
        }
    }
}

/// Formulas that claim to take as long as networks, so that every iteration factors its own stiffness.
struct Slow(FormulaField);

impl PointField for Slow {
    type Error = PointError;

    fn update(&mut self, gradients: &[Matrix3<f64>], out: &mut PointResponses) -> Result<(), PointError> {
        self.0.update(gradients, out)
    }

    fn commit(&mut self, ends_step: bool) -> Result<(), PointError> {
        self.0.commit(ends_step)
    }

    fn revert(&mut self) -> Result<(), PointError> {
        self.0.revert()
    }
}

/// Pulls a box whose factorization is costly in one step with a direct solver; the points are evaluated by the field that
/// `wrap` makes of the formulas. Returns the forces on all surfaces and the report of the step.
fn pull_a_large_box<P: PointField>(
    constraints: Vec<VolumeConstraint>,
    wrap: impl Fn(FormulaField) -> P,
) -> (Vec<[f64; 3]>, StepReport) {
    let mesh = shapes::cuboid([15; 3], [1.0; 3]).unwrap();
    let field = wrap(FormulaField::uniform(NeoHookean { mu: 3.0e3, lambda: 5.0e3 }, &mesh));
    let solver = Some(SolverParams::new(Symmetry::Definite));
    let params = StepParams { count: 1, solver, ..StepParams::default() };
    let mut run = Stepper::<Sparse, P>::new(&(), Arc::new(mesh), &conditions(constraints), field, params).unwrap();
    let report = run.run(&mut ()).unwrap().swap_remove(0);
    (run.forces().surfaces.iter().map(|surface| surface.force).collect(), report)
}

/// A linearized start factors the stiffness of the committed state. Where this is costly and the points are not, the
/// first iteration reuses it, so that `n` iterations have `n - 1` factorizations of their own. Without the constraint, this
/// step takes as many iterations as with `n` factorizations; with it, one more.
#[test]
fn the_first_iteration_reuses_the_factorization_of_the_linearized_start() {
    for (constraints, least_saved) in [(Vec::new(), 1), (vec![constant_volume()], 0)] {
        let (forces, report) = pull_a_large_box(constraints.clone(), |field| field);
        let (expected, slow) = pull_a_large_box(constraints, Slow);
        let largest = expected.as_flattened().iter().fold(0.0_f64, |most, force| most.max(force.abs()));
        for (force, expected) in forces.as_flattened().iter().zip(expected.as_flattened()) {
            assert!((force - expected).abs() < 1e-7 * largest, "{force} N instead of {expected} N");
        }
        let ([factorizations, kept], [without, none]) = (counts(&report), counts(&slow));
        assert_eq!([factorizations, kept], [report.iterations() - 1, 1]);
        assert_eq!([without, none], [slow.iterations(), 0]);
        assert!(factorizations + least_saved <= without, "{factorizations} factorizations instead of {without}");
    }
}

/// Returns the numbers of new and of reused factorizations in the Newton iterations of a step.
fn counts(report: &StepReport) -> [usize; 2] {
    let [solve] = &report.solves[..] else { panic!("one solution per step: {report:?}") };
    assert_eq!((report.cuts, report.linearized), (0, 1));
    [solve.cholesky + solve.ldlt + solve.lu, solve.kept]
}
