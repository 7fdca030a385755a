//! The run-time compiler NVRTC.

use std::ffi::{CStr, CString};

use cudarc::nvrtc::{Ptx, result, sys};

use super::error::check_functions;
use super::{CudaError, CudaErrorKind};

/// A program of the compiler.
struct Program(sys::nvrtcProgram);

impl Drop for Program {
    fn drop(&mut self) {
        // SAFETY: the program was created by `compile` and is destroyed once.
        let _ = unsafe { result::destroy_program(self.0) };
    }
}

const LIBRARY: &str = "libnvrtc.so";
const PACKAGE: &str = "the CUDA toolkit or the Python package nvidia-cuda-nvrtc";

/// Returns an error if the compiler cannot be loaded, or is too old to write machine code.
pub(super) fn find() -> Result<(), CudaError> {
    // SAFETY: loads `libnvrtc`, whose initialization has no precondition.
    if !unsafe { sys::is_culib_present() } {
        return Err(CudaErrorKind::MissingLibrary { library: LIBRARY, package: PACKAGE }.into());
    }
    // SAFETY: as above; the library is there.
    let loaded = unsafe { sys::culib() };
    check_functions!(loaded, LIBRARY, PACKAGE, ["nvrtcGetCUBINSize", "nvrtcGetCUBIN"])
}

/// Returns true if the compiler is not installed, which a test reports and BIOTISSUE_REQUIRE_NVRTC=1 forbids.
#[cfg(test)]
pub(super) fn is_missing() -> bool {
    let Err(error) = find() else { return false };
    let is_required = std::env::var("BIOTISSUE_REQUIRE_NVRTC").is_ok_and(|required| required != "0");
    assert!(!is_required, "{error}");
    println!("skipped: {error}");
    true
}

/// Compiles a CUDA C++ source; this needs NVRTC, but no device.
///
/// For an architecture such as `sm_90`, the result is machine code, which any driver of the same major version loads;
/// for a virtual one such as `compute_90`, it is PTX, which a driver older than the compiler may refuse.
pub(crate) fn compile(source: &str, architecture: &str) -> Result<Ptx, CudaError> {
    find()?;
    let failed = |log: String| CudaError::from(CudaErrorKind::Compile { architecture: architecture.to_owned(), log });
    let of_status = |error: result::NvrtcError| failed(error.to_string());
    let source = CString::new(source).map_err(|error| failed(error.to_string()))?;
    let program = Program(result::create_program(&source, None).map_err(of_status)?);
    let options = [format!("--gpu-architecture={architecture}"), "--std=c++17".to_owned()];
    // SAFETY: the program is valid until the end of this function, and so is its source.
    unsafe {
        if let Err(error) = result::compile_program(program.0, &options) {
            let log = result::get_program_log(program.0).map_err(of_status)?;
            let log =
                if log.is_empty() { String::new() } else { CStr::from_ptr(log.as_ptr()).to_string_lossy().into() };
            return Err(failed(format!("{error}: {}", log.trim())));
        }
        if !architecture.starts_with("sm_") {
            let ptx = result::get_ptx(program.0).map_err(of_status)?;
            return Ok(Ptx::from_src(CStr::from_ptr(ptx.as_ptr()).to_string_lossy()));
        }
        let mut bytes = 0;
        sys::nvrtcGetCUBINSize(program.0, &mut bytes).result().map_err(of_status)?;
        let mut code = vec![0_u8; bytes];
        sys::nvrtcGetCUBIN(program.0, code.as_mut_ptr().cast()).result().map_err(of_status)?;
        Ok(Ptx::from_binary(code))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_of_the_compiler_name_the_line() {
        if is_missing() {
            return;
        }
        let error = compile("extern \"C\" __global__ void wrong() { unknown(); }", "sm_90").unwrap_err();
        assert!(error.to_string().contains("sm_90") && error.to_string().contains("unknown"), "{error}");
        let right = "extern \"C\" __global__ void right() {}";
        assert!(compile(right, "sm_90").is_ok());
        assert!(compile(right, "compute_90").unwrap().to_src().contains(".entry right"));
    }

    #[test]
    fn an_old_library_is_reported() {
        if is_missing() {
            return;
        }
        // SAFETY: the library is there.
        let loaded = unsafe { sys::culib() };
        let error = check_functions!(loaded, LIBRARY, PACKAGE, ["nvrtcVersion", "nvrtcOfTomorrow"]).unwrap_err();
        assert_eq!(error.to_string().split(':').next(), Some("libnvrtc.so is too old, it has no nvrtcOfTomorrow"));
    }
}
