//! Times cuDSS, the direct solver of NVIDIA for sparse matrices, beside the kernels of this crate.
//!
//! The matrices are the stiffness of one network, many times with other values: a uniform batch, analyzed once. cuDSS
//! factors all of them and solves for one right-hand side. The kernels do the same in each iteration of Newton's method,
//! after forces and stiffness, so that their rate, of the cold increment of `bench-networks`, includes more work.
//!
//! The library, version 1.0 or later, is in the Python packages `nvidia-cudss-cu12` and `nvidia-cudss-cu13`; without it,
//! nothing is measured. `BIOTISSUE_NETWORKS` is a folder with the published `Network_2_7.txt`.
#![allow(unsafe_code, reason = "calls of cuDSS")]

use std::ffi::{c_int, c_void};
use std::path::Path;
use std::ptr;
use std::sync::Arc;
use std::time::Instant;

use biotissue::backends::cuda::Device;
use biotissue::backends::sparse::Sparse;
use biotissue::fiber::network::{Network, file, generate::delaunay};
use biotissue::fiber::rve::{Rve, RveModel};
use biotissue::fiber::stiffness::{StiffnessSlots, pattern};
use biotissue::fiber::workspace::Workspace;
use biotissue::las::{Backend, MatrixOps};
use cudarc::driver::{CudaContext, CudaSlice, CudaStream, DevicePtr};
use libloading::Library;

use crate::bench_networks::{on_device, targets};
use crate::networks::{batch_of, exponential, model_of};

/// Times that the batch is factored and solved.
const TIMES: u32 = 5;

/// A matrix in compressed rows: its upper triangle.
struct Upper {
    offsets: Vec<i32>,
    columns: Vec<i32>,
    values: Vec<f64>,
}

impl Upper {
    /// The stiffness of a network at rest.
    fn of(model: &RveModel<Sparse>) -> Self {
        let pattern = Arc::new(pattern(model.network()).unwrap());
        let mut workspace = Workspace::new(&(), model).unwrap();
        workspace.load_state(model, &Rve::at_rest(model.network()));
        let mut matrix = Sparse::matrix(&(), &pattern).unwrap();
        let slots = StiffnessSlots::<Sparse>::locate(&(), model.truss(), &pattern).unwrap();
        slots.assemble(model.truss(), workspace.states(), &mut Vec::new(), &mut matrix).unwrap();
        matrix.finish().unwrap();
        let mut upper = Self { offsets: vec![0], columns: Vec::new(), values: Vec::new() };
        for row in 0..pattern.rows() {
            let entries = pattern.row_offsets()[row] as usize..pattern.row_offsets()[row + 1] as usize;
            for at in entries.filter(|&at| pattern.col_indices()[at] as usize >= row) {
                upper.columns.push(pattern.col_indices()[at] as i32);
                upper.values.push(matrix.values()[at]);
            }
            upper.offsets.push(upper.columns.len() as i32);
        }
        upper
    }

    fn rows(&self) -> usize {
        self.offsets.len() - 1
    }

    /// The values of matrix `number` of a batch.
    fn values_of(&self, number: usize) -> impl Iterator<Item = f64> {
        let factor = 1.0 + 1e-3 * (number % 100) as f64;
        self.values.iter().map(move |value| factor * value)
    }

    /// Returns the largest component of `A x - 1` for matrix `number`.
    fn residual(&self, number: usize, x: &[f64]) -> f64 {
        let mut residual = vec![-1.0; self.rows()];
        let values: Vec<f64> = self.values_of(number).collect();
        for row in 0..self.rows() {
            let entries = self.offsets[row] as usize..self.offsets[row + 1] as usize;
            for (value, &column) in values[entries.clone()].iter().zip(&self.columns[entries]) {
                let column = column as usize;
                residual[row] += value * x[column];
                if column != row {
                    residual[column] += value * x[row];
                }
            }
        }
        residual.iter().fold(0.0, |most, r| r.abs().max(most))
    }
}

/// Numbers of the interface of cuDSS 1.0 and of CUDA's types.
mod numbers {
    use std::ffi::c_int;

    pub const INDEX_32: c_int = 10;
    pub const F64: c_int = 1;
    pub const POSITIVE_DEFINITE: c_int = 3;
    pub const UPPER: c_int = 2;
    pub const BASE_ZERO: c_int = 0;
    pub const COLUMNS: c_int = 0;
    pub const BATCH_SIZE: c_int = 18;
    pub const ANALYSIS: c_int = 3;
    pub const FACTORIZATION: c_int = 1 << 2;
    pub const REFACTORIZATION: c_int = 1 << 3;
    /// All parts of a solution.
    pub const SOLUTION: c_int = 0x3f0;
    pub const MAJOR_VERSION: c_int = 0;
}

type Handle = *mut c_void;

/// Calls a function of the library that returns a status.
macro_rules! call {
    ($library:expr, $name:ident($($argument:expr => $type:ty),*)) => {{
        // SAFETY: the types are those of the header of cuDSS 1.0; objects are alive, and memory has the sizes that they say.
        let status = unsafe {
            let function: libloading::Symbol<'_, unsafe extern "C" fn($($type),*) -> c_int> =
                $library.get(stringify!($name).as_bytes()).unwrap();
            function($($argument),*)
        };
        assert_eq!(status, 0, "{}", stringify!($name));
    }};
}

/// Many systems with one pattern.
struct Batch<'a> {
    library: &'a Library,
    stream: Arc<CudaStream>,
    handle: Handle,
    config: Handle,
    data: Handle,
    /// The matrices, the solutions and the right-hand sides.
    matrices: [Handle; 3],
    solutions: CudaSlice<f64>,
    /// What the matrices refer to.
    _memory: (CudaSlice<i32>, CudaSlice<i32>, CudaSlice<f64>, CudaSlice<f64>),
}

impl<'a> Batch<'a> {
    fn new(library: &'a Library, upper: &Upper, count: usize) -> Self {
        let context = CudaContext::new(0).unwrap();
        // SAFETY: one stream does all the work.
        unsafe { context.disable_event_tracking() };
        let stream = context.new_stream().unwrap();
        let values: Vec<f64> = (0..count).flat_map(|number| upper.values_of(number)).collect();
        let (offsets, columns) =
            (stream.clone_htod(&upper.offsets).unwrap(), stream.clone_htod(&upper.columns).unwrap());
        let values = stream.clone_htod(&values).unwrap();
        let right = stream.clone_htod(&vec![1.0; upper.rows() * count]).unwrap();
        let solutions: CudaSlice<f64> = stream.alloc_zeros(upper.rows() * count).unwrap();
        let (mut handle, mut config, mut data) = (ptr::null_mut(), ptr::null_mut(), ptr::null_mut());
        call!(library, cudssCreate(&mut handle => *mut Handle));
        call!(library, cudssSetStream(handle => Handle, stream.cu_stream().cast() => Handle));
        call!(library, cudssConfigCreate(&mut config => *mut Handle));
        call!(library, cudssDataCreate(handle => Handle, &mut data => *mut Handle));
        let size = count as c_int;
        call!(library, cudssConfigSet(
            config => Handle, numbers::BATCH_SIZE => c_int, ptr::from_ref(&size).cast() => *const c_void,
            size_of::<c_int>() => usize
        ));
        let mut matrices = [ptr::null_mut(); 3];
        let n = upper.rows() as i64;
        let at = |memory: &CudaSlice<f64>| memory.device_ptr(&stream).0 as *const c_void;
        let of_index = |memory: &CudaSlice<i32>| memory.device_ptr(&stream).0 as *const c_void;
        call!(library, cudssMatrixCreateCsr(
            &mut matrices[0] => *mut Handle, n => i64, n => i64, upper.columns.len() as i64 => i64,
            of_index(&offsets) => *const c_void, ptr::null() => *const c_void, of_index(&columns) => *const c_void,
            at(&values) => *const c_void, numbers::INDEX_32 => c_int, numbers::INDEX_32 => c_int, numbers::F64 => c_int,
            numbers::POSITIVE_DEFINITE => c_int, numbers::UPPER => c_int, numbers::BASE_ZERO => c_int
        ));
        for (matrix, memory) in matrices[1..].iter_mut().zip([&solutions, &right]) {
            call!(library, cudssMatrixCreateDn(
                matrix => *mut Handle, n => i64, 1 => i64, n => i64, at(memory) => *const c_void, numbers::F64 => c_int,
                numbers::COLUMNS => c_int
            ));
        }
        let _memory = (offsets, columns, values, right);
        Self { library, stream, handle, config, data, matrices, solutions, _memory }
    }

    fn execute(&self, phase: c_int) {
        let [matrix, solution, right] = self.matrices;
        call!(self.library, cudssExecute(
            self.handle => Handle, phase => c_int, self.config => Handle, self.data => Handle, matrix => Handle,
            solution => Handle, right => Handle
        ));
    }

    /// Returns the seconds of the analysis, and those in which all systems are factored and solved.
    fn run(&self) -> [f64; 2] {
        let start = Instant::now();
        self.execute(numbers::ANALYSIS);
        self.stream.synchronize().unwrap();
        let analysis = start.elapsed().as_secs_f64();
        self.execute(numbers::FACTORIZATION);
        self.execute(numbers::SOLUTION);
        self.stream.synchronize().unwrap();
        let start = Instant::now();
        for _ in 0..TIMES {
            self.execute(numbers::REFACTORIZATION);
            self.execute(numbers::SOLUTION);
        }
        self.stream.synchronize().unwrap();
        [analysis, start.elapsed().as_secs_f64() / f64::from(TIMES)]
    }
}

impl Drop for Batch<'_> {
    fn drop(&mut self) {
        for &matrix in &self.matrices {
            call!(self.library, cudssMatrixDestroy(matrix => Handle));
        }
        call!(self.library, cudssDataDestroy(self.handle => Handle, self.data => Handle));
        call!(self.library, cudssConfigDestroy(self.config => Handle));
        call!(self.library, cudssDestroy(self.handle => Handle));
    }
}

/// Loads the library; the reason if there is none that is new enough.
fn load() -> Result<Library, String> {
    // SAFETY: loads the library, whose initialization has no precondition.
    let names = ["libcudss.so.1", "libcudss.so"];
    let found = names.iter().find_map(|name| unsafe { Library::new(*name) }.ok());
    let library = found.ok_or("libcudss.so.1 was not found (Python package nvidia-cudss-cu12 or nvidia-cudss-cu13)")?;
    let mut version = 0;
    call!(library, cudssGetProperty(numbers::MAJOR_VERSION => c_int, &mut version => *mut c_int));
    if version >= 1 {
        Ok(library)
    } else {
        Err(format!("cuDSS has the version {version}; its interface changed with 1"))
    }
}

fn measure(device: &Device, library: &Library, name: &str, network: Network, counts: &[usize]) {
    let model = model_of(network, exponential());
    let upper = Upper::of(&model);
    println!("\n{name}: {} unknowns, {} entries of the upper triangle\n", upper.rows(), upper.columns.len());
    println!("| networks | cuDSS: analysis, s | factored and solved /s | kernels: iterations of Newton's method /s |");
    println!("|---:|---:|---:|---:|");
    for &count in counts {
        let [analysis, seconds] = {
            let batch = Batch::new(library, &upper, count);
            let seconds = batch.run();
            let solutions = batch.stream.clone_dtoh(&batch.solutions).unwrap();
            for number in [0, count - 1] {
                let residual = upper.residual(number, &solutions[number * upper.rows()..][..upper.rows()]);
                assert!(residual < 1e-8, "matrix {number}: the residual is {residual:e}");
            }
            seconds
        };
        let mut batch = batch_of(device, &model, true);
        let goals: Vec<_> = (0..count).map(targets).collect();
        on_device(&mut batch, &model, &goals).unwrap();
        let kernels = on_device(&mut batch, &model, &goals).unwrap();
        let iterations = (kernels.iterations[0] + 1.0) * count as f64 / kernels.seconds[0];
        println!("| {count} | {analysis:.3} | {:.0} | {iterations:.0} |", count as f64 / seconds);
    }
}

/// Prints the tables.
pub fn run(device: &Device) {
    let library = match load() {
        Ok(library) => library,
        Err(reason) => return println!("       skipped: {reason}"),
    };
    if let Some(folder) = std::env::var_os("BIOTISSUE_NETWORKS") {
        let network = file::read(&Path::new(&folder).join("Network_2_7.txt")).unwrap().network;
        measure(device, &library, "Network_2_7", network, &[1_000, 10_000, 33_792]);
    }
    measure(device, &library, "Delaunay 300", delaunay(300, 1).unwrap(), &[1_000, 10_000]);
}
