//! The calls: every verb of every backend in five ways, each in a separate function of the program.
//!
//! `raw` calls the backend by hand, `las` through LAS, `call` a function of another compilation unit, `table` a
//! function pointer and `object` a method of a trait object; the functions that the last three call use LAS.

macro_rules! raw {
    ($($name:ident($($arg:ident: $of:ty),*) -> $out:ty = $call:expr;)*) => {
        $(
            #[inline(never)]
            pub fn $name($($arg: $of),*) -> Outcome<$out> {
                hand::$name($($arg),*)
            }
        )*

        pub(super) fn all() -> Vec<*const ()> {
            vec![$($name as *const ()),*]
        }
    };
}

macro_rules! las {
    ($($name:ident($($arg:ident: $of:ty),*) -> $out:ty = $call:expr;)*) => {
        $(
            #[inline(never)]
            pub fn $name($($arg: $of),*) -> Result<$out, Error> {
                $call
            }
        )*

        pub(super) fn all() -> Vec<*const ()> {
            vec![$($name as *const ()),*]
        }
    };
}

macro_rules! call {
    ($($name:ident($($arg:ident: $of:ty),*) -> $out:ty = $call:expr;)*) => {
        $(
            #[inline(never)]
            pub fn $name($($arg: $of),*) -> Result<$out, Error> {
                unit::$name($($arg),*)
            }
        )*

        pub(super) fn all() -> Vec<*const ()> {
            vec![$($name as *const ()),*]
        }
    };
}

macro_rules! table {
    ($($name:ident($($arg:ident: $of:ty),*) -> $out:ty = $call:expr;)*) => {
        $(
            #[inline(never)]
            pub fn $name(table: &Table, $($arg: $of),*) -> Result<$out, Error> {
                (table.$name)($($arg),*)
            }
        )*

        pub(super) fn all() -> Vec<*const ()> {
            vec![$($name as *const ()),*]
        }
    };
}

macro_rules! object {
    ($($name:ident($($arg:ident: $of:ty),*) -> $out:ty = $call:expr;)*) => {
        $(
            #[inline(never)]
            pub fn $name(object: &dyn Operations, $($arg: $of),*) -> Result<$out, Error> {
                object.$name($($arg),*)
            }
        )*

        pub(super) fn all() -> Vec<*const ()> {
            vec![$($name as *const ()),*]
        }
    };
}

macro_rules! names {
    ($($name:ident($($arg:ident: $of:ty),*) -> $out:ty = $call:expr;)*) => {
        /// The names of the verbs.
        const VERBS: &[&str] = &[$(stringify!($name)),*];
    };
}

macro_rules! backend {
    ($(#[$attribute:meta])* $module:ident, $verbs:ident) => {
        $(#[$attribute])*
        pub mod $module {
            /// By hand.
            pub mod raw {
                use overhead_unit::$verbs;

                use crate::by_hand::$module as hand;
                #[allow(unused_imports, reason = "some backends have fewer verbs")]
                use hand::{Matrix, Outcome, Reduced, Scalar, Slot, Vector};

                $verbs!(raw);
            }

            /// Through LAS.
            pub mod las {
                use biotissue::las::{MatrixOps, VectorOps};
                use overhead_unit::$verbs;
                #[allow(unused_imports, reason = "some backends have fewer verbs")]
                use overhead_unit::$module::{B, Error, Matrix, Reduced, Scalar, Slot, Vector};

                $verbs!(las);
            }

            /// Through a function of another compilation unit.
            pub mod call {
                use overhead_unit::$verbs;
                #[allow(unused_imports, reason = "some backends have fewer verbs")]
                use overhead_unit::$module::{self as unit, Error, Matrix, Reduced, Scalar, Slot, Vector};

                $verbs!(call);
            }

            /// Through a table of function pointers.
            pub mod table {
                use overhead_unit::$verbs;
                #[allow(unused_imports, reason = "some backends have fewer verbs")]
                use overhead_unit::$module::{Error, Matrix, Reduced, Scalar, Slot, Table, Vector};

                $verbs!(table);
            }

            /// Through a trait object.
            pub mod object {
                use overhead_unit::$verbs;
                #[allow(unused_imports, reason = "some backends have fewer verbs")]
                use overhead_unit::$module::{Error, Matrix, Operations, Reduced, Scalar, Slot, Vector};

                $verbs!(object);
            }

            /// Returns the addresses of the calling functions of all verbs, and of the functions that they call.
            pub fn places() -> Vec<super::Place> {
                use overhead_unit::$module::{functions, methods};
                use overhead_unit::$verbs;

                $verbs!(names);
                let name = stringify!($module);
                super::places(name, VERBS, [raw::all(), las::all(), call::all(), table::all(), object::all(), functions(), methods()])
            }
        }
    };
}

backend!(
    /// Compressed rows.
    sparse, for_each_verb
);
backend!(
    /// Dense matrices.
    dense, for_each_verb
);
backend!(
    /// Four systems at once.
    batched, for_each_verb
);
backend!(
    /// PETSc.
    #[cfg(feature = "petsc")]
    petsc, for_each_verb
);
backend!(
    /// A CUDA device.
    cuda, for_each_verb_of_entries
);

/// The backends of this build that run on this machine.
pub const BACKENDS: &[&str] =
    if cfg!(feature = "petsc") { &["sparse", "dense", "batched", "petsc"] } else { &["sparse", "dense", "batched"] };

/// The addresses of the functions that call one verb of one backend, and of the function and the method called.
pub struct Place {
    /// The backend.
    pub backend: &'static str,
    /// The verb.
    pub verb: &'static str,
    /// By hand.
    pub raw: *const (),
    /// Through LAS.
    pub las: *const (),
    /// Through a function of another compilation unit, a function pointer, a trait object.
    pub others: [*const (); 3],
    /// The functions called by these three.
    pub behind: [*const (); 3],
}

/// Combines the addresses, which are in the order of the verbs.
fn places(backend: &'static str, verbs: &[&'static str], addresses: [Vec<*const ()>; 7]) -> Vec<Place> {
    let place = |(k, &verb): (usize, &&'static str)| {
        let [raw, las, call, table, object, function, method] =
            [0, 1, 2, 3, 4, 5, 6].map(|way: usize| addresses[way][k]);
        Place { backend, verb, raw, las, others: [call, table, object], behind: [function, function, method] }
    };
    verbs.iter().enumerate().map(place).collect()
}

/// Returns the calls of all backends.
pub fn all() -> Vec<Place> {
    let mut all: Vec<Place> = [sparse::places(), dense::places(), batched::places()].into_iter().flatten().collect();
    #[cfg(feature = "petsc")]
    all.extend(petsc::places());
    all.extend(cuda::places());
    all
}
