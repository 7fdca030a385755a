//! The module of one backend in the C interface, in which the generated functions are compiled.

macro_rules! exported {
    ($module:ident, $backend:ty, $file:literal) => {
        #[allow(
            non_camel_case_types,
            clippy::missing_safety_doc,
            reason = "names of C; the header states the safety conditions"
        )]
        mod $module {
            use std::ffi::c_char;
            use std::path::Path;

            use super::handles::*;
            use super::{Exported, LAS_INDEX, las_params, las_pattern};
            use crate::las::{self, Backend, Entries, MatMat, MatVec, MatrixOps, VectorOps};

            type B = $backend;
            type Context = <B as Backend>::Context;
            type Vector = <B as Backend>::Vector;
            type Matrix = <B as Backend>::Matrix;
            type Slot = <B as Backend>::Slot;
            type Solver = <B as Backend>::Solver;
            type Scalar = <B as Backend>::Scalar;

            fn length(vec: &Vector) -> usize {
                VectorOps::<B>::len(vec)
            }

            fn shape(mat: &Matrix) -> (usize, usize) {
                MatrixOps::<B>::shape(mat)
            }

            /// In a build with debug assertions, returns an error if a pair is not in the pattern.
            fn check_in_pattern(mat: &Matrix, rows: &[i32], cols: &[i32]) -> Result<(), Failure> {
                if !cfg!(debug_assertions) {
                    return Ok(());
                }
                let pattern = Entries::<B>::pattern(mat).map_err(backend_error)?;
                let mut pairs = rows.iter().flat_map(|&row| cols.iter().map(move |&column| (row, column)));
                let is_outside = |&(row, column): &(i32, i32)| {
                    row >= 0 && column >= 0 && pattern.find(row as usize, column as usize).is_none()
                };
                match pairs.find(is_outside) {
                    None => Ok(()),
                    Some(pair) => Err(Failure::new(LAS_INDEX, format!("{pair:?} is not in the pattern of the matrix"))),
                }
            }

            fn splat(value: f64) -> Scalar {
                <Scalar as las::Value>::splat(value)
            }

            include!(concat!(env!("OUT_DIR"), $file));
        }
    };
}

pub(super) use exported;
