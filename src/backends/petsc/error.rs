//! What PETSc says when it fails.

use std::cell::RefCell;
use std::ffi::{CStr, CString, c_char, c_int, c_void};
use std::fmt;

use mpi::ffi::MPI_Comm;

use super::ffi;

/// An error of PETSc: its code, its own text, and the function that found it.
///
/// One pointer, so that a verb that succeeds returns in a register.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PetscError(Box<Details>);

#[derive(Clone, Debug, PartialEq, Eq)]
struct Details {
    code: i32,
    text: String,
    function: String,
}

impl PetscError {
    /// PETSc's number of the error (`petscerror.h`).
    #[must_use]
    pub fn code(&self) -> i32 {
        self.0.code
    }

    /// What PETSc says about it.
    #[must_use]
    pub fn text(&self) -> &str {
        &self.0.text
    }

    /// The function that found it.
    #[must_use]
    pub fn function(&self) -> &str {
        &self.0.function
    }

    /// One that this backend finds before PETSc would.
    #[cold]
    pub(super) fn found(code: i32, function: &str, text: String) -> Self {
        Self(Box::new(Details { code, text, function: function.to_owned() }))
    }

    /// The one that this thread's last call returned.
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

/// The return code of a call.
#[inline(always)]
pub(super) fn check(code: ffi::Code) -> Result<(), PetscError> {
    if code == 0 { Ok(()) } else { Err(PetscError::last(code)) }
}

/// A name for PETSc.
pub(super) fn c_string(text: &str) -> Result<CString, PetscError> {
    CString::new(text).map_err(|_| {
        PetscError::found(ffi::ERR_ARG_WRONG, "CString::new", format!("{text:?} holds a zero, which no C string can"))
    })
}

/// Text of PETSc's; empty where there is none.
///
/// # Safety
/// `text` is null or a C string.
pub(super) unsafe fn owned(text: *const c_char) -> String {
    if text.is_null() {
        return String::new();
    }
    // SAFETY: not null, and the caller's promise.
    unsafe { CStr::from_ptr(text) }.to_string_lossy().into_owned()
}

/// What PETSc says about every error of that code.
fn general_text(code: c_int) -> String {
    let mut text = std::ptr::null();
    // SAFETY: writes one pointer to a constant string; reads a table and nothing else. The third argument may be null.
    unsafe {
        ffi::PetscErrorMessage(code, &raw mut text, std::ptr::null_mut());
        owned(text)
    }
}

thread_local! {
    /// Function and text of the error found last.
    static LAST: RefCell<Option<(String, String)>> = const { RefCell::new(None) };
}

/// Keeps what PETSc would print.
pub(super) extern "C" fn keep(
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
        // SAFETY: PETSc hands over null or C strings.
        let found = unsafe { (owned(function), owned(text).trim().to_owned()) };
        // Neither may unwind into C: a thread that ends, or an error within an error, keeps nothing.
        let _ = LAST.try_with(|last| last.try_borrow_mut().map(|mut last| *last = Some(found)));
    }
    code
}
