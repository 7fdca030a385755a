//! Checks of the caller's pointers. A null pointer is reported as an error; the caller must ensure everything else.

use std::any::Any;
use std::cell::RefCell;
use std::ffi::{CStr, CString, c_char};
use std::mem::ManuallyDrop;
use std::panic::{AssertUnwindSafe, catch_unwind};

use super::{
    LAS_ARGUMENT, LAS_BACKEND_ERROR, LAS_INDEX, LAS_NOT_CONVERGED, LAS_NOT_FACTORED, LAS_NULL, LAS_OK, LAS_PANIC,
    LAS_SINGULAR, LAS_SIZE, LAS_UNSUPPORTED,
};
use crate::las::{Scalar, SolveError, Value};

/// The error code and message of a call that failed.
pub(super) struct Failure {
    pub code: i32,
    pub message: String,
}

impl Failure {
    pub(super) fn new(code: i32, message: impl Into<String>) -> Self {
        Self { code, message: message.into() }
    }
}

thread_local! {
    static MESSAGE: RefCell<CString> = RefCell::default();
}

/// Returns the message of the last failure on this thread; empty before the first.
pub(super) fn message() -> *const c_char {
    MESSAGE.with_borrow(|message| message.as_ptr())
}

/// Runs a call and returns its error code; a panic becomes LAS_PANIC and does not unwind into the caller.
pub(super) fn guarded(call: impl FnOnce() -> Result<(), Failure>) -> i32 {
    let outcome = catch_unwind(AssertUnwindSafe(call)).unwrap_or_else(|panic| {
        Err(Failure::new(LAS_PANIC, format!("internal error of the library: {}", text_of(panic.as_ref()))))
    });
    match outcome {
        Ok(()) => LAS_OK,
        Err(Failure { code, message }) => {
            MESSAGE.set(CString::new(message.replace('\0', " ")).unwrap_or_default());
            code
        }
    }
}

fn text_of(panic: &(dyn Any + Send)) -> &str {
    let text = panic.downcast_ref::<&str>().copied();
    text.or_else(|| panic.downcast_ref::<String>().map(String::as_str)).unwrap_or("no reason given")
}

fn null(name: &str) -> Failure {
    Failure::new(LAS_NULL, format!("`{name}` is a null pointer"))
}

/// Returns a shared reference to an object of the caller, which messages call `name`.
///
/// # Safety
/// The pointer is null, or points to a `T` that no other code writes during the call.
pub(super) unsafe fn shared<'a, T>(pointer: *const T, name: &str) -> Result<&'a T, Failure> {
    // SAFETY: the conditions are those of the caller.
    unsafe { pointer.as_ref() }.ok_or_else(|| null(name))
}

/// Returns an exclusive reference to an object of the caller, which messages call `name`.
///
/// # Safety
/// The pointer is null, or points to a `T` that no other code uses during the call.
pub(super) unsafe fn exclusive<'a, T>(pointer: *mut T, name: &str) -> Result<&'a mut T, Failure> {
    // SAFETY: the conditions are those of the caller.
    unsafe { pointer.as_mut() }.ok_or_else(|| null(name))
}

/// Stores the object that `make` creates in `*place`, or null if `make` fails. Returns the error code.
///
/// # Safety
/// As for [`exclusive`].
pub(super) unsafe fn create<T>(place: *mut *mut T, name: &str, make: impl FnOnce() -> Result<T, Failure>) -> i32 {
    guarded(|| {
        // SAFETY: the conditions are those of the caller.
        let place = unsafe { exclusive(place, name) }?;
        *place = std::ptr::null_mut();
        *place = Box::into_raw(Box::new(make()?));
        Ok(())
    })
}

/// Frees an object that [`create`] stored; null is allowed.
///
/// # Safety
/// The pointer is null, or was stored by [`create`] and has not been freed.
pub(super) unsafe fn free<T>(pointer: *mut T) -> Result<(), Failure> {
    if !pointer.is_null() {
        // SAFETY: the pointer came from Box::into_raw.
        drop(unsafe { Box::from_raw(pointer) });
    }
    Ok(())
}

/// Returns an array of the caller for reading; null is allowed if `len` is zero.
///
/// # Safety
/// The pointer is null, or points to `len` values that no other code writes during the call.
pub(super) unsafe fn array<'a, T>(pointer: *const T, len: usize, name: &str) -> Result<&'a [T], Failure> {
    match (pointer.is_null(), len) {
        (_, 0) => Ok(&[]),
        (true, _) => Err(null(name)),
        // SAFETY: the conditions are those of the caller.
        _ => Ok(unsafe { std::slice::from_raw_parts(pointer, len) }),
    }
}

/// Returns an array of the caller for writing; null is allowed if `len` is zero.
///
/// # Safety
/// The pointer is null, or points to `len` values that no other code uses during the call.
unsafe fn array_mut<'a, T>(pointer: *mut T, len: usize, name: &str) -> Result<&'a mut [T], Failure> {
    match (pointer.is_null(), len) {
        (_, 0) => Ok(&mut []),
        (true, _) => Err(null(name)),
        // SAFETY: the conditions are those of the caller.
        _ => Ok(unsafe { std::slice::from_raw_parts_mut(pointer, len) }),
    }
}

/// Returns `len` entries of a vector or matrix for reading; each consists of as many numbers as the backend has lanes.
///
/// # Safety
/// As for [`array`], with `len` times the number of lanes.
pub(super) unsafe fn scalars<'a, S: Value<Real = f64>>(
    pointer: *const f64,
    len: usize,
    name: &str,
) -> Result<&'a [S], Failure> {
    // SAFETY: an entry consists of its lanes, contiguous and without padding.
    unsafe { array(pointer.cast(), len, name) }
}

/// Returns `len` entries of a vector or matrix for writing; see [`scalars`].
///
/// # Safety
/// As for [`scalars`]; no other code uses the entries during the call.
pub(super) unsafe fn scalars_mut<'a, S: Value<Real = f64>>(
    pointer: *mut f64,
    len: usize,
    name: &str,
) -> Result<&'a mut [S], Failure> {
    // SAFETY: as above.
    unsafe { array_mut(pointer.cast(), len, name) }
}

/// Writes a norm or dot product, one number per lane.
///
/// # Safety
/// As for [`scalars_mut`] with one entry.
pub(super) unsafe fn store_lanes<R: Value<Real: Scalar>>(
    pointer: *mut f64,
    value: R,
    name: &str,
) -> Result<(), Failure> {
    // SAFETY: the conditions are those of the caller.
    let lanes = unsafe { array_mut(pointer, R::LANES, name) }?;
    lanes.iter_mut().enumerate().for_each(|(lane, out)| *out = value.lane(lane).as_f64());
    Ok(())
}

/// Returns a null-terminated string.
///
/// # Safety
/// The pointer is null, or points to a null-terminated string.
pub(super) unsafe fn text<'a>(pointer: *const c_char, name: &str) -> Result<&'a str, Failure> {
    if pointer.is_null() {
        return Err(null(name));
    }
    // SAFETY: the conditions are those of the caller.
    let text = unsafe { CStr::from_ptr(pointer) };
    text.to_str().map_err(|_| Failure::new(LAS_SIZE, format!("`{name}` is not UTF-8")))
}

/// Converts a count. Returns an error if it is negative.
pub(super) fn count(count: i32, name: &str) -> Result<usize, Failure> {
    usize::try_from(count).map_err(|_| Failure::new(LAS_SIZE, format!("`{name}` is {count}; it must not be negative")))
}

/// Returns indices after checking that each is negative or below `end`.
///
/// # Safety
/// As for [`array`] with `len` indices.
pub(super) unsafe fn indices<'a>(pointer: *const i32, len: i32, end: usize, name: &str) -> Result<&'a [i32], Failure> {
    // SAFETY: the conditions are those of the caller.
    let indices: &[i32] = unsafe { array(pointer, count(len, &format!("number of {name}"))?, name) }?;
    match indices.iter().position(|&index| index >= 0 && index as usize >= end) {
        None => Ok(indices),
        Some(at) => Err(Failure::new(LAS_INDEX, format!("`{name}[{at}]` is {}; there are {end}", indices[at]))),
    }
}

/// Returns `slots[first..first + len]`.
pub(super) fn slot_range<S>(slots: &[S], first: i32, len: i32) -> Result<&[S], Failure> {
    let (first, len) = (count(first, "first")?, count(len, "count")?);
    let range = first.checked_add(len).and_then(|end| slots.get(first..end));
    range.ok_or_else(|| {
        Failure::new(LAS_SIZE, format!("there are {} positions; {first} to {first} + {len} are requested", slots.len()))
    })
}

/// Returns an error if two sizes differ.
pub(super) fn check_equal_sizes(what: &str, a: usize, b: usize) -> Result<(), Failure> {
    if a == b { Ok(()) } else { Err(Failure::new(LAS_SIZE, format!("{what} have {a} and {b} entries"))) }
}

/// Returns an error if two handles are equal and not null.
pub(super) fn check_distinct<T>(a: *const T, b: *const T, what: &str) -> Result<(), Failure> {
    if a.is_null() || !std::ptr::eq(a, b) {
        Ok(())
    } else {
        Err(Failure::new(LAS_SIZE, format!("{what} are the same vector")))
    }
}

/// Returns an error if a handle in `written` occurs twice, or also in `read`.
pub(super) fn check_all_distinct<T>(read: &[*const T], written: &[*mut T]) -> Result<(), Failure> {
    // Null handles are reported later, with their name.
    let is_repeated = |(k, handle): (usize, &*mut T)| {
        !handle.is_null() && (written[..k].contains(handle) || read.contains(&handle.cast_const()))
    };
    if written.iter().enumerate().any(is_repeated) {
        return Err(Failure::new(LAS_SIZE, "a vector that is written occurs twice"));
    }
    Ok(())
}

/// Objects of the caller, collected into one slice for reading: bitwise copies that are never dropped.
pub(super) struct Borrowed<T>(Vec<ManuallyDrop<T>>);

impl<T> Borrowed<T> {
    /// # Safety
    /// The objects are live and unchanged as long as this value exists.
    pub(super) unsafe fn new(objects: impl Iterator<Item = Result<*const T, Failure>>) -> Result<Self, Failure> {
        // SAFETY: the copy is only read, through shared references, and never dropped.
        let copy = |object: *const T| ManuallyDrop::new(unsafe { object.read() });
        Ok(Self(objects.map(|object| object.map(copy)).collect::<Result<_, _>>()?))
    }

    pub(super) fn as_slice(&self) -> &[T] {
        // SAFETY: `ManuallyDrop<T>` has the layout of `T`.
        unsafe { std::slice::from_raw_parts(self.0.as_ptr().cast(), self.0.len()) }
    }
}

/// Objects of the caller, collected into one slice for writing: they are moved here, and moved back when this value is
/// dropped, also during unwinding.
pub(super) struct BorrowedMut<T> {
    copies: Vec<ManuallyDrop<T>>,
    originals: Vec<*mut T>,
}

impl<T> BorrowedMut<T> {
    /// # Safety
    /// The objects are live and have no other user as long as this value exists; no two are the same.
    pub(super) unsafe fn new(objects: impl Iterator<Item = Result<*mut T, Failure>>) -> Result<Self, Failure> {
        let originals: Vec<*mut T> = objects.collect::<Result<_, _>>()?;
        // SAFETY: the original is overwritten later, not dropped.
        let copies = originals.iter().map(|original| ManuallyDrop::new(unsafe { original.read() })).collect();
        Ok(Self { copies, originals })
    }

    pub(super) fn as_mut_slice(&mut self) -> &mut [T] {
        // SAFETY: `ManuallyDrop<T>` has the layout of `T`.
        unsafe { std::slice::from_raw_parts_mut(self.copies.as_mut_ptr().cast(), self.copies.len()) }
    }
}

impl<T> Drop for BorrowedMut<T> {
    fn drop(&mut self) {
        for (copy, original) in self.copies.drain(..).zip(&self.originals) {
            // SAFETY: `original` is the place from which the object was read.
            unsafe { original.write(ManuallyDrop::into_inner(copy)) };
        }
    }
}

/// Converts an error of the backend.
pub(super) fn backend_error<F: std::error::Error>(error: F) -> Failure {
    Failure::new(LAS_BACKEND_ERROR, error.to_string())
}

/// Converts the error of a solve or product.
pub(super) fn solve_error<F: std::error::Error>(error: SolveError<F>) -> Failure {
    let code = match &error {
        SolveError::NotSquare { .. }
        | SolveError::Size { .. }
        | SolveError::Pattern
        | SolveError::UnsymmetricPattern { .. }
        | SolveError::TooLarge(_) => LAS_SIZE,
        SolveError::Parameter(_) => LAS_ARGUMENT,
        SolveError::NotFactored => LAS_NOT_FACTORED,
        SolveError::Singular { .. }
        | SolveError::ZeroDiagonal { .. }
        | SolveError::Indefinite { .. }
        | SolveError::SingularBorder { .. } => LAS_SINGULAR,
        SolveError::NotConverged { .. }
        | SolveError::Inaccurate { .. }
        | SolveError::NotFinite { .. }
        | SolveError::RhsNotFinite => LAS_NOT_CONVERGED,
        SolveError::Unsupported { .. } => LAS_UNSUPPORTED,
        SolveError::Library { .. } | SolveError::Backend(_) => LAS_BACKEND_ERROR,
    };
    Failure::new(code, error.to_string())
}
