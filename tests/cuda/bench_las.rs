//! Times of products and of conjugate gradients on the device, beside `sparse` on all cores of the host and beside
//! cuSPARSE called by hand.
//!
//! The matrix is the stiffness of a cube, clamped at one side; `BIOTISSUE_BENCH_CELLS` is its number of cells per side
//! (default 64: 811,200 unknowns).

use std::ffi::c_void;
use std::ptr;
use std::sync::Arc;
use std::time::Instant;

use biotissue::backends::cuda::{Cuda, Device};
use biotissue::backends::sparse::Sparse;
use biotissue::las::{
    Backend, Iterative, Krylov, MatVec, Preconditioner, RealBackend, SolveReport, Solver, SolverParams, Sparsity,
    Symmetry, VectorOps,
};
use cudarc::cusparse::sys;
use cudarc::driver::{CudaContext, CudaFunction, CudaSlice, CudaStream, DevicePtr, LaunchConfig, PushKernelArg};

use crate::elasticity::{System, cube};

const TOLERANCE: f64 = 1e-8;

pub fn run(device: &Device) {
    let cells = std::env::var("BIOTISSUE_BENCH_CELLS").ok().and_then(|cells| cells.parse().ok()).unwrap_or(64);
    let clamped = |x: [f64; 3]| [x[0] == 0.0; 3];
    let start = Instant::now();
    let on_host = cube::<Sparse>(&(), cells, clamped);
    let assembled = start.elapsed().as_secs_f64();
    let start = Instant::now();
    let system = cube::<Cuda>(device, cells, clamped);
    println!("assembly on the host: sparse {assembled:.2} s, cuda {:.2} s", start.elapsed().as_secs_f64());
    let pattern = Arc::clone(on_host.matrix.pattern());
    let threads = std::thread::available_parallelism().map_or(1, |threads| threads.get());
    println!("{} unknowns, {} entries, {threads} threads of the host\n", pattern.rows(), pattern.nnz());

    println!("products y = A x; compressed rows have 12 bytes per entry\n{:<40}{:>10}{:>10}", "", "ms", "GB/s");
    let row = |name: &str, seconds: f64| {
        let bytes = 12 * pattern.nnz() + 20 * pattern.rows();
        println!("{name:<40}{:>10.3}{:>10.0}", 1e3 * seconds, bytes as f64 / seconds * 1e-9);
    };
    row("sparse", product_on_host(&on_host));
    let (mut x, mut y) = (Cuda::vector(device, pattern.rows()).unwrap(), Cuda::vector(device, pattern.rows()).unwrap());
    x.with_local_mut(|x| x.fill(1.0)).unwrap();
    row("cuda: cuSPARSE", repeated(device, 100, || system.matrix.mul(&x, &mut y).unwrap()));
    row("cuda: kernel of this crate", repeated(device, 100, || system.matrix.multiply_by_kernel(&x, &mut y).unwrap()));
    row("cuda: transposed", repeated(device, 20, || system.matrix.mul_transpose(&x, &mut y).unwrap()));
    let mut by_hand = ByHand::new(&pattern, system.matrix.values());
    row("cuSPARSE by hand, default algorithm", by_hand.product(DEFAULT));
    row("cuSPARSE by hand, repeatable algorithm", by_hand.product(REPEATABLE));
    let seconds = repeated(device, 100, || y.axpy(1e-3, &x).unwrap());
    println!("{:<40}{:>10.3}{:>10.0}", "axpy", 1e3 * seconds, 24.0 * pattern.rows() as f64 / seconds * 1e-9);
    let seconds = repeated(device, 100, || assert!(y.dot(&x).unwrap().is_finite()));
    println!("{:<40}{:>10.3}{:>10.0}", "dot", 1e3 * seconds, 16.0 * pattern.rows() as f64 / seconds * 1e-9);

    println!(
        "\nconjugate gradients to {TOLERANCE:.0e}\n{:<40}{:>10}{:>12}{:>12}{:>14}",
        "", "setup s", "iterations", "solution s", "ms/iteration"
    );
    for preconditioner in [Preconditioner::Diagonal, Preconditioner::Multigrid] {
        solution("sparse", preconditioner, solve(&(), &on_host, &pattern, preconditioner));
        solution("cuda", preconditioner, solve(device, &system, &pattern, preconditioner));
        if preconditioner == Preconditioner::Diagonal {
            let inverse: Vec<f64> = (0..pattern.rows())
                .map(|row| pattern.find(row, row).map_or(1.0, |at| 1.0 / on_host.matrix.values()[at]))
                .collect();
            let start = Instant::now();
            let iterations = by_hand.conjugate_gradients(&inverse);
            let seconds = start.elapsed().as_secs_f64();
            let report = SolveReport { iterations, residual: 0.0, fallbacks: 0 };
            solution("cuSPARSE by hand", preconditioner, (0.0, report, seconds));
        }
    }
}

fn solution(name: &str, preconditioner: Preconditioner, (setup, report, seconds): (f64, SolveReport, f64)) {
    let iterations = report.iterations;
    println!(
        "{:<40}{setup:>10.2}{iterations:>12}{seconds:>12.3}{:>14.3}",
        format!("{name}, {preconditioner:?}"),
        1e3 * seconds / iterations.max(1) as f64
    );
}

/// Returns the seconds of a product with `sparse`, the mean of several.
fn product_on_host(system: &System<Sparse>) -> f64 {
    let n = system.matrix.pattern().rows();
    let (x, mut y) = (vec![1.0; n].into(), vec![0.0; n].into());
    let mut product = || MatVec::<Sparse>::mul(&system.matrix, &x, &mut y).unwrap();
    product();
    let start = Instant::now();
    (0..20).for_each(|_| product());
    start.elapsed().as_secs_f64() / 20.0
}

/// Returns the seconds of some work on the device, the mean of several times.
fn repeated(device: &Device, times: u32, mut work: impl FnMut()) -> f64 {
    (0..3).for_each(|_| work());
    device.synchronize().unwrap();
    let start = Instant::now();
    (0..times).for_each(|_| work());
    device.synchronize().unwrap();
    start.elapsed().as_secs_f64() / f64::from(times)
}

/// Returns the seconds of the setup, the report, and the seconds of the second solution.
fn solve<B: RealBackend>(
    context: &B::Context,
    system: &System<B>,
    pattern: &Arc<Sparsity>,
    preconditioner: Preconditioner,
) -> (f64, SolveReport, f64) {
    let method = Iterative { preconditioner, tolerance: TOLERANCE, max_iterations: 5000, ..Iterative::new(Krylov::Cg) };
    let params = SolverParams::new(Symmetry::Definite).iterative(method);
    let start = Instant::now();
    let mut solver = B::solver(&B::analyze(context, pattern, &params).unwrap()).unwrap();
    solver.set_near_null_space(&system.near_null_space).unwrap();
    solver.factor(&system.matrix).unwrap();
    let setup = start.elapsed().as_secs_f64();
    let (mut b, mut x) = (B::vector(context, pattern.rows()).unwrap(), B::vector(context, pattern.rows()).unwrap());
    b.with_local_mut(|b| b.fill(1.0)).unwrap();
    b.finish().unwrap();
    solver.solve(&b, &mut x).unwrap();
    let start = Instant::now();
    let report = solver.solve(&b, &mut x).unwrap();
    x.with_local(|x| assert!(x[0].is_finite())).unwrap();
    (setup, report, start.elapsed().as_secs_f64())
}

const F64: sys::cudaDataType_t = sys::cudaDataType_t::CUDA_R_64F;
const DEFAULT: sys::cusparseSpMVAlg_t = sys::cusparseSpMVAlg_t::CUSPARSE_SPMV_ALG_DEFAULT;
const REPEATABLE: sys::cusparseSpMVAlg_t = sys::cusparseSpMVAlg_t::CUSPARSE_SPMV_CSR_ALG2;

/// The kernels that conjugate gradients need besides cuSPARSE.
const KERNELS: &str = r#"
extern "C" __global__ void axpy(size_t n, double a, const double *x, double *y) {
    size_t i = blockIdx.x * (size_t)blockDim.x + threadIdx.x;
    if (i < n) y[i] += a * x[i];
}
extern "C" __global__ void direction(size_t n, double beta, const double *z, double *p) {
    size_t i = blockIdx.x * (size_t)blockDim.x + threadIdx.x;
    if (i < n) p[i] = z[i] + beta * p[i];
}
extern "C" __global__ void scale(size_t n, const double *d, const double *r, double *z) {
    size_t i = blockIdx.x * (size_t)blockDim.x + threadIdx.x;
    if (i < n) z[i] = d[i] * r[i];
}
extern "C" __global__ void dot(size_t n, const double *x, const double *y, double *sum) {
    double own = 0;
    for (size_t i = blockIdx.x * (size_t)blockDim.x + threadIdx.x; i < n; i += gridDim.x * (size_t)blockDim.x) {
        own += x[i] * y[i];
    }
    for (int offset = 16; offset > 0; offset /= 2) own += __shfl_down_sync(0xffffffffu, own, offset);
    if (threadIdx.x % 32 == 0) atomicAdd(sum, own);
}
"#;

/// A program without this crate: the driver, cuSPARSE and four kernels.
struct ByHand {
    stream: Arc<CudaStream>,
    handle: sys::cusparseHandle_t,
    matrix: sys::cusparseSpMatDescr_t,
    n: usize,
    x: CudaSlice<f64>,
    y: CudaSlice<f64>,
    /// The arrays of the matrix.
    _offsets: CudaSlice<u32>,
    _columns: CudaSlice<u32>,
    _values: CudaSlice<f64>,
    axpy: CudaFunction,
    direction: CudaFunction,
    scale: CudaFunction,
    dot: CudaFunction,
}

fn checked(status: sys::cusparseStatus_t) {
    assert_eq!(status, sys::cusparseStatus_t::CUSPARSE_STATUS_SUCCESS);
}

#[allow(unsafe_code, reason = "calls of cuSPARSE and launches of kernels")]
impl ByHand {
    fn new(pattern: &Sparsity, values: &[f64]) -> Self {
        let context = CudaContext::new(0).unwrap();
        // SAFETY: one stream does all the work.
        unsafe { context.disable_event_tracking() };
        let stream = context.new_stream().unwrap();
        let module = context.load_module(cudarc::nvrtc::compile_ptx(KERNELS).unwrap()).unwrap();
        let kernel = |name| module.load_function(name).unwrap();
        let offsets = stream.clone_htod(pattern.row_offsets()).unwrap();
        let columns = stream.clone_htod(pattern.col_indices()).unwrap();
        let values = stream.clone_htod(values).unwrap();
        let (mut handle, mut matrix) = (ptr::null_mut(), ptr::null_mut());
        let n = pattern.rows();
        let index = sys::cusparseIndexType_t::CUSPARSE_INDEX_32I;
        // SAFETY: the arrays live as long as the matrix.
        unsafe {
            checked(sys::cusparseCreate(&mut handle));
            checked(sys::cusparseSetStream(handle, stream.cu_stream().cast()));
            checked(sys::cusparseCreateCsr(
                &mut matrix,
                n as i64,
                n as i64,
                pattern.nnz() as i64,
                offsets.device_ptr(&stream).0 as *mut c_void,
                columns.device_ptr(&stream).0 as *mut c_void,
                values.device_ptr(&stream).0 as *mut c_void,
                index,
                index,
                sys::cusparseIndexBase_t::CUSPARSE_INDEX_BASE_ZERO,
                F64,
            ));
        }
        Self {
            axpy: kernel("axpy"),
            direction: kernel("direction"),
            scale: kernel("scale"),
            dot: kernel("dot"),
            x: stream.clone_htod(&vec![1.0; n]).unwrap(),
            y: stream.alloc_zeros(n).unwrap(),
            handle,
            matrix,
            n,
            _offsets: offsets,
            _columns: columns,
            _values: values,
            stream,
        }
    }

    /// Returns a function that computes `y = A x`.
    fn prepared(&self, algorithm: sys::cusparseSpMVAlg_t, x: &CudaSlice<f64>, y: &CudaSlice<f64>) -> impl Fn() + use<> {
        let (mut of_x, mut of_y) = (ptr::null_mut(), ptr::null_mut());
        let (one, zero) = (1.0_f64, 0.0_f64);
        let plain = sys::cusparseOperation_t::CUSPARSE_OPERATION_NON_TRANSPOSE;
        let (handle, matrix, mut bytes) = (self.handle, self.matrix, 0);
        // SAFETY: the vectors have the sizes of the matrix and outlive the function.
        unsafe {
            let address = |v: &CudaSlice<f64>| v.device_ptr(&self.stream).0 as *mut c_void;
            checked(sys::cusparseCreateDnVec(&mut of_x, self.n as i64, address(x), F64));
            checked(sys::cusparseCreateDnVec(&mut of_y, self.n as i64, address(y), F64));
            checked(sys::cusparseSpMV_bufferSize(
                handle,
                plain,
                ptr::from_ref(&one).cast(),
                matrix,
                of_x,
                ptr::from_ref(&zero).cast(),
                of_y,
                F64,
                algorithm,
                &mut bytes,
            ));
        }
        let buffer: CudaSlice<u8> = self.stream.alloc_zeros(bytes.max(1)).unwrap();
        let stream = Arc::clone(&self.stream);
        move || {
            // SAFETY: as above.
            checked(unsafe {
                sys::cusparseSpMV(
                    handle,
                    plain,
                    ptr::from_ref(&one).cast(),
                    matrix,
                    of_x,
                    ptr::from_ref(&zero).cast(),
                    of_y,
                    F64,
                    algorithm,
                    buffer.device_ptr(&stream).0 as *mut c_void,
                )
            });
        }
    }

    fn product(&mut self, algorithm: sys::cusparseSpMVAlg_t) -> f64 {
        let multiply = self.prepared(algorithm, &self.x, &self.y);
        (0..3).for_each(|_| multiply());
        self.stream.synchronize().unwrap();
        let start = Instant::now();
        (0..100).for_each(|_| multiply());
        self.stream.synchronize().unwrap();
        start.elapsed().as_secs_f64() / 100.0
    }

    fn dot(&self, x: &CudaSlice<f64>, y: &CudaSlice<f64>, sum: &mut CudaSlice<f64>) -> f64 {
        let config = LaunchConfig { grid_dim: (264, 1, 1), block_dim: (256, 1, 1), shared_mem_bytes: 0 };
        self.stream.memset_zeros(sum).unwrap();
        let mut builder = self.stream.launch_builder(&self.dot);
        builder.arg(&self.n).arg(x).arg(y).arg(&mut *sum);
        // SAFETY: the arguments of the kernel.
        unsafe { builder.launch(config) }.unwrap();
        self.stream.clone_dtoh(sum).unwrap()[0]
    }

    /// Solves with a right-hand side of ones and the inverse of the diagonal; returns the number of iterations.
    fn conjugate_gradients(&mut self, inverse: &[f64]) -> usize {
        let (n, stream) = (self.n, Arc::clone(&self.stream));
        let each =
            LaunchConfig { grid_dim: (n.div_ceil(256) as u32, 1, 1), block_dim: (256, 1, 1), shared_mem_bytes: 0 };
        let vector = || stream.alloc_zeros::<f64>(n).unwrap();
        let (mut x, mut p, mut z, q) = (vector(), vector(), vector(), vector());
        let (mut r, d) = (stream.clone_htod(&vec![1.0; n]).unwrap(), stream.clone_htod(inverse).unwrap());
        let mut sum = stream.alloc_zeros::<f64>(1).unwrap();
        let multiply = self.prepared(DEFAULT, &p, &q);
        let target = TOLERANCE * self.dot(&r, &r, &mut sum).sqrt();
        let (mut rz, mut iterations) = (0.0, 0);
        loop {
            let mut builder = stream.launch_builder(&self.scale);
            builder.arg(&n).arg(&d).arg(&r).arg(&mut z);
            // SAFETY: the arguments of the kernel, here and below.
            unsafe { builder.launch(each) }.unwrap();
            let before = std::mem::replace(&mut rz, self.dot(&r, &z, &mut sum));
            let beta = if iterations == 0 { 0.0 } else { rz / before };
            let mut builder = stream.launch_builder(&self.direction);
            builder.arg(&n).arg(&beta).arg(&z).arg(&mut p);
            unsafe { builder.launch(each) }.unwrap();
            multiply();
            let step = rz / self.dot(&p, &q, &mut sum);
            for (factor, from, to) in [(step, &p, &mut x), (-step, &q, &mut r)] {
                let mut builder = stream.launch_builder(&self.axpy);
                builder.arg(&n).arg(&factor).arg(from).arg(to);
                unsafe { builder.launch(each) }.unwrap();
            }
            iterations += 1;
            if self.dot(&r, &r, &mut sum).sqrt() <= target || iterations == 5000 {
                return iterations;
            }
        }
    }
}
