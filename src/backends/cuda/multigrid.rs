//! Multigrid as a preconditioner: the host builds the levels, the device runs the cycle.
//!
//! A level is smoothed by a few steps of the Chebyshev iteration with the inverses of the diagonal blocks, before and
//! after the correction: the same polynomial of the matrix both times, so that the cycle is symmetric. The polynomial is
//! small on the upper part of the spectrum of `D^-1 A` (M. Adams, M. Brezina, J. Hu, R. Tuminaro, *Parallel multigrid
//! smoothing: polynomial versus Gauss-Seidel*, J. Comput. Phys. 188, 2003).

use std::sync::Arc;

use cudarc::driver::{CudaFunction, CudaSlice};

use super::algebra::{launch, of_reduction, per_entry, per_row, send, sent, zeros};
use super::solver::of_host;
use super::{Cuda, CudaError, Device, Failure, Matrix, Vector};
use crate::backends::direct::Pivots;
use crate::backends::iterative::ApproximateInverse;
use crate::backends::sparse::multigrid::{Blocks, Entry, LevelParts, Multigrid, MultigridParams, Parts};
use crate::las::{Sparsity, Symmetry, VectorOps};

/// Steps of the Chebyshev iteration before and after the correction.
const STEPS: usize = 2;

/// The lower end of the smoothed part of the spectrum, as a fraction of the upper end.
const LOWER_END: f64 = 0.2;

/// A multigrid preconditioner; also stores the matrix.
pub(super) struct DeviceMultigrid {
    device: Device,
    host: Multigrid,
    places: CudaSlice<u32>,
    /// The matrix by blocks, with its kernel.
    a: Option<(DeviceBlocks<f64>, CudaFunction)>,
    cycle: Option<Cycle>,
    /// Padded vectors of a product.
    padded: Option<Padded>,
}

struct Padded {
    x: CudaSlice<f64>,
    y: CudaSlice<f64>,
    pad: CudaFunction,
    unpad: CudaFunction,
}

/// A matrix of blocks on the device.
struct DeviceBlocks<T> {
    rows: u32,
    offsets: CudaSlice<u32>,
    columns: CudaSlice<u32>,
    values: CudaSlice<T>,
}

/// The levels on the device.
struct Cycle {
    levels: Vec<Level>,
    coarsest: Coarsest,
    unit: f64,
    pad: CudaFunction,
    unpad: CudaFunction,
    /// The largest entry of the vector that is preconditioned, and the buffers of its reduction.
    largest: CudaSlice<f64>,
    partial: CudaSlice<f64>,
    ticket: CudaSlice<u32>,
}

struct Level {
    a: DeviceBlocks<f32>,
    prolongation: DeviceBlocks<f32>,
    restriction: DeviceBlocks<f32>,
    inverse: CudaSlice<f32>,
    /// Number of unknowns of a node.
    size: usize,
    /// The coefficients `(alpha, beta)` of the Chebyshev iteration.
    steps: [(f32, f32); STEPS],
    b: CudaSlice<f32>,
    x: CudaSlice<f32>,
    change: CudaSlice<f32>,
    work: CudaSlice<f32>,
    kernels: Kernels,
}

struct Kernels {
    start: CudaFunction,
    step: CudaFunction,
    residual: CudaFunction,
    restrict: CudaFunction,
    prolong: CudaFunction,
}

/// The coarsest level: a dense inverse.
struct Coarsest {
    unknowns: u32,
    inverse: CudaSlice<f32>,
    b: CudaSlice<f32>,
    x: CudaSlice<f32>,
    multiply: CudaFunction,
}

impl<T: Entry + cudarc::driver::DeviceRepr + cudarc::driver::ValidAsZeroBits> DeviceBlocks<T> {
    fn new(device: &Device, a: &Blocks<T>) -> Result<Self, CudaError> {
        Ok(Self {
            rows: a.rows() as u32,
            offsets: sent(device, &a.offsets)?,
            columns: sent(device, &a.columns)?,
            values: sent(device, &a.values)?,
        })
    }

    /// Returns the launch of a product.
    fn launch(&self) -> cudarc::driver::LaunchConfig {
        per_row(self.rows as usize)
    }
}

/// Returns the coefficients `(alpha, beta)` of the steps `d = alpha d + beta D^-1 (b - A x)`, `x += d` of the Chebyshev
/// iteration for eigenvalues of `D^-1 A` up to `upper`.
fn chebyshev_steps(upper: f64) -> [(f32, f32); STEPS] {
    let lower = LOWER_END * upper;
    let (center, radius) = (0.5 * (upper + lower), 0.5 * (upper - lower));
    let sigma = center / radius;
    let mut rho = 1.0 / sigma;
    std::array::from_fn(|step| {
        if step == 0 {
            return (0.0, (1.0 / center) as f32);
        }
        let before = rho;
        rho = 1.0 / (2.0 * sigma - before);
        ((rho * before) as f32, (2.0 * rho / radius) as f32)
    })
}

impl Level {
    fn new(device: &Device, parts: &LevelParts<'_>) -> Result<Self, CudaError> {
        let LevelParts { a, prolongation, restriction, inverse, largest_eigenvalue } = parts;
        let (size, unknowns) = (a.size.0, a.rows() * a.size.0);
        let algebra = device.algebra()?;
        let kernel = |name: &str| algebra.matrix_kernel(name);
        let of_sizes = |a: &Blocks<f32>| format!("{}{}", a.size.0, a.size.1);
        Ok(Self {
            a: DeviceBlocks::new(device, a)?,
            prolongation: DeviceBlocks::new(device, prolongation)?,
            restriction: DeviceBlocks::new(device, restriction)?,
            inverse: sent(device, inverse)?,
            size,
            steps: chebyshev_steps(*largest_eigenvalue),
            b: zeros(device, unknowns)?,
            x: zeros(device, unknowns)?,
            change: zeros(device, unknowns)?,
            work: zeros(device, unknowns)?,
            kernels: Kernels {
                start: kernel(&format!("chebyshev_start_{size}"))?,
                step: kernel(&format!("chebyshev_{size}"))?,
                residual: kernel(&format!("residual_{size}"))?,
                restrict: kernel(&format!("product_float_{}", of_sizes(restriction)))?,
                prolong: kernel(&format!("product_add_{}", of_sizes(prolongation)))?,
            },
        })
    }

    /// Sends the numbers of a hierarchy with the same patterns.
    fn update(&mut self, device: &Device, parts: &LevelParts<'_>) -> Result<(), CudaError> {
        send(device, &parts.a.values, &mut self.a.values)?;
        send(device, &parts.prolongation.values, &mut self.prolongation.values)?;
        send(device, &parts.restriction.values, &mut self.restriction.values)?;
        send(device, &parts.inverse, &mut self.inverse)?;
        self.steps = chebyshev_steps(parts.largest_eigenvalue);
        Ok(())
    }

    /// Smooths from zero.
    fn pre_smooth(&mut self, device: &Device) -> Result<(), CudaError> {
        let Self { a, inverse, size, steps, b, x, change, kernels, .. } = self;
        let (rows, beta) = (a.rows, steps[0].1);
        launch!(device, &kernels.start, per_entry(rows as usize * *size), &rows, inverse, &beta, b, change, x)?;
        (1..STEPS).try_for_each(|step| self.smooth(device, step))
    }

    /// Smooths from the current solution.
    fn post_smooth(&mut self, device: &Device) -> Result<(), CudaError> {
        (0..STEPS).try_for_each(|step| self.smooth(device, step))
    }

    fn smooth(&mut self, device: &Device, step: usize) -> Result<(), CudaError> {
        let Self { a, inverse, steps, b, x, change, work, kernels, .. } = self;
        let DeviceBlocks { rows, offsets, columns, values } = a;
        let (alpha, beta) = steps[step];
        let launch = per_row(*rows as usize);
        launch!(
            device,
            &kernels.step,
            launch,
            &*rows,
            &*offsets,
            &*columns,
            &*values,
            &*inverse,
            &alpha,
            &beta,
            &*b,
            &*x,
            &mut *change,
            &mut *work
        )?;
        std::mem::swap(x, work);
        Ok(())
    }

    /// Restricts the residual to the right-hand side of the next level.
    fn restrict(&mut self, device: &Device, coarse: &mut CudaSlice<f32>) -> Result<(), CudaError> {
        let Self { a, restriction: r, b, x, work, kernels, .. } = self;
        let launch = a.launch();
        launch!(device, &kernels.residual, launch, &a.rows, &a.offsets, &a.columns, &a.values, &*x, &*b, &mut *work)?;
        launch!(device, &kernels.restrict, r.launch(), &r.rows, &r.offsets, &r.columns, &r.values, &*work, coarse)
    }

    /// Adds the correction of the next level.
    fn prolong(&mut self, device: &Device, coarse: &CudaSlice<f32>) -> Result<(), CudaError> {
        let Self { prolongation: p, x, kernels, .. } = self;
        launch!(device, &kernels.prolong, p.launch(), &p.rows, &p.offsets, &p.columns, &p.values, coarse, &mut *x)
    }
}

impl Cycle {
    fn new(device: &Device, parts: &Parts<'_>, padded: usize) -> Result<Self, CudaError> {
        let algebra = device.algebra()?;
        let levels = parts.levels.iter().map(|level| Level::new(device, level)).collect::<Result<Vec<_>, _>>()?;
        let largest_reduction = of_reduction(padded).grid_dim.0 as usize;
        Ok(Self {
            levels,
            coarsest: Coarsest {
                unknowns: parts.coarsest as u32,
                inverse: sent(device, &parts.inverse)?,
                b: zeros(device, parts.coarsest)?,
                x: zeros(device, parts.coarsest)?,
                multiply: algebra.matrix_kernel("dense")?,
            },
            unit: parts.unit,
            pad: algebra.matrix_kernel("pad_scaled")?,
            unpad: algebra.matrix_kernel("unpad_scaled")?,
            largest: zeros(device, 1)?,
            partial: zeros(device, largest_reduction)?,
            ticket: zeros(device, 1)?,
        })
    }

    /// Sends the numbers of a hierarchy with the same patterns.
    fn update(&mut self, device: &Device, parts: &Parts<'_>) -> Result<(), CudaError> {
        self.unit = parts.unit;
        for (level, parts) in self.levels.iter_mut().zip(&parts.levels) {
            level.update(device, parts)?;
        }
        send(device, &parts.inverse, &mut self.coarsest.inverse)
    }

    /// Computes `y`, an approximation of `A^-1 x`, by a V-cycle; both have `n` entries.
    fn apply(
        &mut self,
        device: &Device,
        n: usize,
        places: &CudaSlice<u32>,
        x: &CudaSlice<f64>,
        y: &mut CudaSlice<f64>,
    ) -> Result<(), CudaError> {
        let Self { levels, coarsest, unit, pad, unpad, largest, partial, ticket } = self;
        // Single precision has a smaller range.
        let reduction = &device.algebra()?.largest;
        launch!(device, reduction, of_reduction(n), &n, x, &mut *partial, &mut *ticket, &mut *largest)?;
        let b = levels.first_mut().map_or(&mut coarsest.b, |first| &mut first.b);
        launch!(device, &*pad, per_entry(n), &n, places, x, &*largest, b)?;
        for number in 0..levels.len() {
            let (finer, coarser) = levels.split_at_mut(number + 1);
            let Some(level) = finer.last_mut() else { break };
            level.pre_smooth(device)?;
            let b = coarser.first_mut().map_or(&mut coarsest.b, |next| &mut next.b);
            level.restrict(device, b)?;
        }
        let Coarsest { unknowns, inverse, b, x: solution, multiply } = coarsest;
        launch!(device, &*multiply, per_row(*unknowns as usize), &*unknowns, &*inverse, &*b, &mut *solution)?;
        for number in (0..levels.len()).rev() {
            let (finer, coarser) = levels.split_at_mut(number + 1);
            let Some(level) = finer.last_mut() else { break };
            level.prolong(device, coarser.first().map_or(&*solution, |next| &next.x))?;
            level.post_smooth(device)?;
        }
        let solution = levels.first().map_or(&*solution, |first| &first.x);
        launch!(device, &*unpad, per_entry(n), &n, places, solution, &*largest, &*unit, y)
    }
}

impl DeviceMultigrid {
    pub fn new(device: &Device, pattern: &Arc<Sparsity>, symmetry: Symmetry) -> Result<Self, Failure> {
        let host = Multigrid::new(pattern, symmetry, MultigridParams::default()).map_err(of_host)?;
        let places = sent(device, &host.places())?;
        Ok(Self { device: device.clone(), host, places, a: None, cycle: None, padded: None })
    }

    /// Copies a matrix to the host's and the device's blocks.
    fn copy(&mut self, a: &Matrix) -> Result<(), Failure> {
        self.host.copy_matrix(a.on_host()).map_err(of_host)?;
        let blocks = self.host.matrix_by_blocks();
        let device = &self.device;
        if let Some((copy, _)) = &mut self.a {
            send(device, &blocks.values, &mut copy.values)?;
            return Ok(());
        }
        let size = blocks.size.0;
        let algebra = device.algebra()?;
        if !self.host.is_unpadded() {
            let padded = || zeros(device, blocks.rows() * size);
            let (pad, unpad) = (algebra.matrix_kernel("pad")?, algebra.matrix_kernel("unpad")?);
            self.padded = Some(Padded { x: padded()?, y: padded()?, pad, unpad });
        }
        let kernel = algebra.matrix_kernel(&format!("product_double_{size}{size}"))?;
        self.a = Some((DeviceBlocks::new(device, blocks)?, kernel));
        Ok(())
    }
}

impl ApproximateInverse<Cuda> for DeviceMultigrid {
    fn compute(&mut self, a: &Matrix) -> Result<Option<Pivots>, Failure> {
        self.cycle = None;
        self.copy(a)?;
        self.host.build().map_err(of_host)?;
        let unknowns = a.pattern().rows();
        let parts = self.host.parts().map_err(of_host)?;
        self.cycle = Some(Cycle::new(&self.device, &parts, unknowns)?);
        Ok(None)
    }

    fn keep(&mut self, a: &Matrix) -> Result<bool, Failure> {
        self.copy(a)?;
        Ok(true)
    }

    fn refresh(&mut self) -> Result<(), Failure> {
        self.host.refresh().map_err(of_host)?;
        let parts = self.host.parts().map_err(of_host)?;
        if let Some(cycle) = &mut self.cycle {
            cycle.update(&self.device, &parts)?;
        }
        Ok(())
    }

    fn apply(&mut self, x: &Vector, y: &mut Vector) -> Result<(), Failure> {
        let Some(cycle) = &mut self.cycle else { return Err(Failure::NotFactored) };
        let n = x.len();
        Ok(cycle.apply(&self.device, n, &self.places, &*x.on_device()?, &mut *y.overwrite()?)?)
    }

    fn stores_matrix(&self) -> bool {
        true
    }

    fn product(&mut self, x: &Vector, y: &mut Vector) -> Result<(), Failure> {
        let Some((a, kernel)) = &self.a else { return Err(Failure::NotFactored) };
        let (device, n, places) = (&self.device, x.len(), &self.places);
        let (x, mut y) = (x.on_device()?, y.overwrite()?);
        let Some(Padded { x: padded_x, y: padded_y, pad, unpad }) = &mut self.padded else {
            launch!(device, kernel, a.launch(), &a.rows, &a.offsets, &a.columns, &a.values, &*x, &mut *y)?;
            return Ok(());
        };
        launch!(device, &*pad, per_entry(n), &n, places, &*x, &mut *padded_x)?;
        let launch = a.launch();
        launch!(device, kernel, launch, &a.rows, &a.offsets, &a.columns, &a.values, &*padded_x, &mut *padded_y)?;
        launch!(device, &*unpad, per_entry(n), &n, places, &*padded_y, &mut *y)?;
        Ok(())
    }

    fn matrix(&self) -> Option<Matrix> {
        Some(Matrix::of_host(&self.device, self.host.matrix()))
    }

    fn uses_near_null_space(&self) -> bool {
        true
    }

    fn set_near_null_space(&mut self, vectors: &[Vec<f64>]) -> Result<(), Failure> {
        self.host.set_near_null_space(vectors).map_err(of_host)
    }
}
