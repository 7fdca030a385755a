//! An allocator that counts the allocations of each thread. Other tests, on other threads, do not affect the counts.
#![allow(dead_code, reason = "every test file uses only a part of this module")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

/// The `#[global_allocator]` of a test program.
pub struct Counting;

thread_local! {
    /// Number of allocations.
    static CALLS: Cell<usize> = const { Cell::new(0) };
    /// Number of bytes allocated and not freed.
    static IN_USE: Cell<isize> = const { Cell::new(0) };
    /// The maximum of `IN_USE` since the last call of [`start_peak`].
    static PEAK: Cell<isize> = const { Cell::new(0) };
}

/// Returns the number of allocations of this thread.
pub fn calls() -> usize {
    CALLS.get()
}

/// Returns the number of bytes that this thread has allocated and not freed.
pub fn in_use() -> isize {
    IN_USE.get()
}

/// Starts to record the peak of [`in_use`] on this thread.
pub fn start_peak() {
    PEAK.set(IN_USE.get());
}

/// Returns the most bytes in use at once since [`start_peak`].
pub fn peak() -> isize {
    PEAK.get()
}

fn count(calls: usize, bytes: isize) {
    CALLS.set(CALLS.get() + calls);
    IN_USE.set(IN_USE.get() + bytes);
    PEAK.set(PEAK.get().max(IN_USE.get()));
}

// SAFETY: every call is passed to the system's allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count(1, layout.size() as isize);
        // SAFETY: the conditions are those of the caller.
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        count(1, layout.size() as isize);
        // SAFETY: the conditions are those of the caller.
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, new_size: usize) -> *mut u8 {
        count(1, new_size as isize - layout.size() as isize);
        // SAFETY: the conditions are those of the caller.
        unsafe { System.realloc(pointer, layout, new_size) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        count(0, -(layout.size() as isize));
        // SAFETY: the conditions are those of the caller.
        unsafe { System.dealloc(pointer, layout) }
    }
}
