mod settling;

use nalgebra::Matrix3;
use thiserror::Error;

use super::*;
use crate::backends::sparse::Sparse;
use crate::fem::boundary::{BodyForce, Conditions, LoadCurve, SurfaceCondition};
use crate::fem::equilibrium::{EquilibriumError, LargestResidual};
use crate::fem::material::{MaterialError, NeoHookean};
use crate::fem::mesh::shapes;
use crate::fem::point_field::{FormulaField, PointError, PointResponses};
use crate::las::{NewtonError, NewtonParams, SolveError};

const MATERIAL: NeoHookean = NeoHookean { mu: 3.0e3, lambda: 5.0e3 };

/// Fixed at `x = 0`, the opposite face moved along x by `by`.
fn pushed(by: f64) -> Conditions {
    let held = |surface: &str, displacement| SurfaceCondition {
        surface: surface.into(),
        displacement,
        curve: LoadCurve::Ramp,
    };
    let surfaces = vec![held("x0", [Some(0.0); 3]), held("x1", [Some(by), Some(0.0), Some(0.0)])];
    Conditions { surfaces, ..Conditions::default() }
}

fn bar(cells: usize) -> Arc<Mesh> {
    Arc::new(shapes::cuboid([cells, 2, 2], [1.0, 0.4, 0.4]).unwrap())
}

fn stepper<P: PointField>(
    mesh: &Arc<Mesh>,
    conditions: &Conditions,
    field: P,
    params: StepParams,
) -> Stepper<Sparse, P> {
    Stepper::new(&(), Arc::clone(mesh), conditions, field, params).unwrap_or_else(|error| panic!("{error}"))
}

fn formula(mesh: &Mesh) -> FormulaField {
    FormulaField::uniform(MATERIAL, mesh)
}

/// Records all calls, and returns an error in step `stop_at`.
#[derive(Default)]
struct Log {
    converged: Vec<(usize, f64)>,
    displacements: Vec<[f64; 3]>,
    /// The largest displacement of all states, in absolute value.
    largest: f64,
    failed: Vec<(usize, f64, u32)>,
    stop_at: usize,
}

#[derive(Debug, Error, PartialEq)]
#[error("the disk is full")]
struct DiskFull;

impl<P: PointField, F: std::error::Error> StepObserver<P, F> for Log {
    type Error = DiskFull;

    fn converged(&mut self, step: &ConvergedStep<'_, P>) -> Result<(), DiskFull> {
        self.converged.push((step.step, step.t));
        self.displacements = step.state.displacements.clone();
        self.largest = self.displacements.as_flattened().iter().fold(self.largest, |m, u| m.max(u.abs()));
        if step.step == self.stop_at { Err(DiskFull) } else { Ok(()) }
    }

    fn failed(&mut self, attempt: &FailedAttempt<'_, P, F>) -> Result<(), DiskFull> {
        self.failed.push((attempt.step, attempt.t, attempt.halvings));
        Ok(())
    }
}

/// A material with memory: it fails if the increment of `F` is larger than `limit`.
struct Slow {
    formula: FormulaField,
    limit: f64,
    current: Vec<Matrix3<f64>>,
    committed: Vec<Matrix3<f64>>,
    commits: usize,
    reverts: usize,
    updates: usize,
    /// The number of the update whose tangents are zero, from 1; 0 for none.
    singular_at: usize,
    /// The mean of `F_11` over the points in each committed state.
    stretches: Vec<f64>,
}

impl Slow {
    fn new(mesh: &Mesh, limit: f64) -> Self {
        let at_rest = vec![Matrix3::identity(); mesh.elements().len()];
        let committed = at_rest.clone();
        let formula = formula(mesh);
        let (commits, reverts, updates, singular_at, stretches) = (0, 0, 0, 0, Vec::new());
        Self { formula, limit, current: at_rest, committed, commits, reverts, updates, singular_at, stretches }
    }
}

#[derive(Debug, Error)]
enum SlowError {
    #[error("element {0} cannot follow")]
    Left(usize),
    #[error(transparent)]
    Point(#[from] PointError),
}

impl PointField for Slow {
    type Error = SlowError;

    fn update(&mut self, gradients: &[Matrix3<f64>], out: &mut PointResponses) -> Result<(), SlowError> {
        self.updates += 1;
        self.current.copy_from_slice(gradients);
        let left = gradients.iter().zip(&self.committed).position(|(f, from)| (f - from).norm() > self.limit);
        left.map_or(Ok(()), |element| Err(SlowError::Left(element)))?;
        self.formula.update(gradients, out)?;
        if self.updates == self.singular_at {
            out.tangent.iter_mut().for_each(|tangent| tangent.fill(0.0));
        }
        Ok(())
    }

    fn commit(&mut self, _: bool) -> Result<(), Self::Error> {
        self.commits += 1;
        self.committed.copy_from_slice(&self.current);
        self.stretches.push(self.current.iter().map(|f| f[(0, 0)]).sum::<f64>() / self.current.len() as f64);
        Ok(())
    }

    fn revert(&mut self) -> Result<(), Self::Error> {
        self.reverts += 1;
        self.current.copy_from_slice(&self.committed);
        Ok(())
    }
}

#[test]
fn failed_steps_are_cut_and_end_in_the_state_of_uncut_ones() {
    let mesh = bar(4);
    let mut params = StepParams { count: 2, start: StepStart::Tangent, ..StepParams::default() };
    params.newton.max_backtracks = 0;
    let mut free = stepper(&mesh, &pushed(0.4), formula(&mesh), params);
    let uncut = free.run(&mut ()).unwrap();
    assert!(uncut.iter().all(|report| report.cuts == 0 && report.solves.len() == 1 && report.failures.is_empty()));

    let mut log = Log::default();
    let mut slow = stepper(&mesh, &pushed(0.4), Slow::new(&mesh, 0.1), params);
    let cut = slow.run(&mut log).unwrap();
    assert_eq!(log.converged, [(1, 0.5), (2, 1.0)], "only full steps are reported");
    assert_eq!(log.failed.len(), cut.iter().map(|report| report.cuts).sum::<usize>());
    assert!(cut[0].cuts >= 1 && cut[0].solves.len() >= 2, "{cut:?}");
    assert_eq!(log.failed[0], (1, 0.5, 0));
    assert_eq!(log.failed[1], (1, 0.25, 1), "halved");

    let substeps: usize = cut.iter().map(|report| report.solves.len()).sum();
    let field = slow.field();
    assert_eq!((field.commits, field.reverts), (1 + substeps, log.failed.len()));
    assert_eq!(field.committed, slow.state().gradients, "the committed micro states are those of the reported state");
    for (a, b) in free.state().displacements.as_flattened().iter().zip(slow.state().displacements.as_flattened()) {
        assert!((a - b).abs() < 1e-9, "{a} {b}");
    }
}

#[test]
fn no_state_is_evaluated_twice() {
    let mesh = bar(4);
    let params = StepParams { count: 3, start: StepStart::Tangent, ..StepParams::default() };
    let mut stepper = stepper(&mesh, &pushed(0.3), Slow::new(&mesh, 10.0), params);
    let reports = stepper.run(&mut ()).unwrap();
    let residuals: usize = reports.iter().flat_map(|report| &report.solves).map(|newton| newton.residuals.len()).sum();
    assert_eq!(stepper.field().updates, 1 + residuals, "one at rest, one a residual, none for a tangent");
}

#[test]
fn a_body_pressed_through_itself_keeps_its_last_state() {
    let mesh = bar(4);
    let mut log = Log::default();
    let params = StepParams { count: 5, max_cuts: 3, ..StepParams::default() };
    let mut stepper = stepper(&mesh, &pushed(-1.2), formula(&mesh), params);
    let error = stepper.run(&mut log).unwrap_err();
    let SteppingError::NotConverged { step, t, reached, increment, halvings, reason, .. } = error else {
        panic!("{error}");
    };
    assert_eq!((step, halvings), (log.converged.len() + 1, 3), "{reason}");
    // The body is flattened at 1 / 1.2; the smallest increment is 1 / 40.
    assert!(reached < 1.0 / 1.2 && (t - reached - increment).abs() < 1e-15 && (increment - 0.025).abs() < 1e-15);
    assert!(log.failed.len() >= 4);
    let state = stepper.state();
    assert_eq!(state.t, reached);
    let mut again = PointResponses::default();
    formula(&mesh).update(&state.gradients, &mut again).unwrap();
    assert_eq!(again, state.responses, "stresses belong to the displacements");
    let moved = mesh.nodes().iter().zip(&state.displacements).filter(|(x, _)| x[0] == 1.0);
    assert!(moved.count() > 0 && state.gradients.iter().all(|f| f.determinant() > 0.0));
    let (sum, scale) = (stepper.forces().sum(), stepper.forces().surfaces[0].force[0].abs());
    assert!(sum.iter().all(|f| f.abs() < 1e-7 * scale), "{sum:?} of {scale}");
}

#[test]
fn an_attempt_without_equilibrium_names_the_largest_residual() {
    let mesh = bar(4);
    let newton = NewtonParams { max_iterations: 1, ..NewtonParams::default() };
    let params = StepParams { count: 1, max_cuts: 0, newton, ..StepParams::default() };
    let mut stepper = stepper(&mesh, &pushed(0.3), formula(&mesh), params);
    let error = stepper.run(&mut ()).unwrap_err();
    let SteppingError::NotConverged {
        reason: NewtonError::TooManyIterations { residual, .. },
        largest_residual: Some(found),
        ..
    } = error
    else {
        panic!("{error}");
    };
    let LargestResidual { node, position, force, elements } = *found;
    assert!(force <= residual && force > residual / (mesh.nodes().len() as f64).sqrt(), "{force} of {residual}");
    assert!(position == mesh.nodes()[node] && position[0].abs() < 1.0, "a free node: {position:?}");
    let at_node = (0..mesh.elements().len()).filter(|&element| mesh.elements()[element].contains(&(node as u32)));
    assert_eq!(elements, at_node.take(4).collect::<Vec<_>>());
}

#[test]
fn an_inverted_trial_names_its_element() {
    let mesh = bar(4);
    let mut stepper =
        stepper(&mesh, &pushed(-1.2), formula(&mesh), StepParams { count: 1, max_cuts: 0, ..StepParams::default() });
    let error = stepper.run(&mut ()).unwrap_err();
    let SteppingError::NotConverged {
        reason: NewtonError::Problem(EquilibriumError::PointField(point)),
        reached: 0.0,
        ..
    } = error
    else {
        panic!("{error}");
    };
    assert!(matches!(point.reason, MaterialError::Inverted(determinant) if determinant <= 0.0));
    assert!(stepper.state().displacements.iter().all(|u| *u == [0.0; 3]));
}

#[test]
fn a_prescribed_start_that_inverts_elements_is_linearized_before_it_is_cut() {
    let mesh = bar(8);
    let run = |start| {
        let params = StepParams { count: 2, start, ..StepParams::default() };
        stepper(&mesh, &pushed(-0.4), formula(&mesh), params).run(&mut ()).unwrap()
    };
    // A cell is 0.125 long and the face moves by 0.2.
    let held = run(StepStart::Prescribed);
    assert_eq!(held.iter().map(|report| (report.linearized, report.cuts)).collect::<Vec<_>>(), [(1, 0), (1, 0)]);
    assert_eq!(held[1].iterations(), run(StepStart::Tangent)[1].iterations());
}

#[test]
fn a_singular_tangent_is_replaced_by_the_other_start_before_a_cut() {
    let mesh = bar(4);
    let params = StepParams { count: 2, ..StepParams::default() };
    let run = |singular_at| {
        let mut stepper = stepper(&mesh, &pushed(0.2), Slow { singular_at, ..Slow::new(&mesh, 10.0) }, params);
        let first = stepper.step(&mut ()).unwrap();
        let updates = stepper.field().updates;
        let second = stepper.step(&mut ()).unwrap();
        (updates, [first, second].map(|report| (report.linearized, report.cuts)))
    };
    let (updates, starts) = run(0);
    assert_eq!(starts, [(1, 0), (1, 0)]);
    // The last update of the first step belongs to its converged state.
    assert_eq!(run(updates), (updates, [(1, 0), (0, 0)]));
}

/// Returns the mean of `F_11` over all points (of equal volume) in each committed state, and the reports.
fn stretches(curve: &LoadCurve, params: StepParams) -> (Vec<f64>, Vec<StepReport>) {
    let mesh = bar(4);
    let mut conditions = pushed(0.5);
    conditions.surfaces[1].curve = curve.clone();
    let mut stepper = stepper(&mesh, &conditions, Slow::new(&mesh, 10.0), params);
    let reports = stepper.run(&mut ()).unwrap();
    (stepper.field().stretches.clone(), reports)
}

#[test]
fn increments_end_at_the_break_points_of_load_curves() {
    let peak = LoadCurve::table(&[[0.0, 0.0], [0.3, 1.0], [0.8, 0.2], [1.0, 0.2]]).unwrap();
    let (stretches, reports) = stretches(&peak, StepParams { count: 2, ..StepParams::default() });
    assert_eq!(reports.iter().map(|report| report.increments).collect::<Vec<_>>(), [2, 2]);
    // t = 0, 0.3, 0.5, 0.8, 1.
    for (found, expected) in stretches.iter().zip([1.0, 1.5, 1.34, 1.1, 1.1]) {
        assert!((found - expected).abs() < 1e-12, "{stretches:?}");
    }
    assert_eq!(stretches.len(), 5);
}

#[test]
fn adaptive_increments_shrink_and_grow_with_the_iterations() {
    let adaptive = AdaptiveIncrements { target_iterations: 1, largest: 0.5, smallest: 0.05 };
    let increments = IncrementControl::Adaptive(adaptive);
    let params = StepParams { count: 2, increments, ..StepParams::default() };
    let (fine, reports) = stretches(&LoadCurve::Ramp, params);
    assert!(reports[0].increments > 2 && reports.iter().all(|report| report.cuts == 0), "{reports:?}");
    assert!((fine[1] - 1.125).abs() < 1e-12, "half a step: {fine:?}");
    let rises: Vec<f64> = fine.windows(2).map(|pair| pair[1] - pair[0]).collect();
    assert!(rises.iter().all(|rise| *rise > 0.00625), "{rises:?}");
    let (_, coarse) = stretches(&LoadCurve::Ramp, StepParams { count: 2, ..StepParams::default() });
    assert_eq!(coarse.iter().map(|report| report.increments).collect::<Vec<_>>(), [1, 1]);

    // A point field that refuses long increments.
    let mesh = bar(4);
    let increments = IncrementControl::Adaptive(AdaptiveIncrements::default());
    let params = StepParams { count: 1, increments, ..StepParams::default() };
    let mut cut = stepper(&mesh, &pushed(0.4), Slow::new(&mesh, 0.1), params);
    let report = cut.step(&mut ()).unwrap();
    assert!(report.cuts >= 2 && report.increments >= 4, "{report:?}");
    let never = Slow::new(&mesh, 1e-4);
    let error = stepper(&mesh, &pushed(0.4), never, params).step(&mut ()).unwrap_err();
    assert!(error.to_string().contains("(6 halvings)"), "down to 1/64: {error}");
}

#[test]
fn the_observer_can_stop_a_run() {
    let mesh = bar(2);
    let mut log = Log { stop_at: 2, ..Log::default() };
    let mut stepper = stepper(&mesh, &pushed(0.1), formula(&mesh), StepParams { count: 4, ..StepParams::default() });
    assert_eq!(stepper.run(&mut log).unwrap_err(), SteppingError::Stopped { step: 2, t: 0.5, reason: DiskFull });
    assert_eq!(stepper.completed_steps(), 2);
    assert_eq!(stepper.state().displacements, log.displacements);
    log.stop_at = 0;
    assert_eq!(stepper.run(&mut log).unwrap().len(), 2, "what is left can still be run");
}

#[test]
fn a_restored_run_continues_bit_for_bit() {
    continues_bit_for_bit(IncrementControl::Halving);
    continues_bit_for_bit(IncrementControl::Adaptive(AdaptiveIncrements::default()));
}

fn continues_bit_for_bit(increments: IncrementControl) {
    let mesh = bar(4);
    let conditions = pushed(0.6);
    let params = StepParams { count: 4, increments, ..StepParams::default() };
    let new = || stepper(&mesh, &conditions, Slow::new(&mesh, 0.05), params);
    let mut whole = new();
    assert_eq!(whole.saved(), None, "nothing has converged");
    whole.step(&mut ()).unwrap();
    whole.step(&mut ()).unwrap();
    let (saved, memory) = (whole.saved().unwrap(), whole.field().committed.clone());
    let displacements = whole.state().displacements.clone();
    assert_eq!(saved.completed_steps, 2);
    assert!(saved.halvings > 0 || saved.increment < 1.0, "the increment has not grown back: {saved:?}");
    let expected = whole.run(&mut ()).unwrap();

    let mut other = new();
    let take_back = |field: &mut Slow| {
        field.committed.copy_from_slice(&memory);
        Ok::<(), DiskFull>(())
    };
    other.restore(&saved, &displacements, take_back).unwrap();
    assert_eq!((other.completed_steps(), other.saved()), (2, Some(saved.clone())));
    assert_eq!(other.state().displacements, displacements);
    let found = other.run(&mut ()).unwrap();
    assert_eq!(other.state(), whole.state());
    let history = |reports: &[StepReport]| -> Vec<_> {
        let all = reports.iter().flat_map(|report| report.solves.iter().chain(&report.failures));
        all.map(|newton| newton.residuals.clone()).collect()
    };
    assert_eq!(history(&found), history(&expected));

    let refused = |state: &SavedState, displacements: &[[f64; 3]]| {
        new().restore(state, displacements, |_| Ok::<(), DiskFull>(())).unwrap_err().to_string()
    };
    for done in [0, 5] {
        let said = format!("the state was saved after step {done}; this run has the steps 1 to 4");
        assert_eq!(refused(&SavedState { completed_steps: done, ..saved.clone() }, &displacements), said);
    }
    let nodes = mesh.nodes().len();
    let said = format!("the state has displacements of {} nodes; the mesh has {nodes} nodes", nodes - 1);
    assert_eq!(refused(&saved, &displacements[1..]), said);
    let mut lost = displacements.clone();
    lost[7][1] = f64::NAN;
    assert_eq!(refused(&saved, &lost), "the displacement of node 7 in the saved state is not a finite number");
    let error = new().restore(&saved, &displacements, |_| Err(DiskFull)).unwrap_err();
    assert!(matches!(error, RestoreError::Field(DiskFull)), "{error}");
}

#[test]
fn an_unconstrained_body_is_rejected() {
    let mesh = bar(2);
    let mut conditions = pushed(0.1);
    conditions.surfaces.remove(0);
    let refused = Stepper::<Sparse, _>::new(&(), mesh.clone(), &conditions, formula(&mesh), StepParams::default());
    assert_eq!(refused.err().map(|error| error.to_string()), None, "the other end is held");
    conditions.surfaces[0].displacement = [None, Some(0.0), Some(0.0)];
    let refused = Stepper::<Sparse, _>::new(&(), mesh.clone(), &conditions, formula(&mesh), StepParams::default());
    let free = "the body is free to move along x and to rotate about y and z";
    assert_eq!(refused.err().map(|error| error.to_string()).as_deref(), Some(free), "the face lies in the plane x = 1");
}

/// A liquid does not resist changes of shape.
#[test]
fn a_body_without_stiffness_is_not_cut() {
    let mesh = bar(2);
    let liquid = FormulaField::uniform(NeoHookean { mu: 0.0, lambda: 5.0e3 }, &mesh);
    let mut log = Log::default();
    let error = stepper(&mesh, &pushed(0.1), liquid, StepParams::default()).run(&mut log).unwrap_err();
    assert!(
        matches!(
            error,
            SteppingError::NotConverged {
                step: 1,
                halvings: 0,
                reason: NewtonError::Solve(SolveError::Singular { .. }),
                ..
            }
        ),
        "{error}"
    );
    assert_eq!(log.failed.len(), 1);
}

#[test]
fn a_body_without_unknowns_needs_no_iteration() {
    let mesh = Arc::new(shapes::cuboid([1, 1, 1], [1.0; 3]).unwrap());
    let mut stepper = stepper(&mesh, &pushed(0.2), formula(&mesh), StepParams { count: 2, ..StepParams::default() });
    assert_eq!(stepper.unknowns(), 0);
    let reports: Vec<StepReport> = stepper.run(&mut ()).unwrap();
    assert!(reports.iter().all(|report| report.iterations() == 0));
    let expected = stepper.state().responses.pk1[0][(0, 0)];
    let right = stepper.forces().surfaces.iter().find(|s| s.name == "x1").unwrap().force[0];
    assert!((right - expected).abs() < 1e-9 * expected, "{right} {expected}");
}

#[test]
fn loading_and_unloading_returns_to_the_initial_state() {
    let mesh = bar(4);
    let mut conditions = pushed(0.0);
    conditions.surfaces.truncate(1);
    let there_and_back = LoadCurve::table(&[[0.0, 0.0], [0.5, 1.0], [1.0, 0.0]]).unwrap();
    let force = BodyForce { region: "*".into(), value: [0.0, 300.0, 0.0], curve: there_and_back };
    conditions.loads.push(Arc::new(force));
    let mut log = Log::default();
    let mut stepper = stepper(&mesh, &conditions, formula(&mesh), StepParams { count: 4, ..StepParams::default() });
    stepper.run(&mut log).unwrap();
    assert!(log.largest > 0.05, "{}", log.largest);
    let left = stepper.state().displacements.as_flattened().iter().fold(0.0_f64, |m, u| m.max(u.abs()));
    assert!(left < 1e-7 * log.largest, "{left:e}");
}
