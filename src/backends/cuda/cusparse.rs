//! Products of compressed rows by cuSPARSE.

use std::ffi::c_void;
use std::ptr;
use std::sync::{Mutex, PoisonError};

use cudarc::cusparse::sys::{self, cudaDataType_t, cusparseOperation_t, cusparseSpMVAlg_t, cusparseStatus_t};
use cudarc::driver::{CudaSlice, DevicePtr, DevicePtrMut};

use super::algebra::zeros;
use super::pattern::DevicePattern;
use super::{CudaError, CudaErrorKind, Device};
use crate::las::Sparsity;

const F64: cudaDataType_t = cudaDataType_t::CUDA_R_64F;
const INDEX: sys::cusparseIndexType_t = sys::cusparseIndexType_t::CUSPARSE_INDEX_32I;
const PLAIN: cusparseOperation_t = cusparseOperation_t::CUSPARSE_OPERATION_NON_TRANSPOSE;
/// The algorithm whose results have the same bits in every run.
const REPEATABLE: cusparseSpMVAlg_t = cusparseSpMVAlg_t::CUSPARSE_SPMV_CSR_ALG2;
const ONE: f64 = 1.0;
const ZERO: f64 = 0.0;

/// The library, with its state for the stream of a device.
pub(super) struct Library {
    handle: Mutex<Handle>,
}

struct Handle(sys::cusparseHandle_t);

// SAFETY: a handle may be used by any thread whose current context is that of the device, by one at a time.
unsafe impl Send for Handle {}

/// A matrix in the form of the library, with the buffer of its products.
pub(super) struct Descriptor {
    matrix: sys::cusparseSpMatDescr_t,
    buffer: CudaSlice<u8>,
}

// SAFETY: a description of memory, which the library only reads.
unsafe impl Send for Descriptor {}

/// A vector in the form of the library.
struct DenseVector(sys::cusparseDnVecDescr_t);

impl Drop for Handle {
    fn drop(&mut self) {
        // SAFETY: the handle was created by `Library::load` and is destroyed once.
        let _ = unsafe { sys::cusparseDestroy(self.0) };
    }
}

impl Drop for Descriptor {
    fn drop(&mut self) {
        // SAFETY: created by `Library::describe` and destroyed once.
        let _ = unsafe { sys::cusparseDestroySpMat(self.matrix) };
    }
}

impl Drop for DenseVector {
    fn drop(&mut self) {
        // SAFETY: created by `DenseVector::new` and destroyed once.
        let _ = unsafe { sys::cusparseDestroyDnVec(self.0) };
    }
}

impl DenseVector {
    fn new(len: usize, values: u64) -> Result<Self, CudaError> {
        let mut vector = ptr::null_mut();
        // SAFETY: `values` is memory of the device for `len` numbers, which outlives the description.
        let status = unsafe { sys::cusparseCreateDnVec(&mut vector, len as i64, values as *mut c_void, F64) };
        checked(status, "describe a vector")?;
        Ok(Self(vector))
    }
}

fn checked(status: cusparseStatus_t, action: &'static str) -> Result<(), CudaError> {
    match status {
        cusparseStatus_t::CUSPARSE_STATUS_SUCCESS => Ok(()),
        status => Err(CudaErrorKind::Library { library: "cuSPARSE", action, status: format!("{status:?}") }.into()),
    }
}

fn bind(device: &Device) -> Result<(), CudaError> {
    device.context().bind_to_thread().map_err(CudaError::of("select the device"))
}

impl Library {
    /// Loads the library; `None` if it is not installed.
    pub fn load(device: &Device) -> Result<Option<Self>, CudaError> {
        // SAFETY: loads the library, whose initialization has no precondition.
        if !unsafe { sys::is_culib_present() } {
            return Ok(None);
        }
        bind(device)?;
        let mut handle = ptr::null_mut();
        // SAFETY: the context of the device is current; the handle is destroyed when it is dropped.
        checked(unsafe { sys::cusparseCreate(&mut handle) }, "create a handle")?;
        let handle = Handle(handle);
        let stream = device.stream().cu_stream().cast();
        // SAFETY: the stream lives as long as the device, which owns this library.
        checked(unsafe { sys::cusparseSetStream(handle.0, stream) }, "select the stream")?;
        Ok(Some(Self { handle: Mutex::new(handle) }))
    }

    /// Describes a matrix whose pattern and values outlive the description; `None` if it is empty or too large for the
    /// library.
    pub fn describe(
        &self,
        device: &Device,
        pattern: &Sparsity,
        on_device: &DevicePattern,
        values: &CudaSlice<f64>,
    ) -> Result<Option<Descriptor>, CudaError> {
        let (rows, cols, entries) = (pattern.rows(), pattern.cols(), pattern.nnz());
        if rows == 0 || cols == 0 || entries == 0 || entries > i32::MAX as usize {
            return Ok(None);
        }
        let handle = self.handle.lock().unwrap_or_else(PoisonError::into_inner);
        bind(device)?;
        let stream = device.stream();
        let (offsets, _offsets_read) = on_device.offsets.device_ptr(stream);
        let (columns, _columns_read) = on_device.columns.device_ptr(stream);
        let (values, _values_read) = values.device_ptr(stream);
        let mut matrix = ptr::null_mut();
        // SAFETY: the arrays are memory of the device with the sizes of the pattern; their numbers fit in 31 bits.
        let status = unsafe {
            sys::cusparseCreateCsr(
                &mut matrix,
                rows as i64,
                cols as i64,
                entries as i64,
                offsets as *mut c_void,
                columns as *mut c_void,
                values as *mut c_void,
                INDEX,
                INDEX,
                sys::cusparseIndexBase_t::CUSPARSE_INDEX_BASE_ZERO,
                F64,
            )
        };
        checked(status, "describe a matrix")?;
        let mut descriptor = Descriptor { matrix, buffer: zeros(device, 1)? };
        // Only the sizes of the vectors matter here.
        let (x, y) = (DenseVector::new(cols, values)?, DenseVector::new(rows, values)?);
        let mut bytes = 0;
        // SAFETY: all descriptions are valid; the two factors are on the host, the mode of a new handle.
        let status = unsafe {
            sys::cusparseSpMV_bufferSize(
                handle.0,
                PLAIN,
                ptr::from_ref(&ONE).cast(),
                descriptor.matrix,
                x.0,
                ptr::from_ref(&ZERO).cast(),
                y.0,
                F64,
                REPEATABLE,
                &mut bytes,
            )
        };
        checked(status, "size the buffer of a product")?;
        descriptor.buffer = zeros(device, bytes)?;
        Ok(Some(descriptor))
    }

    /// Computes `y = A x`; the vectors have the sizes of the matrix.
    pub fn multiply(
        &self,
        device: &Device,
        matrix: &mut Descriptor,
        (cols, x): (usize, &CudaSlice<f64>),
        (rows, y): (usize, &mut CudaSlice<f64>),
    ) -> Result<(), CudaError> {
        let handle = self.handle.lock().unwrap_or_else(PoisonError::into_inner);
        bind(device)?;
        let stream = device.stream();
        let (x, _x_read) = x.device_ptr(stream);
        let (y, _y_written) = y.device_ptr_mut(stream);
        let (buffer, _buffer_written) = matrix.buffer.device_ptr_mut(stream);
        let (x, y) = (DenseVector::new(cols, x)?, DenseVector::new(rows, y)?);
        // SAFETY: all descriptions are valid, and the buffer has the size that the library asked for.
        let status = unsafe {
            sys::cusparseSpMV(
                handle.0,
                PLAIN,
                ptr::from_ref(&ONE).cast(),
                matrix.matrix,
                x.0,
                ptr::from_ref(&ZERO).cast(),
                y.0,
                F64,
                REPEATABLE,
                buffer as *mut c_void,
            )
        };
        checked(status, "multiply a matrix")
    }
}
