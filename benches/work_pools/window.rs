//! Memory that the processes of a node share: a window of MPI (`MPI_Win_allocate_shared`).
#![allow(unsafe_code, reason = "the interface to a C library")]

use std::ffi::{c_int, c_void};
use std::ptr;

use mpi::ffi;

/// Bytes that all processes read and write; the first eight are a counter. The first process owns the memory.
pub struct Window {
    raw: ffi::MPI_Win,
    first: *mut u8,
    len: usize,
}

/// Panics with the error code of an MPI function that failed.
fn check(code: c_int) {
    assert_eq!(code, 0, "an MPI function failed");
}

impl Window {
    /// Allocates `len` bytes, all zero. Collective over all processes, which must be on one node.
    pub fn new(rank: usize, len: usize) -> Self {
        assert!(len >= size_of::<u64>());
        let own = if rank == 0 { len } else { 0 };
        let mut first: *mut c_void = ptr::null_mut();
        // SAFETY: a constant of the library.
        let mut raw = unsafe { ffi::RSMPI_WIN_NULL };
        // SAFETY: MPI is initialized; the pointers are valid for writes of the types that the functions write.
        unsafe {
            check(ffi::MPI_Win_allocate_shared(
                own as ffi::MPI_Aint,
                1,
                ffi::RSMPI_INFO_NULL,
                ffi::RSMPI_COMM_WORLD,
                (&raw mut first).cast(),
                &raw mut raw,
            ));
            let (mut bytes, mut unit) = (0, 0);
            check(ffi::MPI_Win_shared_query(raw, 0, &raw mut bytes, &raw mut unit, (&raw mut first).cast()));
            check(ffi::MPI_Win_lock_all(0, raw));
        }
        let window = Self { raw, first: first.cast(), len };
        if rank == 0 {
            window.write(0, &vec![0; len]);
        }
        window.synchronize();
        window
    }

    /// Adds one to the counter and returns its former value; no other process sees or changes it in between.
    pub fn fetch_add(&self) -> u64 {
        let (one, mut former) = (1_u64, 0_u64);
        // SAFETY: the window is locked for all processes; `former` is read only after the flush has completed it.
        unsafe {
            check(ffi::MPI_Fetch_and_op(
                (&raw const one).cast(),
                (&raw mut former).cast(),
                ffi::RSMPI_UINT64_T,
                0,
                0,
                ffi::RSMPI_SUM,
                self.raw,
            ));
            check(ffi::MPI_Win_flush(0, self.raw));
        }
        former
    }

    /// Sets the counter. No other process may take a number at the same time.
    pub fn set_counter(&self, value: u64) {
        self.write(0, &value.to_ne_bytes());
        self.synchronize();
    }

    /// Sleeps until the counter is zero; a process that waits for a message would occupy a core.
    pub fn wait_for_zero(&self) {
        let mut counter = [1; size_of::<u64>()];
        while counter != [0; size_of::<u64>()] {
            std::thread::sleep(std::time::Duration::from_micros(500));
            self.synchronize();
            self.read(0, &mut counter);
        }
    }

    /// Makes former writes of this process visible to the others, and theirs to this one, between two barriers.
    pub fn synchronize(&self) {
        // SAFETY: the window is alive.
        check(unsafe { ffi::MPI_Win_sync(self.raw) });
    }

    /// Copies bytes into the window. No other process may access these places at the same time.
    pub fn write(&self, place: usize, values: &[u8]) {
        assert!(place + values.len() <= self.len);
        // SAFETY: the places are inside the window, and the caller says that only this process accesses them.
        unsafe { ptr::copy_nonoverlapping(values.as_ptr(), self.first.add(place), values.len()) }
    }

    /// Copies bytes out of the window. No other process may write to these places at the same time.
    pub fn read(&self, place: usize, values: &mut [u8]) {
        assert!(place + values.len() <= self.len);
        // SAFETY: the places are inside the window, and the caller says that no process writes to them.
        unsafe { ptr::copy_nonoverlapping(self.first.add(place), values.as_mut_ptr(), values.len()) }
    }
}

impl Drop for Window {
    fn drop(&mut self) {
        // SAFETY: all processes free the window, which nothing uses afterwards.
        unsafe {
            check(ffi::MPI_Win_unlock_all(self.raw));
            check(ffi::MPI_Win_free(&raw mut self.raw));
        }
    }
}
