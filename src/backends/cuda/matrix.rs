//! The matrix: compressed rows on the host, whose values are sent to the device.

use std::cell::{Cell, OnceCell, RefCell, RefMut};
use std::sync::Arc;

use cudarc::driver::CudaSlice;

use super::algebra::{launch, per_row, send, zeros};
use super::cusparse::Descriptor;
use super::pattern::DevicePattern;
use super::{Cuda, CudaError, Device, Failure, Vector};
use crate::backends::checks::check_size;
use crate::backends::csr;
use crate::las::{BlockSlots, Entries, MatMat, MatVec, MatrixOps, NodePositions, Sparsity, VectorOps};

/// A matrix of compressed rows, assembled on the host and multiplied on the device.
///
/// The device gets memory for it, and its values, by the first product; from then on [`MatrixOps::finish`] sends the
/// values that were written, in one transfer. Matrices of one pattern share its copy on the device.
pub struct Matrix {
    device: Device,
    host: csr::Matrix<f64>,
    copy: OnceCell<RefCell<DeviceCopy>>,
    is_sent: Cell<bool>,
}

/// A matrix on the device.
struct DeviceCopy {
    /// Refers to the values and the pattern.
    descriptor: Option<Descriptor>,
    values: CudaSlice<f64>,
    pattern: Arc<DevicePattern>,
}

impl DeviceCopy {
    /// Allocates a copy of a matrix with this pattern.
    fn new(device: &Device, pattern: &Arc<Sparsity>) -> Result<Self, CudaError> {
        let algebra = device.algebra()?;
        let (values, on_device) = (zeros(device, pattern.nnz())?, algebra.pattern(device, pattern)?);
        let descriptor = match &algebra.library {
            Some(library) => library.describe(device, pattern, &on_device, &values)?,
            None => None,
        };
        Ok(Self { descriptor, values, pattern: on_device })
    }
}

/// Does not copy the values on the device: the first product sends them. `clone_from` keeps the memory there if both
/// matrices have the same pattern.
impl Clone for Matrix {
    fn clone(&self) -> Self {
        Self::of_host(&self.device, self.host.clone())
    }

    fn clone_from(&mut self, from: &Self) {
        if !Arc::ptr_eq(self.host.pattern(), from.host.pattern()) || !self.device.is_same(&from.device) {
            *self = from.clone();
            return;
        }
        self.host.clone_from(&from.host);
        self.is_sent.set(false);
    }
}

impl Matrix {
    pub(super) fn zeros(device: &Device, pattern: &Arc<Sparsity>) -> Self {
        Self::of_host(device, csr::Matrix::zeros(pattern))
    }

    pub(super) fn of_host(device: &Device, host: csr::Matrix<f64>) -> Self {
        Self { device: device.clone(), host, copy: OnceCell::new(), is_sent: Cell::new(false) }
    }

    /// Returns the sparsity pattern.
    pub fn pattern(&self) -> &Arc<Sparsity> {
        self.host.pattern()
    }

    /// Returns the value of every entry of the pattern, by rows.
    pub fn values(&self) -> &[f64] {
        self.host.values()
    }

    /// Returns the matrix on the host.
    pub(super) fn on_host(&self) -> &csr::Matrix<f64> {
        &self.host
    }

    /// Returns the matrix on the host, for modification.
    #[inline(always)]
    fn on_host_mut(&mut self) -> &mut csr::Matrix<f64> {
        self.is_sent.set(false);
        &mut self.host
    }

    /// Returns the matrix on the device, up to date.
    fn on_device(&self) -> Result<RefMut<'_, DeviceCopy>, CudaError> {
        let copy = match self.copy.get() {
            Some(copy) => copy,
            None => {
                let copy = RefCell::new(DeviceCopy::new(&self.device, self.host.pattern())?);
                self.copy.get_or_init(|| copy)
            }
        };
        let mut copy = copy.borrow_mut();
        if !self.is_sent.get() {
            send(&self.device, self.host.values(), &mut copy.values)?;
            self.is_sent.set(true);
        }
        Ok(copy)
    }

    /// Computes `y = A x` by the kernel of this crate, which [`MatVec::mul`] uses if cuSPARSE is not installed.
    ///
    /// # Errors
    /// As for [`MatVec::mul`].
    pub fn multiply_by_kernel(&self, x: &Vector, y: &mut Vector) -> Result<(), Failure> {
        self.check_product(x, y)?;
        self.product_by_kernel(x, y).map_err(Failure::Backend)
    }

    fn check_product(&self, x: &Vector, y: &Vector) -> Result<(), Failure> {
        let pattern = self.host.pattern();
        check_size("the vector to multiply", x.len(), pattern.cols())?;
        check_size("the product", y.len(), pattern.rows())
    }

    fn product_by_kernel(&self, x: &Vector, y: &mut Vector) -> Result<(), CudaError> {
        let (device, rows) = (&self.device, self.host.pattern().rows() as u32);
        let (copy, x, mut y) = (self.on_device()?, x.on_device()?, y.overwrite()?);
        let DeviceCopy { values, pattern, .. } = &*copy;
        let kernel = &device.algebra()?.product;
        let launch = per_row(rows as usize);
        launch!(device, kernel, launch, &rows, &pattern.offsets, &pattern.columns, values, &*x, &mut *y)
    }

    fn product(&self, x: &Vector, y: &mut Vector) -> Result<(), CudaError> {
        let mut copy = self.on_device()?;
        let (Some(library), Some(descriptor)) = (&self.device.algebra()?.library, &mut copy.descriptor) else {
            drop(copy);
            return self.product_by_kernel(x, y);
        };
        let (cols, rows) = (x.len(), y.len());
        library.multiply(&self.device, descriptor, (cols, &*x.on_device()?), (rows, &mut *y.overwrite()?))
    }

    fn transposed_product(&self, x: &Vector, y: &mut Vector) -> Result<(), CudaError> {
        let (device, rows) = (&self.device, self.host.pattern().cols() as u32);
        let (copy, x, mut y) = (self.on_device()?, x.on_device()?, y.overwrite()?);
        let transpose = copy.pattern.transpose(device)?;
        let (offsets, columns, sources) = (&transpose.offsets, &transpose.columns, &transpose.sources);
        let kernel = &device.algebra()?.transposed;
        launch!(device, kernel, per_row(rows as usize), &rows, offsets, columns, sources, &copy.values, &*x, &mut *y)
    }
}

impl MatrixOps<Cuda> for Matrix {
    #[inline(always)]
    fn shape(&self) -> (usize, usize) {
        (self.host.pattern().rows(), self.host.pattern().cols())
    }

    #[inline(always)]
    fn zero(&mut self) -> Result<(), CudaError> {
        self.on_host_mut().zero_all();
        Ok(())
    }

    #[inline(always)]
    fn zero_rows(&mut self, rows: &[i32]) -> Result<(), CudaError> {
        self.on_host_mut().zero_whole_rows(rows);
        Ok(())
    }

    #[inline(always)]
    fn add(&mut self, rows: &[i32], cols: &[i32], block: &[f64]) -> Result<(), CudaError> {
        self.on_host_mut().scatter(rows, cols, block, |entry, value| *entry += value);
        Ok(())
    }

    #[inline(always)]
    fn set(&mut self, rows: &[i32], cols: &[i32], block: &[f64]) -> Result<(), CudaError> {
        self.on_host_mut().scatter(rows, cols, block, |entry, value| *entry = value);
        Ok(())
    }

    #[inline(always)]
    fn get(&self, rows: &[i32], cols: &[i32], block: &mut [f64]) -> Result<(), CudaError> {
        self.host.get_block(rows, cols, block);
        Ok(())
    }

    #[inline(always)]
    fn locate(&self, rows: &[i32], cols: &[i32], slots: &mut Vec<u32>) -> Result<(), CudaError> {
        self.host.positions(rows, cols, slots);
        Ok(())
    }

    #[inline(always)]
    fn add_at(&mut self, slots: &[u32], block: &[f64]) -> Result<(), CudaError> {
        self.on_host_mut().add_at_positions(slots, block);
        Ok(())
    }

    fn locate_blocks(&self, size: usize, indices: &[i32]) -> Result<BlockSlots<Cuda>, CudaError> {
        if let Some(positions) = NodePositions::new(self.host.pattern(), size, indices) {
            return Ok(BlockSlots::of_nodes(positions));
        }
        let mut slots = Vec::with_capacity(size * indices.len());
        for rows in indices.chunks_exact(size.max(1)) {
            self.host.positions(rows, rows, &mut slots);
        }
        Ok(BlockSlots::new(size, slots))
    }

    fn add_blocks(
        &mut self,
        slots: &BlockSlots<Cuda>,
        compute: impl Fn(usize, &mut [f64]) -> bool + Sync,
    ) -> Result<(), CudaError> {
        self.on_host_mut().add_all_blocks(slots.size(), slots.positions(), compute);
        Ok(())
    }

    fn finish(&mut self) -> Result<(), CudaError> {
        if self.copy.get().is_some() {
            self.on_device()?;
        }
        Ok(())
    }
}

impl MatVec<Cuda> for Matrix {
    fn mul(&self, x: &Vector, y: &mut Vector) -> Result<(), Failure> {
        self.check_product(x, y)?;
        self.product(x, y).map_err(Failure::Backend)
    }

    fn mul_transpose(&self, x: &Vector, y: &mut Vector) -> Result<(), Failure> {
        check_size("the vector to multiply", x.len(), self.host.pattern().rows())?;
        check_size("the product", y.len(), self.host.pattern().cols())?;
        self.transposed_product(x, y).map_err(Failure::Backend)
    }

    fn diagonal(&self, d: &mut Vector) -> Result<(), Failure> {
        let d = d.on_host_mut().map_err(Failure::Backend)?;
        self.host.diagonal_into(d.as_mut_slice())
    }
}

/// On the host.
impl MatMat<Cuda> for Matrix {
    fn scale(&mut self, factor: f64) -> Result<(), CudaError> {
        self.on_host_mut().values_mut().iter_mut().for_each(|value| *value *= factor);
        Ok(())
    }

    fn sum(&self, a: f64, other: &Self, b: f64) -> Result<Self, Failure> {
        Ok(Self::of_host(&self.device, self.host.sum_with(a, &other.host, b)?))
    }

    fn product(&self, other: &Self) -> Result<Self, Failure> {
        Ok(Self::of_host(&self.device, self.host.product_with(&other.host)?))
    }

    fn transpose(&self) -> Result<Self, Failure> {
        Ok(Self::of_host(&self.device, self.host.transposed()))
    }
}

impl Entries<Cuda> for Matrix {
    fn pattern(&self) -> Result<Arc<Sparsity>, CudaError> {
        Ok(Arc::clone(self.host.pattern()))
    }

    fn for_each(&self, mut visit: impl FnMut(usize, usize, f64)) -> Result<(), CudaError> {
        for row in 0..self.host.pattern().rows() {
            for (column, value) in self.host.row(row) {
                visit(row, column, value);
            }
        }
        Ok(())
    }
}
