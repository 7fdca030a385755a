//! The linear-algebra backends, one folder each.
//!
//! | backend | cargo feature | for |
//! |---|---|---|
//! | `sparse` | `sparse` (default) | systems of any size in memory: compressed rows, direct and iterative solvers |
//! | `dense` | `dense` (default) | systems of a few hundred unknowns at most, and comparisons |
//! | `petsc` | `petsc` | large systems, on several processes; solvers chosen at run time |
//! | `batched` | `batched` | many systems with one pattern at once, one per lane |
//! | `cuda` | `cuda` | large systems with iterative solvers, on a graphics processor |

#[cfg(any(feature = "sparse", feature = "dense", feature = "batched", feature = "petsc"))]
mod checks;
#[cfg(any(feature = "sparse", feature = "batched"))]
mod csr;
#[cfg(any(feature = "sparse", feature = "dense"))]
mod direct;
#[cfg(any(feature = "sparse", feature = "dense"))]
mod iterative;
#[cfg(any(feature = "sparse", feature = "dense", feature = "petsc"))]
mod kept;
#[cfg(any(feature = "sparse", feature = "dense", feature = "batched", feature = "petsc"))]
mod local;
#[cfg(any(feature = "sparse", feature = "dense", feature = "petsc"))]
mod null_vector;

#[cfg(feature = "batched")]
pub mod batched;
pub mod comm;
#[cfg(feature = "cuda")]
pub mod cuda;
#[cfg(feature = "dense")]
pub mod dense;
#[cfg(feature = "metis")]
pub mod metis;
#[cfg(feature = "sparse")]
pub mod networks;
#[cfg(feature = "petsc")]
pub mod petsc;
#[cfg(feature = "sparse")]
pub mod sparse;

use std::fmt;
use std::str::FromStr;

/// The backends that the program's `--backend` knows, whether they are compiled in or not. `batched` is not among them,
/// because a body is one system.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum BackendName {
    /// Compressed rows and direct solvers.
    Sparse,
    /// Dense matrices.
    Dense,
    /// PETSc, on one or several processes.
    Petsc,
    /// Graphics processors of NVIDIA.
    Cuda,
}

impl BackendName {
    /// All backends.
    pub const ALL: [Self; 4] = [Self::Sparse, Self::Dense, Self::Petsc, Self::Cuda];

    /// The name of the backend in the program's `--backend` and in [`Backend::NAME`](crate::las::Backend::NAME).
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Sparse => "sparse",
            Self::Dense => "dense",
            Self::Petsc => "petsc",
            Self::Cuda => "cuda",
        }
    }

    /// The cargo feature that enables the backend.
    pub const fn feature(self) -> &'static str {
        self.as_str()
    }

    /// Returns true if this build contains the backend.
    pub const fn is_compiled(self) -> bool {
        match self {
            Self::Sparse => cfg!(feature = "sparse"),
            Self::Dense => cfg!(feature = "dense"),
            Self::Petsc => cfg!(feature = "petsc"),
            Self::Cuda => cfg!(feature = "cuda"),
        }
    }
}

impl fmt::Display for BackendName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.as_str())
    }
}

impl FromStr for BackendName {
    type Err = NotCompiledIn;

    /// Returns the backend with this name, or [`NotCompiledIn`] if this build does not contain it.
    fn from_str(name: &str) -> Result<Self, NotCompiledIn> {
        let known = Self::ALL.into_iter().find(|backend| backend.as_str() == name);
        match known {
            Some(backend) if backend.is_compiled() => Ok(backend),
            _ => Err(NotCompiledIn { name: name.to_owned(), feature: known.map(Self::feature) }),
        }
    }
}

/// Returns the names of the compiled-in backends, without `batched`: a body is one system.
pub fn compiled() -> &'static [&'static str] {
    &[
        #[cfg(feature = "sparse")]
        "sparse",
        #[cfg(feature = "dense")]
        "dense",
        #[cfg(feature = "petsc")]
        "petsc",
        #[cfg(feature = "cuda")]
        "cuda",
    ]
}

/// The error for a requested backend that is not part of this build.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NotCompiledIn {
    /// The requested name.
    pub name: String,
    /// The cargo feature that enables the backend; `None` if no backend has that name.
    pub feature: Option<&'static str>,
}

impl fmt::Display for NotCompiledIn {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { name, feature } = self;
        match feature {
            Some(feature) => {
                write!(f, "the backend `{name}` is not compiled in: build with `cargo build --features {feature}`")
            }
            None => {
                let known: Vec<_> = BackendName::ALL.iter().map(|backend| format!("`{backend}`")).collect();
                write!(f, "there is no backend `{name}`; the known backends are {}", known.join(", "))
            }
        }
    }
}

impl std::error::Error for NotCompiledIn {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_parsed_or_rejected_with_a_cure() {
        for backend in BackendName::ALL {
            let parsed = backend.as_str().parse::<BackendName>();
            assert_eq!(compiled().contains(&backend.as_str()), backend.is_compiled());
            match parsed {
                Ok(parsed) => assert!(backend.is_compiled() && parsed == backend),
                Err(error) => {
                    assert!(!backend.is_compiled());
                    let cure = format!("--features {}", backend.feature());
                    assert!(error.to_string().contains(&cure), "{error}");
                }
            }
        }
        let error = "petsk".parse::<BackendName>().unwrap_err();
        assert_eq!(
            error.to_string(),
            "there is no backend `petsk`; the known backends are `sparse`, `dense`, `petsc`, `cuda`"
        );
    }

    #[test]
    #[cfg(all(feature = "sparse", feature = "dense"))]
    fn names_are_those_of_the_backends() {
        use crate::las::Backend;
        assert_eq!(sparse::Sparse::<f64>::NAME, BackendName::Sparse.as_str());
        assert_eq!(dense::Dense::<f64>::NAME, BackendName::Dense.as_str());
    }
}
