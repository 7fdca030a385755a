//! CHOLMOD of SuiteSparse, called through a short C file.

use std::ffi::{c_double, c_int, c_void};
use std::ptr::NonNull;

use crate::system::{Contender, System};

unsafe extern "C" {
    fn cholmod_solver_new(
        n: c_int,
        start: *mut c_int,
        rows: *mut c_int,
        values: *mut c_double,
        ordering: c_int,
    ) -> *mut c_void;
    fn cholmod_solver_factor(b: *mut c_void) -> c_int;
    fn cholmod_solver_solve(b: *mut c_void, columns: c_int, right: *mut c_double, solution: *mut c_double) -> c_int;
    fn cholmod_solver_operations(b: *mut c_void) -> c_double;
    fn cholmod_solver_free(b: *mut c_void);
}

/// The ordering method that CHOLMOD uses.
#[derive(Clone, Copy)]
pub enum Ordering {
    Amd = 2,
    Metis = 3,
}

/// A matrix and its factor in CHOLMOD.
pub struct Cholmod {
    handle: NonNull<c_void>,
    name: &'static str,
    // The arrays that the handle points to.
    _start: Vec<c_int>,
    _rows: Vec<c_int>,
    _values: Vec<f64>,
}

impl Cholmod {
    pub fn new(system: &System, ordering: Ordering) -> Option<Self> {
        let mut start: Vec<c_int> = system.lower_start.iter().map(|&k| k as c_int).collect();
        let mut rows: Vec<c_int> = system.lower_rows.iter().map(|&k| k as c_int).collect();
        let mut values = system.lower_values.clone();
        let n = (start.len() - 1) as c_int;
        // SAFETY: the arrays are those of a lower triangle by columns, and are kept as long as the handle; their heap
        // blocks do not move with the vectors.
        let handle = unsafe {
            cholmod_solver_new(n, start.as_mut_ptr(), rows.as_mut_ptr(), values.as_mut_ptr(), ordering as c_int)
        };
        let name = match ordering {
            Ordering::Amd => "CHOLMOD, AMD",
            Ordering::Metis => "CHOLMOD, METIS",
        };
        NonNull::new(handle).map(|handle| Self { handle, name, _start: start, _rows: rows, _values: values })
    }
}

impl Contender for Cholmod {
    fn name(&self) -> String {
        self.name.to_owned()
    }

    fn operations(&self) -> Option<f64> {
        // SAFETY: the handle is alive.
        Some(unsafe { cholmod_solver_operations(self.handle.as_ptr()) })
    }

    fn factor(&mut self) {
        // SAFETY: the handle is alive.
        assert_eq!(unsafe { cholmod_solver_factor(self.handle.as_ptr()) }, 0, "CHOLMOD factors");
    }

    fn solve(&mut self, columns: usize, right: &[f64], solution: &mut [f64]) {
        assert!(right.len() >= columns * self.unknowns() && solution.len() >= columns * self.unknowns());
        // SAFETY: the handle is alive, and both slices have `columns` columns; the right-hand sides are only read.
        let failed = unsafe {
            cholmod_solver_solve(
                self.handle.as_ptr(),
                columns as c_int,
                right.as_ptr().cast_mut(),
                solution.as_mut_ptr(),
            )
        };
        assert_eq!(failed, 0, "CHOLMOD solves");
    }
}

impl Cholmod {
    fn unknowns(&self) -> usize {
        self._start.len() - 1
    }
}

impl Drop for Cholmod {
    fn drop(&mut self) {
        // SAFETY: the handle is alive and not used afterward.
        unsafe { cholmod_solver_free(self.handle.as_ptr()) }
    }
}
