//! Tests of the mesh itself.
