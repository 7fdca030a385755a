//! The engineering scale: finite elements on tetrahedral meshes, generic over the linear-algebra backend.

pub mod mesh;
