//! The same RVEs, solved by a pool of threads and by a pool of processes.

use std::sync::{Barrier, Mutex, PoisonError};
use std::time::Instant;

use biotissue::backends::comm::mpi::MpiComm;
use biotissue::backends::sparse::Sparse;
use biotissue::fiber::equilibrium::{EquilibriumParams, RveError, equilibrate};
use biotissue::fiber::rve::{Rve, RveModel, Sensitivities};
use biotissue::fiber::workspace::Workspace;
use biotissue::las::conformance::Random;
use biotissue::las::{Backend, Comm, SolveError};
use nalgebra::{Matrix3, SMatrix};

use super::Error;
use super::window::Window;

type Fault = <Sparse as Backend>::Error;

/// Seconds, summed over the RVEs of a sweep, and those of the sweep itself.
#[derive(Clone, Copy, Default)]
pub struct Parts {
    pub take: f64,
    pub read: f64,
    pub solve: f64,
    pub write: f64,
    /// Processor time of all parts.
    pub processor: f64,
    pub sweep: f64,
}

impl Parts {
    pub fn add(self, other: Self) -> Self {
        Self {
            take: self.take + other.take,
            read: self.read + other.read,
            solve: self.solve + other.solve,
            write: self.write + other.write,
            processor: self.processor + other.processor,
            sweep: self.sweep + other.sweep,
        }
    }
}

/// Returns the seconds since `start`, and starts again.
fn lap(start: &mut Instant) -> f64 {
    let now = Instant::now();
    (now - std::mem::replace(start, now)).as_secs_f64()
}

/// Returns the processor time of the calling thread, s; NaN where the system does not tell.
fn processor_time() -> f64 {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap_or_default();
    text.split_whitespace()
        .next()
        .and_then(|nanoseconds| nanoseconds.parse::<f64>().ok())
        .map_or(f64::NAN, |t| 1e-9 * t)
}

/// RVEs of one network, each with the state that the next solution starts from and the gradient of this solution.
pub struct Body<'a> {
    model: &'a RveModel<Sparse>,
    starts: Vec<Rve>,
    gradients: Vec<Matrix3<f64>>,
    /// The sum of all stresses, which does not depend on who solves.
    expected: Option<f64>,
}

/// The stress and the tangent of an RVE.
type Answer = SMatrix<f64, 9, 9>;

/// Solves an RVE as a sweep does, with its tangent and the prediction of the next solution.
fn solve(
    model: &RveModel<Sparse>,
    rve: &mut Rve,
    gradient: &Matrix3<f64>,
    workspace: &mut Workspace<Sparse>,
) -> Result<Answer, RveError<Fault>> {
    let mut solved = equilibrate(model, rve, gradient, &EquilibriumParams::default(), workspace)?;
    let tangent = solved.tangent()?;
    solved.keep_sensitivities()?;
    Ok(tangent)
}

/// Returns a workspace that has solved an RVE, and thus has all of its memory.
pub fn used_workspace(model: &RveModel<Sparse>) -> Result<Workspace<Sparse>, Error> {
    let mut workspace = Workspace::new(&(), model)?;
    let gradient = Matrix3::from_diagonal(&[1.02, 0.99, 1.0].into());
    solve(model, &mut Rve::at_rest(model.network()), &gradient, &mut workspace)?;
    Ok(workspace)
}

impl<'a> Body<'a> {
    /// Creates RVEs with random strains of up to 4 %, and increments of up to 2 %.
    pub fn new(model: &'a RveModel<Sparse>, rves: usize) -> Result<Self, Error> {
        let (mut random, mut workspace) = (Random::new(1), Workspace::new(&(), model)?);
        let mut strain = |size: f64| Matrix3::from_fn(|_, _| size * random.signed());
        let (mut starts, mut gradients) = (Vec::with_capacity(rves), Vec::with_capacity(rves));
        for _ in 0..rves {
            let (start, mut rve) = (Matrix3::identity() + strain(0.04), Rve::at_rest(model.network()));
            solve(model, &mut rve, &start, &mut workspace)?;
            starts.push(rve);
            gradients.push(start + strain(0.02));
        }
        let mut body = Self { model, starts, gradients, expected: None };
        body.expected = Some(body.traces(body.starts.clone(), &mut workspace)?);
        Ok(body)
    }

    fn traces(&self, rves: Vec<Rve>, workspace: &mut Workspace<Sparse>) -> Result<f64, RveError<Fault>> {
        let traces = rves.into_iter().zip(&self.gradients);
        traces.map(|(mut rve, gradient)| Ok(solve(self.model, &mut rve, gradient, workspace)?.trace())).sum()
    }

    /// Solves a few RVEs, so that all memory of the workspace and of the allocator is in use, as in a run.
    fn warm_up(&self, workspace: &mut Workspace<Sparse>) -> Result<(), RveError<Fault>> {
        let rves = self.starts.iter().take(5).cloned().collect();
        self.traces(rves, workspace).map(drop)
    }

    /// Checks that all RVEs were solved as one thread solves them.
    fn check(&self, sum: f64) {
        let expected = self.expected.unwrap_or(f64::NAN);
        assert!((sum - expected).abs() <= 1e-9 * expected.abs(), "{sum} instead of {expected}");
    }

    /// Solves all RVEs on threads, each of which takes the next one when it is free.
    pub fn sweep_on_threads(&self, threads: usize) -> Result<Parts, Error> {
        let mut rves = self.starts.clone();
        let workspaces: Result<Vec<_>, SolveError<Fault>> =
            (0..threads).map(|_| Workspace::new(&(), self.model)).collect();
        let (queue, barrier) = (Mutex::new(rves.iter_mut().zip(&self.gradients)), Barrier::new(threads + 1));
        let of_thread = |mut workspace: Workspace<Sparse>| -> Result<(Parts, f64), RveError<Fault>> {
            let (mut parts, mut sum) = (Parts::default(), 0.0);
            let warm = self.warm_up(&mut workspace);
            barrier.wait();
            warm?;
            let processor = processor_time();
            let mut time = Instant::now();
            loop {
                let next = queue.lock().unwrap_or_else(PoisonError::into_inner).next();
                parts.take += lap(&mut time);
                let Some((rve, gradient)) = next else {
                    parts.processor = processor_time() - processor;
                    return Ok((parts, sum));
                };
                sum += solve(self.model, rve, gradient, &mut workspace)?.trace();
                parts.solve += lap(&mut time);
            }
        };
        let workspaces = workspaces?;
        std::thread::scope(|scope| {
            let of_thread = &of_thread;
            let handles: Vec<_> =
                workspaces.into_iter().map(|workspace| scope.spawn(move || of_thread(workspace))).collect();
            barrier.wait();
            let start = Instant::now();
            let (mut all, mut sum) = (Parts::default(), 0.0);
            for handle in handles {
                let (parts, of_thread) = handle.join().map_err(|_| "a thread of the pool panicked")??;
                (all, sum) = (all.add(parts), sum + of_thread);
            }
            all.sweep = start.elapsed().as_secs_f64();
            self.check(sum);
            Ok(all)
        })
    }

    /// Bytes of the state of an RVE: its gradient, its interior nodes and their sensitivities.
    pub fn state_bytes(&self) -> usize {
        size_of::<Matrix3<f64>>() + self.model.network().interior().len() * (24 + size_of::<Sensitivities>())
    }

    /// Creates a window for a counter and the states and answers of all RVEs.
    pub fn window(&self, rank: usize) -> Window {
        Window::new(rank, size_of::<u64>() + self.starts.len() * self.stride())
    }

    fn stride(&self) -> usize {
        (self.state_bytes() + size_of::<Answer>()).next_multiple_of(64)
    }

    /// Solves all RVEs on processes, each of which takes the next one from the window when it is free. Collective.
    pub fn sweep_on_window(&self, comm: &MpiComm, window: &Window) -> Result<Parts, Error> {
        let place = |number: usize| size_of::<u64>() + number * self.stride();
        let mut workspace = Workspace::new(&(), self.model)?;
        self.warm_up(&mut workspace)?;
        if comm.rank() == 0 {
            window.set_counter(0);
            (0..).zip(&self.starts).for_each(|(number, rve)| self.write(window, place(number), rve.clone()));
        }
        window.synchronize();
        comm.barrier()?;
        window.synchronize();
        let (mut parts, mut sum) = (Parts::default(), 0.0);
        let processor = processor_time();
        let start = Instant::now();
        let mut time = start;
        loop {
            let number = window.fetch_add() as usize;
            parts.take += lap(&mut time);
            let Some(gradient) = self.gradients.get(number) else { break };
            let mut rve = self.read(window, place(number));
            parts.read += lap(&mut time);
            let answer = solve(self.model, &mut rve, gradient, &mut workspace)?;
            parts.solve += lap(&mut time);
            self.write(window, place(number), rve);
            window.write(place(number) + self.state_bytes(), bytemuck::cast_slice(answer.as_slice()));
            parts.write += lap(&mut time);
            sum += answer.trace();
        }
        parts.processor = processor_time() - processor;
        window.synchronize();
        let mut slowest = [start.elapsed().as_secs_f64()];
        comm.max(&mut slowest)?;
        let mut sums = [parts.take, parts.read, parts.solve, parts.write, parts.processor, sum];
        comm.sum(&mut sums)?;
        let [take, read, solve, write, processor, sum] = sums;
        self.check(sum);
        Ok(Parts { take, read, solve, write, processor, sweep: slowest[0] })
    }

    fn write(&self, window: &Window, place: usize, rve: Rve) {
        let (gradient, interior, sensitivities) = rve.into_parts();
        let of_gradient = size_of::<Matrix3<f64>>();
        window.write(place, bytemuck::cast_slice(gradient.as_slice()));
        window.write(place + of_gradient, bytemuck::cast_slice(&interior));
        let sensitivities = sensitivities.unwrap_or_default();
        window.write(place + of_gradient + 24 * interior.len(), bytemuck::cast_slice(&sensitivities));
    }

    fn read(&self, window: &Window, place: usize) -> Rve {
        let (nodes, of_gradient) = (self.model.network().interior().len(), size_of::<Matrix3<f64>>());
        let mut gradient = Matrix3::zeros();
        window.read(place, bytemuck::cast_slice_mut(gradient.as_mut_slice()));
        let (mut interior, mut sensitivities) = (vec![[0.0; 3]; nodes], vec![Sensitivities::default(); nodes]);
        window.read(place + of_gradient, bytemuck::cast_slice_mut(&mut interior));
        window.read(place + of_gradient + 24 * nodes, bytemuck::cast_slice_mut(&mut sensitivities));
        Rve::restored(gradient, interior, Some(sensitivities))
    }
}
