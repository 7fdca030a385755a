//! A cube of 24 tetrahedra extended by 25 %: the numbers that the single-scale program of MuMFiM printed for this
//! uniaxial extension are reproduced to all printed digits.
use std::fmt::Debug;
use std::sync::Arc;

use crate::bar_of_24::{NODES, RECORDED, mesh};
use biotissue::fem::assembly::{self, Assembler, Unknowns};
use biotissue::fem::boundary::{Boundary, Conditions, LoadCurve, PointCondition, PointLocation, SurfaceCondition};
use biotissue::fem::material::NeoHookean;
use biotissue::fem::point_field::{FormulaField, PointField, PointResponses};
use biotissue::fem::stepping::{ConvergedStep, StepObserver, StepParams, StepStart, Stepper};
use biotissue::las::{MatrixOps, NewtonParams, RealBackend, VectorOps};
#[cfg(feature = "sparse")]
use biotissue::{
    backends::sparse::Sparse,
    las::{Iterative, SolverParams},
};
use nalgebra::{DMatrix, Matrix3};

/// A node of the lateral side, and the component of its lateral displacement.
const LATERAL: (usize, usize) = (1, 1);

fn material() -> NeoHookean {
    let (youngs_modulus, poisson_ratio) = (10_000.0, 0.3);
    let mu = youngs_modulus / (2.0 * (1.0 + poisson_ratio));
    NeoHookean { mu, lambda: 2.0 * mu * poisson_ratio / (1.0 - 2.0 * poisson_ratio) }
}

fn conditions() -> Conditions {
    let surface = |name: &str, x| SurfaceCondition {
        surface: name.into(),
        displacement: [Some(x), None, None],
        curve: LoadCurve::Ramp,
    };
    let point =
        |node, displacement| PointCondition { place: PointLocation::Node(node), displacement, curve: LoadCurve::Ramp };
    Conditions {
        surfaces: vec![surface("left", 0.0), surface("right", 0.5)],
        points: vec![point(6, [Some(0.0); 3]), point(5, [None, None, Some(0.0)])],
        ..Conditions::default()
    }
}

fn assert_digits(found: f64, recorded: f64, relative: f64, what: &str) {
    let error = (found - recorded).abs() / recorded.abs();
    assert!(error <= relative, "{what}: {found:.13e}, recorded {recorded:.13e}, off by {error:.1e}");
}

/// Records the displacement [`LATERAL`] at the end of every step.
#[derive(Default)]
struct LateralDisplacements(Vec<f64>);

impl<P: PointField, F: std::error::Error> StepObserver<P, F> for LateralDisplacements {
    type Error = std::convert::Infallible;

    fn converged(&mut self, step: &ConvergedStep<'_, P>) -> Result<(), Self::Error> {
        self.0.push(step.state.displacements[LATERAL.0][LATERAL.1]);
        Ok(())
    }
}

fn residuals_and_displacements_are_as_recorded<B>()
where
    B: RealBackend<Context = ()>,
    B::Error: Debug,
{
    let mut newton = NewtonParams::default();
    newton.tolerance = 1e-10;
    newton.max_backtracks = 0;
    let params = StepParams { count: 10, max_cuts: 0, start: StepStart::Prescribed, newton, ..StepParams::default() };
    let field = FormulaField::uniform(material(), &mesh());
    let mut stepper = Stepper::<B, _>::new(&(), Arc::new(mesh()), &conditions(), field, params).unwrap();
    assert_eq!(stepper.unknowns(), 29);
    let mut lateral = LateralDisplacements::default();
    let reports = stepper.run(&mut lateral).unwrap();

    assert_eq!(reports.len(), 10);
    for ((report, (recorded, displacement)), found) in reports.iter().zip(RECORDED).zip(lateral.0) {
        let residuals = &report.solves[0].residuals;
        assert_eq!(report.solves.len(), 1);
        assert_eq!(residuals.len(), recorded.len() + 1, "one further residual is below the tolerance");
        for (k, (&norm, &recorded)) in residuals.iter().zip(recorded).enumerate() {
            // The terms that cancel in a residual are of the order of 1e3, so that a residual of 1e-3 has six
            // significant digits fewer.
            let relative = if recorded > 1e-2 { 1e-10 } else { 1e-8 };
            assert_digits(norm, recorded, relative, &format!("step {}, residual {k}", report.step));
        }
        assert!((found - displacement).abs() < 0.51e-8, "step {}: {found}, recorded {displacement}", report.step);
    }
    assert_homogeneous(&stepper.state().displacements, 1e-12);
}

/// Solves the linear systems by BiCGSTAB with an incomplete factorization.
#[test]
#[cfg(feature = "sparse")]
fn an_iterative_solver_gives_the_exact_solution() {
    let method = Iterative { tolerance: 1e-12, ..Iterative::default() };
    let params =
        StepParams { count: 4, solver: Some(SolverParams::default().iterative(method)), ..StepParams::default() };
    let field = FormulaField::uniform(material(), &mesh());
    let mesh = Arc::new(mesh());
    let mut stepper = Stepper::<Sparse, _>::new(&(), mesh, &conditions(), field, params).unwrap();
    for report in stepper.run(&mut ()).unwrap() {
        let newton = &report.solves[0];
        assert!(newton.linear_iterations > 0 && newton.cholesky == 0, "{newton:?}");
    }
    assert_homogeneous(&stepper.state().displacements, 1e-9);
}

/// Checks the exact solution: the stretches are 1.25 along x and `s` across, with `mu (s^2 - 1) + lambda ln J = 0` and
/// `J = 1.25 s^2`.
fn assert_homogeneous(displacements: &[[f64; 3]], tolerance: f64) {
    let NeoHookean { mu, lambda } = material();
    let mut s: f64 = 1.0;
    for _ in 0..50 {
        let value = mu * (s * s - 1.0) + lambda * (1.25 * s * s).ln();
        s -= value / (2.0 * mu * s + 2.0 * lambda / s);
    }
    for (x, u) in NODES.iter().zip(displacements) {
        let exact = [0.25 * (x[0] + 1.0), (s - 1.0) * (x[1] + 1.0), (s - 1.0) * x[2]];
        for i in 0..3 {
            assert!((u[i] - exact[i]).abs() < tolerance, "{x:?}: {u:?}, exact {exact:?}");
        }
    }
}

fn linear_stiffness_is_as_recorded<B>()
where
    B: RealBackend<Context = ()>,
    B::Error: Debug,
{
    let mesh = mesh();
    let boundary = Boundary::new(&mesh, &conditions()).unwrap();
    let prescribed = boundary.prescribed_mask(14);
    let unknowns = Unknowns::new(14, |node, component| prescribed[node][component]).unwrap();
    let mut matrix = B::matrix(&(), &Arc::new(unknowns.pattern(&mesh).unwrap())).unwrap();
    let assembler = Assembler::<B>::new(assembly::geometry(&mesh).unwrap(), &unknowns, &matrix).unwrap();
    let mut responses = PointResponses::zeros(24);
    FormulaField::uniform(material(), &mesh).update(&[Matrix3::identity(); 24], &mut responses).unwrap();
    assembler.stiffness(&[[0.0; 3]; 14], &[], &responses, &mut matrix).unwrap();
    matrix.finish().unwrap();

    let n = unknowns.free();
    assert_eq!(n, 29);
    let free: Vec<B::Index> = assembler
        .equation_numbers()
        .iter()
        .copied()
        .filter(|&row| biotissue::las::Index::position(row).is_some())
        .collect();
    let mut entries = vec![0.0; n * n];
    matrix.get(&free, &free, &mut entries).unwrap();
    let k = DMatrix::from_row_slice(n, n, &entries);
    let rows = k.row_iter().map(|row| row.iter().map(|v| v.abs()).sum::<f64>());
    let eigenvalues = k.clone().symmetric_eigen().eigenvalues;
    assert_digits(rows.fold(0.0, f64::max), 79487.179487, 1e-11, "largest row sum");
    assert_digits(k.norm(), 108000.931401, 1e-11, "Frobenius norm");
    assert_digits(eigenvalues.min(), 220.390523, 3e-9, "smallest eigenvalue");
    assert_digits(eigenvalues.max(), 41785.645566, 1e-10, "largest eigenvalue");

    let (mut moved, mut forces) = (vec![[0.0; 3]; 14], vec![[0.0; 3]; 14]);
    boundary.apply_prescribed(0.1, &mut moved, &mut []);
    assembler.linearized_forces(&[[0.0; 3]; 14], &responses, &moved, &mut forces);
    let mut rhs = B::vector(&(), n).unwrap();
    assembler.scatter(&mut forces, &[], &mut rhs).unwrap();
    rhs.finish().unwrap();
    let norm = rhs.with_local(|values| values.iter().map(|v| v * v).sum::<f64>().sqrt()).unwrap();
    assert_digits(norm, 1323.377409, 1e-9, "norm of the right-hand side");
}

macro_rules! on {
    ($($name:ident, $feature:literal: $backend:ty;)*) => {$(
        #[cfg(feature = $feature)]
        mod $name {
            #[test]
            fn residuals_and_displacements_are_as_recorded() {
                super::residuals_and_displacements_are_as_recorded::<$backend>();
            }

            #[test]
            fn linear_stiffness_is_as_recorded() {
                super::linear_stiffness_is_as_recorded::<$backend>();
            }
        }
    )*};
}

on! {
    sparse, "sparse": biotissue::backends::sparse::Sparse;
    dense, "dense": biotissue::backends::dense::Dense;
}
