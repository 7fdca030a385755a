//! Semi-implicit time steps, with products on one backend and linear solves on another.

use std::sync::Arc;

use biotissue::backends::sparse::{Matrix, Vector};
use biotissue::las::{
    Backend, Iterative, Krylov, MatMat, MatVec, Method, Preconditioner, RealBackend, Solver, SolverParams, Symmetry,
    VectorOps, transfer,
};

use crate::operators::{BZ, Coupling, GAMMA_P, N, NODES, Operators, P, PSI, V, stencil};
use crate::{Error, Local};

/// Number of fields.
pub const FIELDS: usize = 7;
/// Number of time steps.
pub const STEPS: usize = 60;
/// Length of a time step.
pub const DT: f64 = 0.05;

/// The parameters of a simulation.
pub struct Case {
    /// Returns the density at rest at a position `x`, `y`.
    pub density: fn(f64, f64) -> f64,
    pub viscosity: f64,
    pub resistivity: f64,
    pub conduction: f64,
    pub diffusion: f64,
    /// Sets the initial fields, which are zero before the call.
    pub start: fn(&mut [Vector]),
}

/// The result of a simulation.
pub struct Outcome<S: Backend> {
    pub operators: Operators,
    /// The matrices of the linear solves.
    pub solved: Vec<Solved<S>>,
    /// The initial fields.
    pub start: Vec<Vector>,
    /// The final fields.
    pub fields: Vec<Vector>,
    /// The energy dissipated by all dissipative processes.
    pub dissipated: f64,
}

/// A matrix for linear solves on backend `S`, with its solver.
pub struct Solved<S: Backend> {
    pub name: &'static str,
    pub entries: usize,
    pub solves: usize,
    /// The number of Krylov iterations of all solves.
    pub iterations: usize,
    solver: S::Solver,
    b: S::Vector,
    x: S::Vector,
}

impl<S: RealBackend> Solved<S> {
    /// Transfers a matrix to `S` and sets up its solver.
    fn new(context: &S::Context, name: &'static str, a: &Matrix, method: Method) -> Result<Self, Error> {
        let pattern = Arc::clone(a.pattern());
        let a = transfer::matrix::<Local, S>(a, context)?;
        let mut params = SolverParams::new(Symmetry::Definite);
        params.method = method;
        let mut solver = S::solver(&S::analyze(context, &pattern, &params)?)?;
        solver.factor(&a)?;
        let (b, x) = (S::vector(context, pattern.rows())?, S::vector(context, pattern.rows())?);
        Ok(Self { name, entries: pattern.nnz(), solves: 0, iterations: 0, solver, b, x })
    }

    /// Computes `x = A^-1 b` for vectors of the backend `Local`.
    fn solve(&mut self, b: &Vector, x: &mut Vector) -> Result<(), Error> {
        transfer::vector_into::<Local, S>(b, &mut self.b)?;
        let report = self.solver.solve(&self.b, &mut self.x)?;
        self.solves += 1;
        self.iterations += report.iterations;
        Ok(transfer::vector_into::<S, Local>(&self.x, x)?)
    }
}

/// A diffusive process of some fields `u`: `capacity du/dt = -speed operator u`.
#[derive(Clone, Copy)]
struct Diffusion<'a> {
    name: &'static str,
    capacity: &'a Matrix,
    operator: &'a Matrix,
    speed: f64,
    fields: &'a [usize],
}

/// Computes `old = 2 halfway - old`: extrapolates from the start and the midpoint of a step to its end.
fn extrapolate<'a>(old: &mut Vector, halfway: impl Iterator<Item = &'a f64>) {
    old.as_mut_slice().iter_mut().zip(halfway).for_each(|(old, halfway)| *old = 2.0 * halfway - *old);
}

/// Runs all steps of a case, with the linear solves on backend `S`.
pub fn simulate<S: RealBackend>(context: &S::Context, case: &Case) -> Result<Outcome<S>, Error> {
    let operators = Operators::new(case)?;
    let (Operators { density, isotropic, along, .. }, one) = (&operators, stencil(&[(0, 0, 1.0)])?);
    let diffusion = |name, capacity, operator, speed, fields| Diffusion { name, capacity, operator, speed, fields };
    let diffusions = [
        diffusion("viscosity", density, isotropic, case.viscosity, &V),
        diffusion("resistivity", &one, isotropic, case.resistivity, &[PSI, BZ]),
        diffusion("conduction along the field", &one, along, case.conduction, &[P]),
        diffusion("diffusion of particles", &one, isotropic, case.diffusion, &[N]),
    ];
    let cg = Iterative {
        krylov: Krylov::Cg,
        preconditioner: Preconditioner::Diagonal,
        tolerance: 1e-13,
        max_iterations: 500,
    };
    let implicit = operators.implicit_velocity(DT)?;
    let mut velocity = Solved::<S>::new(context, "velocity", &implicit, Method::Direct)?;
    let mut diffusion_solves = Vec::new();
    for Diffusion { name, capacity, operator, speed, .. } in diffusions {
        let implicit = capacity.sum(1.0, operator, 0.5 * DT * speed)?;
        diffusion_solves.push(Solved::new(context, name, &implicit, Method::Iterative(cg))?);
    }

    let mut fields = vec![zeros(NODES); FIELDS];
    (case.start)(&mut fields);
    let start = fields.clone();
    let mut dissipated = 0.0;
    for _ in 0..STEPS {
        waves(&operators, &mut velocity, &mut fields)?;
        for (diffusion, solved) in diffusions.iter().zip(&mut diffusion_solves) {
            for &field in diffusion.fields {
                let weight = if field == PSI { Some(&operators.current) } else { None };
                let of_field = dissipate(diffusion, solved, &mut fields[field], weight)?;
                dissipated += match field {
                    P => of_field / GAMMA_P,
                    N => 0.0,
                    _ => of_field,
                };
            }
        }
    }
    let solved = std::iter::once(velocity).chain(diffusion_solves).collect();
    Ok(Outcome { operators, solved, start, fields, dissipated })
}

fn zeros(len: usize) -> Vector {
    vec![0.0; len].into()
}

/// Advances the wave equations by one step.
fn waves<S: RealBackend>(a: &Operators, velocity: &mut Solved<S>, fields: &mut [Vector]) -> Result<(), Error> {
    let (mut product, mut right, mut halfway) = (zeros(NODES), zeros(3 * NODES), zeros(3 * NODES));
    let inertia = V.map(|v| (v, v, &a.density, 1.0));
    let forces = a.forces.iter().map(|Coupling { to, from, a }| (*to, *from, a, 0.5 * DT));
    for (to, from, a, factor) in inertia.into_iter().chain(forces) {
        a.mul(&fields[from], &mut product)?;
        let of_nodes = right.as_mut_slice().chunks_exact_mut(3).zip(product.as_slice());
        of_nodes.for_each(|(node, value)| node[to] += factor * value);
    }
    velocity.solve(&right, &mut halfway)?;
    let component = |v: usize| halfway.as_slice().iter().skip(v).step_by(3);
    for Coupling { to, from, a } in &a.rates {
        let velocity = component(*from).copied().collect::<Vec<_>>().into();
        a.mul(&velocity, &mut product)?;
        fields[*to].axpy(DT, &product)?;
    }
    V.into_iter().for_each(|v| extrapolate(&mut fields[v], component(v)));
    Ok(())
}

/// Advances one field by one step of a diffusive process; returns the decrease of `1/2 field . weight capacity field`.
fn dissipate<S: RealBackend>(
    diffusion: &Diffusion,
    solved: &mut Solved<S>,
    field: &mut Vector,
    weight: Option<&Matrix>,
) -> Result<f64, Error> {
    let (mut product, mut halfway, mut weighted) = (zeros(NODES), zeros(NODES), zeros(NODES));
    diffusion.capacity.mul(field, &mut product)?;
    solved.solve(&product, &mut halfway)?;
    extrapolate(field, halfway.as_slice().iter());
    diffusion.operator.mul(&halfway, &mut product)?;
    let taken = match weight {
        Some(weight) => {
            weight.mul(&halfway, &mut weighted)?;
            weighted.dot(&product)?
        }
        None => halfway.dot(&product)?,
    };
    Ok(DT * diffusion.speed * taken)
}
