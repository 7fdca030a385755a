//! Errors of PETSc.

use std::cell::RefCell;
use std::ffi::{CStr, CString, c_char, c_int, c_void};
use std::fmt;

use mpi::ffi::MPI_Comm;

use super::ffi;

/// An error of PETSc: its code, its text, and the function that detected it.
///
/// The type is a single pointer, so that the result of a successful operation fits in a register.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PetscError(Box<Details>);

#[derive(Clone, Debug, PartialEq, Eq)]
struct Details {
    code: i32,
    text: String,
    function: String,
}

impl PetscError {
    /// Returns PETSc's error code (`petscerror.h`).
    pub fn code(&self) -> i32 {
        self.0.code
    }

    /// Returns PETSc's error message.
    pub fn text(&self) -> &str {
        &self.0.text
    }

    /// Returns the name of the function that detected the error.
    pub fn function(&self) -> &str {
        &self.0.function
    }

    /// Creates an error that this backend detects before PETSc would.
    #[cold]
    pub(super) fn found(code: i32, function: &str, text: String) -> Self {
        Self(Box::new(Details { code, text, function: function.to_owned() }))
    }

    /// Creates the error that the last call on this thread returned.
    #[cold]
    fn last(code: c_int) -> Self {
        let (function, specific) = LAST.with_borrow_mut(Option::take).unwrap_or_default();
        let general = general_text(code);
        let text = match (general.is_empty(), specific.is_empty()) {
            (_, true) => general,
            (true, false) => specific,
            (false, false) => format!("{general}: {specific}"),
        };
        Self(Box::new(Details { code, text, function }))
    }
}

impl fmt::Display for PetscError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Details { code, text, function } = &*self.0;
        let place = if function.is_empty() { String::new() } else { format!(" in {function}") };
        write!(f, "PETSc error {code}{place}: {text}")
    }
}

impl std::error::Error for PetscError {}

/// Converts the return code of a call into a result.
#[inline(always)]
pub(super) fn check(code: ffi::Code) -> Result<(), PetscError> {
    if code == 0 { Ok(()) } else { Err(PetscError::last(code)) }
}

/// Converts a text into a C string. Returns an error if it contains a NUL character.
pub(super) fn c_string(text: &str) -> Result<CString, PetscError> {
    CString::new(text).map_err(|_| {
        PetscError::found(ffi::ERR_ARG_WRONG, "CString::new", format!("{text:?} contains a NUL character"))
    })
}

/// Copies a text of PETSc; returns an empty string for a null pointer.
///
/// # Safety
/// `text` is null or a C string.
pub(super) unsafe fn copy_c_string(text: *const c_char) -> String {
    if text.is_null() {
        return String::new();
    }
    // SAFETY: not null, and otherwise promised by the caller.
    unsafe { CStr::from_ptr(text) }.to_string_lossy().into_owned()
}

/// Returns PETSc's general message for an error code.
fn general_text(code: c_int) -> String {
    let mut text = std::ptr::null();
    // SAFETY: writes one pointer to a constant string; reads a table and nothing else. The third argument may be null.
    unsafe {
        ffi::PetscErrorMessage(code, &raw mut text, std::ptr::null_mut());
        copy_c_string(text)
    }
}

thread_local! {
    /// Function and text of the last detected error.
    static LAST: RefCell<Option<(String, String)>> = const { RefCell::new(None) };
}

/// The error handler: stores the message that PETSc would print.
pub(super) extern "C" fn error_handler(
    _: MPI_Comm,
    _: c_int,
    function: *const c_char,
    _: *const c_char,
    code: ffi::Code,
    kind: c_int,
    text: *const c_char,
    _: *mut c_void,
) -> ffi::Code {
    if kind == ffi::ERROR_INITIAL {
        // SAFETY: PETSc passes null or C strings.
        let found = unsafe { (copy_c_string(function), copy_c_string(text).trim().to_owned()) };
        // This code must not unwind into C: on a thread that is ending, or for an error within an error, it stores
        // nothing.
        let _ = LAST.try_with(|last| last.try_borrow_mut().map(|mut last| *last = Some(found)));
    }
    code
}
