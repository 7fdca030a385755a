//! Arrays on the host that a copy on a device follows. The verbs write the arrays, and mark the copy as out of date.
#![allow(unsafe_code, reason = "calls CUDA by hand, to compare")]

use std::cell::{Cell, UnsafeCell};

use cudarc::driver::DriverError;
use cudarc::driver::result::memcpy_dtoh_sync;
use cudarc::driver::sys::CUdeviceptr;

use super::csr::Csr;
use super::slices;

pub type Scalar = f64;
pub type Reduced = f64;
pub type Slot = u32;
pub type Outcome<T> = Result<T, DriverError>;

/// A vector on the host and on a device. If no copy is up to date, all entries are zero.
pub struct Vector {
    values: UnsafeCell<Vec<f64>>,
    on_device: CUdeviceptr,
    is_on_host: Cell<bool>,
    is_on_device: Cell<bool>,
}

/// A matrix on the host, whose copy on the device is `is_sent` if it is up to date.
pub struct Matrix {
    host: Csr<f64>,
    is_sent: bool,
}

impl Vector {
    #[inline(always)]
    fn on_host(&self) -> Outcome<&[f64]> {
        if !self.is_on_host.get() {
            self.fetch()?;
        }
        // SAFETY: `fetch` writes the entries only while no reference to them is in use.
        Ok(unsafe { &*self.values.get() })
    }

    #[inline(always)]
    fn on_host_mut(&mut self) -> Outcome<&mut [f64]> {
        if !self.is_on_host.get() {
            self.fetch()?;
        }
        self.is_on_device.set(false);
        Ok(self.values.get_mut())
    }

    #[cold]
    #[inline(never)]
    fn fetch(&self) -> Outcome<()> {
        // SAFETY: the entries are out of date, and no reference to them is in use; the memory on the device has as many.
        unsafe {
            let values = &mut *self.values.get();
            match self.is_on_device.get() {
                true => memcpy_dtoh_sync(values, self.on_device)?,
                false => values.fill(0.0),
            }
        }
        self.is_on_host.set(true);
        Ok(())
    }
}

impl Matrix {
    #[inline(always)]
    fn host_mut(&mut self) -> &mut Csr<f64> {
        self.is_sent = false;
        &mut self.host
    }
}

#[inline(always)]
pub fn vector_zero(y: &mut Vector) -> Outcome<()> {
    y.is_on_host.set(false);
    y.is_on_device.set(false);
    Ok(())
}

#[inline(always)]
pub fn vector_add(y: &mut Vector, rows: &[i32], values: &[f64]) -> Outcome<()> {
    slices::add(y.on_host_mut()?, rows, values);
    Ok(())
}

#[inline(always)]
pub fn vector_set(y: &mut Vector, rows: &[i32], values: &[f64]) -> Outcome<()> {
    slices::set(y.on_host_mut()?, rows, values);
    Ok(())
}

#[inline(always)]
pub fn vector_get(y: &Vector, rows: &[i32], values: &mut [f64]) -> Outcome<()> {
    slices::get(y.on_host()?, rows, values);
    Ok(())
}

#[inline(always)]
pub fn vector_local(y: &mut Vector, value: f64) -> Outcome<()> {
    y.on_host_mut()?.iter_mut().for_each(|entry| *entry = value);
    Ok(())
}

#[inline(always)]
pub fn matrix_zero(k: &mut Matrix) -> Outcome<()> {
    k.host_mut().zero();
    Ok(())
}

#[inline(always)]
pub fn matrix_zero_rows(k: &mut Matrix, rows: &[i32]) -> Outcome<()> {
    k.host_mut().zero_rows(rows);
    Ok(())
}

#[inline(always)]
pub fn matrix_add(k: &mut Matrix, rows: &[i32], cols: &[i32], block: &[f64]) -> Outcome<()> {
    k.host_mut().add(rows, cols, block);
    Ok(())
}

#[inline(always)]
pub fn matrix_set(k: &mut Matrix, rows: &[i32], cols: &[i32], block: &[f64]) -> Outcome<()> {
    k.host_mut().set(rows, cols, block);
    Ok(())
}

#[inline(always)]
pub fn matrix_get(k: &Matrix, rows: &[i32], cols: &[i32], block: &mut [f64]) -> Outcome<()> {
    k.host.get(rows, cols, block);
    Ok(())
}

#[inline(always)]
pub fn matrix_add_at(k: &mut Matrix, slots: &[u32], block: &[f64]) -> Outcome<()> {
    k.host_mut().add_at(slots, block);
    Ok(())
}
