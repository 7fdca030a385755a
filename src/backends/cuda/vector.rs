//! The vector: values on the host and on the device, copied when the other side needs them.

use std::cell::{Cell, OnceCell, Ref, RefCell, RefMut, UnsafeCell};

use cudarc::driver::CudaSlice;

use super::algebra::{Algebra, Reduction, fetch, launch, of_reduction, per_entry, send, zeros};
use super::{Cuda, CudaError, Device};
use crate::backends::csr;
use crate::backends::local;
use crate::las::VectorOps;

/// A vector on a device.
///
/// The operations on single entries work on a copy in the memory of the host, all others on the device. The copy that
/// is out of date is renewed when it is needed: reads after work on the device fetch all entries at once, and
/// [`VectorOps::finish`] sends what was written. Memory on the device is allocated by the first operation there.
/// Vectors of one operation belong to the same [`Device`].
pub struct Vector {
    device: Device,
    /// Written only with exclusive access, or by `fetch` while it is out of date: then no reference to it exists, because
    /// references end before the next operation that puts it out of date, which needs exclusive access.
    host: UnsafeCell<csr::Vector<f64>>,
    values: OnceCell<RefCell<CudaSlice<f64>>>,
    /// Which copies are up to date; if none is, all entries are zero.
    is_on_host: Cell<bool>,
    is_on_device: Cell<bool>,
}

impl Vector {
    pub(super) fn zeros(device: &Device, len: usize) -> Self {
        Self {
            device: device.clone(),
            host: UnsafeCell::new(vec![0.0; len].into()),
            values: OnceCell::new(),
            is_on_host: Cell::new(true),
            is_on_device: Cell::new(false),
        }
    }

    /// Returns the device.
    pub fn device(&self) -> &Device {
        &self.device
    }

    /// Returns the entries on the host, up to date.
    #[inline(always)]
    pub(super) fn on_host(&self) -> Result<&csr::Vector<f64>, CudaError> {
        if !self.is_on_host.get() {
            self.fetch()?;
        }
        Ok(self.stored())
    }

    /// Returns the entries on the host, perhaps out of date.
    #[inline(always)]
    fn stored(&self) -> &csr::Vector<f64> {
        // SAFETY: see `host`; a vector is not `Sync`, so that no other thread fetches.
        unsafe { &*self.host.get() }
    }

    /// Returns the entries on the host, up to date, for modification.
    #[inline(always)]
    pub(super) fn on_host_mut(&mut self) -> Result<&mut csr::Vector<f64>, CudaError> {
        if !self.is_on_host.get() {
            self.fetch()?;
        }
        self.is_on_device.set(false);
        Ok(self.host.get_mut())
    }

    /// Returns the memory of the entries on the host, all of which the caller writes.
    pub(super) fn overwrite_on_host(&mut self) -> &mut csr::Vector<f64> {
        self.is_on_host.set(true);
        self.is_on_device.set(false);
        self.host.get_mut()
    }

    #[cold]
    #[inline(never)]
    fn fetch(&self) -> Result<(), CudaError> {
        // SAFETY: see `host`: the entries are out of date.
        let host = unsafe { &mut *self.host.get() };
        match self.values.get() {
            Some(values) if self.is_on_device.get() => fetch(&self.device, &values.borrow(), host.as_mut_slice())?,
            _ => local::zero(host.as_mut_slice()),
        }
        self.is_on_host.set(true);
        Ok(())
    }

    fn memory(&self) -> Result<&RefCell<CudaSlice<f64>>, CudaError> {
        if let Some(values) = self.values.get() {
            return Ok(values);
        }
        let values = RefCell::new(zeros(&self.device, self.stored().as_slice().len())?);
        Ok(self.values.get_or_init(|| values))
    }

    /// Returns the entries on the device, up to date.
    pub(super) fn on_device(&self) -> Result<Ref<'_, CudaSlice<f64>>, CudaError> {
        let values = self.memory()?;
        if !self.is_on_device.get() {
            let mut to = values.borrow_mut();
            if self.is_on_host.get() {
                send(&self.device, self.stored().as_slice(), &mut to)?;
            } else {
                let zeroed = self.device.stream().memset_zeros(&mut *to);
                zeroed.map_err(CudaError::of("set memory of the device to zero"))?;
            }
            self.is_on_device.set(true);
        }
        Ok(values.borrow())
    }

    /// Returns the entries on the device, up to date, for modification.
    pub(super) fn on_device_mut(&mut self) -> Result<RefMut<'_, CudaSlice<f64>>, CudaError> {
        drop(self.on_device()?);
        self.overwrite()
    }

    /// Returns the memory on the device, all of whose entries the caller writes.
    pub(super) fn overwrite(&mut self) -> Result<RefMut<'_, CudaSlice<f64>>, CudaError> {
        let values = self.memory()?;
        self.is_on_device.set(true);
        self.is_on_host.set(false);
        Ok(values.borrow_mut())
    }

    /// Checks that an operation has vectors of one length and one device; returns the length and the kernels.
    fn kernels(&self, x: &Self) -> Result<(usize, &Algebra), CudaError> {
        debug_assert_eq!(self.len(), x.len(), "vectors of one length");
        debug_assert!(self.device.is_same(&x.device), "vectors of one device");
        Ok((self.len().min(x.len()), self.device.algebra()?))
    }
}

impl VectorOps<Cuda> for Vector {
    #[inline(always)]
    fn len(&self) -> usize {
        self.stored().as_slice().len()
    }

    #[inline(always)]
    fn zero(&mut self) -> Result<(), CudaError> {
        self.is_on_host.set(false);
        self.is_on_device.set(false);
        Ok(())
    }

    #[inline(always)]
    fn add(&mut self, rows: &[i32], values: &[f64]) -> Result<(), CudaError> {
        local::add(self.on_host_mut()?.as_mut_slice(), rows, values);
        Ok(())
    }

    #[inline(always)]
    fn set(&mut self, rows: &[i32], values: &[f64]) -> Result<(), CudaError> {
        local::set(self.on_host_mut()?.as_mut_slice(), rows, values);
        Ok(())
    }

    #[inline(always)]
    fn get(&self, rows: &[i32], values: &mut [f64]) -> Result<(), CudaError> {
        local::get(self.on_host()?.as_slice(), rows, values);
        Ok(())
    }

    fn norm(&self) -> Result<f64, CudaError> {
        let squares = self.dot(self)?;
        if local::is_in_range(squares) {
            return Ok(squares.sqrt());
        }
        Ok(local::scaled_norm(self.on_host()?.as_slice()))
    }

    fn dot(&self, y: &Self) -> Result<f64, CudaError> {
        let (n, kernels) = self.kernels(y)?;
        if n == 0 {
            return Ok(0.0);
        }
        let (of_x, of_y) = (self.on_device()?, y.on_device()?);
        let mut buffers = kernels.reduction();
        let Reduction { partial, ticket, result } = &mut *buffers;
        launch!(self.device, &kernels.dot, of_reduction(n), &n, &*of_x, &*of_y, partial, ticket, &mut *result)?;
        let mut value = [0.0];
        fetch(&self.device, result, &mut value)?;
        Ok(value[0])
    }

    fn axpy(&mut self, a: f64, x: &Self) -> Result<(), CudaError> {
        let device = self.device.clone();
        let (n, _) = self.kernels(x)?;
        let (of_x, mut of_y) = (x.on_device()?, self.on_device_mut()?);
        launch!(device, &device.algebra()?.axpy, per_entry(n), &n, &a, &*of_x, &mut *of_y)
    }

    fn axpby(&mut self, a: f64, x: &Self, b: f64) -> Result<(), CudaError> {
        let device = self.device.clone();
        let (n, _) = self.kernels(x)?;
        let of_x = x.on_device()?;
        let mut of_y = if b == 0.0 { self.overwrite()? } else { self.on_device_mut()? };
        launch!(device, &device.algebra()?.axpby, per_entry(n), &n, &a, &*of_x, &b, &mut *of_y)
    }

    fn multiply(&mut self, d: &Self, x: &Self) -> Result<(), CudaError> {
        let device = self.device.clone();
        let n = self.kernels(x)?.0.min(self.kernels(d)?.0);
        let (of_d, of_x, mut of_y) = (d.on_device()?, x.on_device()?, self.overwrite()?);
        launch!(device, &device.algebra()?.multiply, per_entry(n), &n, &*of_d, &*of_x, &mut *of_y)
    }

    #[inline(always)]
    fn with_local<R>(&self, read: impl FnOnce(&[f64]) -> R) -> Result<R, CudaError> {
        Ok(read(self.on_host()?.as_slice()))
    }

    #[inline(always)]
    fn with_local_mut<R>(&mut self, write: impl FnOnce(&mut [f64]) -> R) -> Result<R, CudaError> {
        Ok(write(self.on_host_mut()?.as_mut_slice()))
    }

    fn finish(&mut self) -> Result<(), CudaError> {
        if self.values.get().is_some() && self.is_on_host.get() {
            self.on_device()?;
        }
        Ok(())
    }
}
