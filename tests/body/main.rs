//! The macro scale: meshes, equilibrium, convergence, published results.

#[cfg(any(feature = "sparse", feature = "dense"))]
#[path = "../bar_of_24/mod.rs"]
mod bar_of_24;

#[cfg(any(feature = "sparse", feature = "dense"))]
mod bar_of_24_tets;
#[cfg(feature = "sparse")]
mod convergence;
#[cfg(feature = "sparse")]
mod cooks_membrane;
#[cfg(feature = "sparse")]
mod elements;
#[cfg(feature = "sparse")]
mod equilibrium;
mod gmsh;
#[cfg(feature = "sparse")]
mod heart_beam;
#[cfg(feature = "sparse")]
mod meshes;
#[cfg(feature = "sparse")]
mod newton;
#[cfg(feature = "sparse")]
mod other_code;
#[cfg(feature = "sparse")]
mod pressure;
#[cfg(feature = "sparse")]
mod rigid_surfaces;
#[cfg(feature = "sparse")]
mod state_dependent_loads;
#[cfg(feature = "sparse")]
mod stiffness;
#[cfg(feature = "sparse")]
mod thick_walls;
#[cfg(feature = "sparse")]
mod tube;
#[cfg(feature = "sparse")]
mod volume_constraints;
