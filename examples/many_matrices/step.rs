//! Semi-implicit time steps: products on one backend, solutions on another.

use std::sync::Arc;

use biotissue::backends::sparse::{Matrix, Vector};
use biotissue::las::{
    Backend, Iterative, Krylov, MatMat, MatVec, Method, Preconditioner, RealBackend, Solver, SolverParams, Symmetry,
    VectorOps, transfer,
};

use crate::operators::{BZ, Coupling, GAMMA_P, N, NODES, Operators, P, PSI, V, stencil};
use crate::{Error, Local};

pub const FIELDS: usize = 7;
pub const STEPS: usize = 60;
pub const DT: f64 = 0.05;

/// The parameters of a simulation.
pub struct Case {
    /// Density by position.
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
    pub solved: Vec<Solved<S>>,
    pub start: Vec<Vector>,
    pub fields: Vec<Vector>,
    /// Energy dissipated by the dissipative processes.
    pub dissipated: f64,
}

/// A matrix of linear solves, on backend `S`.
pub struct Solved<S: Backend> {
    pub name: &'static str,
    pub entries: usize,
    pub solves: usize,
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

    /// Computes `x = A^-1 b` for vectors of the other backend.
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
struct Spread<'a> {
    name: &'static str,
    capacity: &'a Matrix,
    operator: &'a Matrix,
    speed: f64,
    fields: &'a [usize],
}

/// Computes `old = 2 halfway - old`: the end of a step from its start and midpoint.
fn go_on<'a>(old: &mut Vector, halfway: impl Iterator<Item = &'a f64>) {
    old.as_mut_slice().iter_mut().zip(halfway).for_each(|(old, halfway)| *old = 2.0 * halfway - *old);
}

/// Runs all steps of a case; solves on backend `S`.
pub fn simulate<S: RealBackend>(context: &S::Context, case: &Case) -> Result<Outcome<S>, Error> {
    let operators = Operators::new(case)?;
    let (Operators { density, spreading, along, .. }, one) = (&operators, stencil(&[(0, 0, 1.0)])?);
    let spread = |name, capacity, operator, speed, fields| Spread { name, capacity, operator, speed, fields };
    let spreads = [
        spread("viscosity", density, spreading, case.viscosity, &V),
        spread("resistivity", &one, spreading, case.resistivity, &[PSI, BZ]),
        spread("conduction along the field", &one, along, case.conduction, &[P]),
        spread("diffusion of particles", &one, spreading, case.diffusion, &[N]),
    ];
    let cg = Iterative {
        krylov: Krylov::Cg,
        preconditioner: Preconditioner::Diagonal,
        tolerance: 1e-13,
        max_iterations: 500,
    };
    let implicit = operators.implicit_velocity(DT)?;
    let mut velocity = Solved::<S>::new(context, "velocity", &implicit, Method::Direct)?;
    let mut spreading = Vec::new();
    for Spread { name, capacity, operator, speed, .. } in spreads {
        let implicit = capacity.sum(1.0, operator, 0.5 * DT * speed)?;
        spreading.push(Solved::new(context, name, &implicit, Method::Iterative(cg))?);
    }

    let mut fields = vec![zeros(NODES); FIELDS];
    (case.start)(&mut fields);
    let start = fields.clone();
    let mut dissipated = 0.0;
    for _ in 0..STEPS {
        waves(&operators, &mut velocity, &mut fields)?;
        for (spread, solved) in spreads.iter().zip(&mut spreading) {
            for &field in spread.fields {
                let weight = if field == PSI { Some(&operators.current) } else { None };
                let of_field = dissipate(spread, solved, &mut fields[field], weight)?;
                dissipated += match field {
                    P => of_field / GAMMA_P,
                    N => 0.0,
                    _ => of_field,
                };
            }
        }
    }
    let solved = std::iter::once(velocity).chain(spreading).collect();
    Ok(Outcome { operators, solved, start, fields, dissipated })
}

fn zeros(len: usize) -> Vector {
    vec![0.0; len].into()
}

/// Advances the wave equations by one step.
fn waves<S: RealBackend>(a: &Operators, velocity: &mut Solved<S>, fields: &mut [Vector]) -> Result<(), Error> {
    let (mut product, mut push, mut halfway) = (zeros(NODES), zeros(3 * NODES), zeros(3 * NODES));
    let inertia = V.map(|v| (v, v, &a.density, 1.0));
    let forces = a.forces.iter().map(|Coupling { to, from, a }| (*to, *from, a, 0.5 * DT));
    for (to, from, a, factor) in inertia.into_iter().chain(forces) {
        a.mul(&fields[from], &mut product)?;
        let of_nodes = push.as_mut_slice().chunks_exact_mut(3).zip(product.as_slice());
        of_nodes.for_each(|(node, value)| node[to] += factor * value);
    }
    velocity.solve(&push, &mut halfway)?;
    let component = |v: usize| halfway.as_slice().iter().skip(v).step_by(3);
    for Coupling { to, from, a } in &a.rates {
        let moved = component(*from).copied().collect::<Vec<_>>().into();
        a.mul(&moved, &mut product)?;
        fields[*to].axpy(DT, &product)?;
    }
    V.into_iter().for_each(|v| go_on(&mut fields[v], component(v)));
    Ok(())
}

/// Advances one field by one step of a diffusive process; returns the decrease of `1/2 field . weight capacity field`.
fn dissipate<S: RealBackend>(
    spread: &Spread,
    solved: &mut Solved<S>,
    field: &mut Vector,
    weight: Option<&Matrix>,
) -> Result<f64, Error> {
    let (mut product, mut halfway, mut weighted) = (zeros(NODES), zeros(NODES), zeros(NODES));
    spread.capacity.mul(field, &mut product)?;
    solved.solve(&product, &mut halfway)?;
    go_on(field, halfway.as_slice().iter());
    spread.operator.mul(&halfway, &mut product)?;
    let taken = match weight {
        Some(weight) => {
            weight.mul(&halfway, &mut weighted)?;
            weighted.dot(&product)?
        }
        None => halfway.dot(&product)?,
    };
    Ok(DT * spread.speed * taken)
}
