//! The verbs of every backend in the three ways of an interface that is chosen at run time or link time: functions of
//! another compilation unit (this crate), a table of function pointers, and a trait object.

/// Passes the verbs that access single entries to a macro: the name of each, its arguments in terms of the types `Vector`,
/// `Matrix`, `Scalar`, `Reduced` and `Slot` in scope there, its return type, and its call through LAS on the backend `B`. More
/// verbs may follow.
#[macro_export]
macro_rules! for_each_verb_of_entries {
    ($callback:ident $(, $($more:tt)+)?) => {
        $callback! {
            vector_zero(y: &mut Vector) -> () = VectorOps::<B>::zero(y);
            vector_add(y: &mut Vector, rows: &[i32], values: &[Scalar]) -> () = VectorOps::<B>::add(y, rows, values);
            vector_set(y: &mut Vector, rows: &[i32], values: &[Scalar]) -> () = VectorOps::<B>::set(y, rows, values);
            vector_get(y: &Vector, rows: &[i32], values: &mut [Scalar]) -> () = VectorOps::<B>::get(y, rows, values);
            vector_local(y: &mut Vector, value: Scalar) -> () =
                VectorOps::<B>::with_local_mut(y, |values| values.iter_mut().for_each(|entry| *entry = value));
            matrix_zero(k: &mut Matrix) -> () = MatrixOps::<B>::zero(k);
            matrix_zero_rows(k: &mut Matrix, rows: &[i32]) -> () = MatrixOps::<B>::zero_rows(k, rows);
            matrix_add(k: &mut Matrix, rows: &[i32], cols: &[i32], block: &[Scalar]) -> () =
                MatrixOps::<B>::add(k, rows, cols, block);
            matrix_set(k: &mut Matrix, rows: &[i32], cols: &[i32], block: &[Scalar]) -> () =
                MatrixOps::<B>::set(k, rows, cols, block);
            matrix_get(k: &Matrix, rows: &[i32], cols: &[i32], block: &mut [Scalar]) -> () =
                MatrixOps::<B>::get(k, rows, cols, block);
            matrix_add_at(k: &mut Matrix, slots: &[Slot], block: &[Scalar]) -> () =
                MatrixOps::<B>::add_at(k, slots, block);
            $($($more)+)?
        }
    };
}

/// Passes every verb to a macro, as [`for_each_verb_of_entries`].
#[macro_export]
macro_rules! for_each_verb {
    ($callback:ident) => {
        $crate::for_each_verb_of_entries! {
            $callback,
            vector_norm(y: &Vector) -> Reduced = VectorOps::<B>::norm(y);
            vector_dot(x: &Vector, y: &Vector) -> Reduced = VectorOps::<B>::dot(x, y);
            vector_axpy(y: &mut Vector, a: Scalar, x: &Vector) -> () = VectorOps::<B>::axpy(y, a, x);
            vector_finish(y: &mut Vector) -> () = VectorOps::<B>::finish(y);
            matrix_finish(k: &mut Matrix) -> () = MatrixOps::<B>::finish(k);
        }
    };
}

macro_rules! ways {
    ($($name:ident($($arg:ident: $of:ty),*) -> $out:ty = $call:expr;)*) => {
        $(
            /// A function of this unit.
            ///
            /// # Errors
            /// Returns the error of the backend.
            #[inline(never)]
            pub fn $name($($arg: $of),*) -> Result<$out, Error> {
                $call
            }
        )*

        /// The verbs as function pointers.
        pub struct Table {
            $(
                /// The verb.
                pub $name: fn($($of),*) -> Result<$out, Error>,
            )*
        }

        /// The verbs of this backend.
        pub static TABLE: Table = Table { $($name),* };

        /// The verbs as methods of an object.
        pub trait Operations {
            $(
                /// The verb.
                ///
                /// # Errors
                /// Returns the error of the backend.
                fn $name(&self, $($arg: $of),*) -> Result<$out, Error>;
            )*
        }

        /// The object of this backend.
        pub struct Object;

        impl Operations for Object {
            $(
                fn $name(&self, $($arg: $of),*) -> Result<$out, Error> {
                    $call
                }
            )*
        }

        /// Returns the addresses of the functions of this unit.
        pub fn functions() -> Vec<*const ()> {
            vec![$($name as *const ()),*]
        }

        /// Returns the addresses of the methods.
        pub fn methods() -> Vec<*const ()> {
            vec![$(<Object as Operations>::$name as *const ()),*]
        }
    };
}

macro_rules! backend {
    ($(#[$attribute:meta])* $module:ident, $backend:ty, $verbs:ident) => {
        $(#[$attribute])*
        pub mod $module {
            use biotissue::las::{Backend, MatrixOps, VectorOps};

            /// The backend.
            pub type B = $backend;
            /// Its vectors.
            pub type Vector = <B as Backend>::Vector;
            /// Its matrices.
            pub type Matrix = <B as Backend>::Matrix;
            /// Type of the entries of both.
            pub type Scalar = <B as Backend>::Scalar;
            /// Type of dot products and norms.
            pub type Reduced = <B as Backend>::Reduced;
            /// Positions in matrices.
            pub type Slot = <B as Backend>::Slot;
            /// Type of its errors.
            pub type Error = <B as Backend>::Error;

            $verbs!(ways);
        }
    };
}

backend!(
    /// Compressed rows.
    sparse, biotissue::backends::sparse::Sparse, for_each_verb
);
backend!(
    /// Dense matrices.
    dense, biotissue::backends::dense::Dense, for_each_verb
);
backend!(
    /// Four systems at once.
    batched, biotissue::backends::batched::Batched, for_each_verb
);
backend!(
    /// PETSc.
    #[cfg(feature = "petsc")]
    petsc, biotissue::backends::petsc::Petsc, for_each_verb
);
backend!(
    /// A CUDA device, whose other verbs start kernels and transfers.
    cuda, biotissue::backends::cuda::Cuda, for_each_verb_of_entries
);
