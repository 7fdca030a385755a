//! The assembly loop: blocks of 12 by 12, one per tetrahedron, added to a matrix, in five ways of calling.

use std::sync::Arc;

use biotissue::las::{Sparsity, SparsityError};

/// The unknowns of one tetrahedron: three per node, negative if prescribed.
pub type Unknowns = [i32; 12];

/// Number of entries of a block.
pub const ENTRIES: usize = 144;

/// A cube of tetrahedra, fixed at the bottom.
pub struct Cube {
    /// Unknowns of every tetrahedron.
    pub elements: Vec<Unknowns>,
    /// Sparsity pattern of the tetrahedra.
    pub pattern: Arc<Sparsity>,
}

impl Cube {
    /// Creates a cube with `side` cells along an edge, six tetrahedra each.
    ///
    /// # Errors
    /// Returns [`SparsityError`] if the number of unknowns exceeds the index range.
    pub fn new(side: usize) -> Result<Self, SparsityError> {
        let line = side + 1;
        let node = |corner: [usize; 3]| corner[0] + line * (corner[1] + line * corner[2]);
        let unknown = |node: usize, axis: usize| {
            // The nodes of the bottom come first.
            if node < line * line { -1 } else { (3 * (node - line * line) + axis) as i32 }
        };
        let mut elements = Vec::with_capacity(6 * side.pow(3));
        for cell in 0..side.pow(3) {
            let origin = [cell % side, cell / side % side, cell / (side * side)];
            // For each order of the axes, a path of three edges from a corner to the opposite corner.
            for order in [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]] {
                let mut corner = origin;
                let mut nodes = [node(corner); 4];
                for (next, axis) in nodes[1..].iter_mut().zip(order) {
                    corner[axis] += 1;
                    *next = node(corner);
                }
                elements.push(std::array::from_fn(|k| unknown(nodes[k / 3], k % 3)));
            }
        }
        let unknowns = 3 * line * line * side;
        let pattern = Arc::new(Sparsity::from_elements(unknowns, &elements)?);
        Ok(Self { elements, pattern })
    }
}

macro_rules! loops {
    ($(#[$attribute:meta])* $module:ident) => {
        $(#[$attribute])*
        pub mod $module {
            use biotissue::las::MatrixOps;
            use overhead_unit::$module::{self as unit, B, Error, Matrix, Operations, Scalar, Table};

            use super::{ENTRIES, Unknowns};
            use crate::by_hand::$module as hand;

            /// By hand. The result of each call is handled as a caller would: tested if it can be an error.
            #[inline(never)]
            pub fn raw(k: &mut hand::Matrix, elements: &[Unknowns], block: &[hand::Scalar; ENTRIES]) -> hand::Outcome<()> {
                raw_loop!($module, k, elements, block)
            }

            /// Through LAS.
            ///
            /// # Errors
            /// Returns the error of the backend.
            #[inline(never)]
            pub fn las(k: &mut Matrix, elements: &[Unknowns], block: &[Scalar; ENTRIES]) -> Result<(), Error> {
                for unknowns in elements {
                    MatrixOps::<B>::add(k, unknowns, unknowns, block)?;
                }
                Ok(())
            }

            /// Through a function of another compilation unit.
            ///
            /// # Errors
            /// Returns the error of the backend.
            #[inline(never)]
            pub fn call(k: &mut Matrix, elements: &[Unknowns], block: &[Scalar; ENTRIES]) -> Result<(), Error> {
                for unknowns in elements {
                    unit::matrix_add(k, unknowns, unknowns, block)?;
                }
                Ok(())
            }

            /// Through a table of function pointers.
            ///
            /// # Errors
            /// Returns the error of the backend.
            #[inline(never)]
            pub fn table(
                table: &Table,
                k: &mut Matrix,
                elements: &[Unknowns],
                block: &[Scalar; ENTRIES],
            ) -> Result<(), Error> {
                for unknowns in elements {
                    (table.matrix_add)(k, unknowns, unknowns, block)?;
                }
                Ok(())
            }

            /// Through a trait object.
            ///
            /// # Errors
            /// Returns the error of the backend.
            #[inline(never)]
            pub fn object(
                object: &dyn Operations,
                k: &mut Matrix,
                elements: &[Unknowns],
                block: &[Scalar; ENTRIES],
            ) -> Result<(), Error> {
                for unknowns in elements {
                    object.matrix_add(k, unknowns, unknowns, block)?;
                }
                Ok(())
            }
        }
    };
}

macro_rules! raw_loop {
    (petsc, $k:ident, $elements:ident, $block:ident) => {{
        for unknowns in $elements {
            hand::matrix_add($k, unknowns, unknowns, $block)?;
        }
        Ok(())
    }};
    ($in_memory:ident, $k:ident, $elements:ident, $block:ident) => {
        for unknowns in $elements {
            hand::matrix_add($k, unknowns, unknowns, $block);
        }
    };
}

loops!(
    /// Compressed rows.
    sparse
);
loops!(
    /// Dense matrices.
    dense
);
loops!(
    /// Four systems at once.
    batched
);
loops!(
    /// PETSc: `MatSetValues`.
    #[cfg(feature = "petsc")]
    petsc
);

/// Runs the loop of one backend `times` times in one way, on a cube of `side` cells; returns the total time.
///
/// # Errors
/// Returns an error if the backend or the way does not exist, or if the backend fails.
pub fn run(
    backend: &str,
    way: &str,
    side: usize,
    times: usize,
) -> Result<std::time::Duration, Box<dyn std::error::Error>> {
    let cube = Cube::new(side)?;
    match backend {
        "sparse" => in_memory::sparse(&cube, way, times),
        "dense" => in_memory::dense(&cube, way, times),
        "batched" => in_memory::batched(&cube, way, times),
        #[cfg(feature = "petsc")]
        "petsc" => with_petsc(&cube, way, times),
        other => Err(format!("there is no backend {other} here").into()),
    }
}

/// Runs the named way `times` times and measures it.
macro_rules! timed {
    ($module:ident, $way:ident, $times:ident, $by_hand:expr, $matrix:expr, $cube:ident, $raw_block:expr, $block:expr) => {{
        use std::hint::black_box;
        use std::time::Instant;

        use overhead_unit::$module::{Object, TABLE};

        let elements = &$cube.elements[..];
        let (mut by_hand, mut matrix) = ($by_hand, $matrix);
        let (raw_block, block) = (&black_box($raw_block), &black_box($block));
        let (table, object) = (black_box(&TABLE), black_box(&Object as &dyn overhead_unit::$module::Operations));
        let start = Instant::now();
        for _ in 0..$times {
            match $way {
                "raw" => drop(black_box($module::raw(&mut by_hand, elements, raw_block))),
                "las" => $module::las(&mut matrix, elements, block)?,
                "call" => $module::call(&mut matrix, elements, block)?,
                "table" => $module::table(table, &mut matrix, elements, block)?,
                "object" => $module::object(object, &mut matrix, elements, block)?,
                other => return Err(format!("there is no way {other}").into()),
            }
        }
        Ok(start.elapsed())
    }};
}

mod in_memory {
    use std::error::Error;
    use std::sync::Arc;
    use std::time::Duration;

    use biotissue::backends::batched::{Batched, Lanes};
    use biotissue::backends::{dense::Dense, sparse::Sparse};
    use biotissue::las::Backend;

    use super::{Cube, ENTRIES, batched, dense, sparse};
    use crate::by_hand::csr::{Csr, Pattern};
    use crate::by_hand::four::Four;
    use crate::by_hand::full::Full;

    type Outcome = Result<Duration, Box<dyn Error>>;

    fn numbers() -> [f64; ENTRIES] {
        std::array::from_fn(|k| k as f64)
    }

    fn csr<T: Copy + Default>(cube: &Cube) -> Csr<T> {
        let (row_offsets, columns) = (cube.pattern.row_offsets().into(), cube.pattern.col_indices().into());
        let pattern = Arc::new(Pattern { cols: cube.pattern.cols(), row_offsets, columns });
        Csr { pattern, values: vec![T::default(); cube.pattern.nnz() + 1] }
    }

    pub fn sparse(cube: &Cube, way: &str, times: usize) -> Outcome {
        let matrix = <Sparse as Backend>::matrix(&(), &cube.pattern)?;
        timed!(sparse, way, times, csr::<f64>(cube), matrix, cube, numbers(), numbers())
    }

    pub fn dense(cube: &Cube, way: &str, times: usize) -> Outcome {
        let (rows, cols) = (cube.pattern.rows(), cube.pattern.cols());
        let full = Full { rows, cols, values: vec![0.0; rows * cols + 1] };
        let matrix = <Dense as Backend>::matrix(&(), &cube.pattern)?;
        timed!(dense, way, times, full, matrix, cube, numbers(), numbers())
    }

    pub fn batched(cube: &Cube, way: &str, times: usize) -> Outcome {
        let matrix = <Batched as Backend>::matrix(&(), &cube.pattern)?;
        let (hand, lanes) = (numbers().map(|value| Four([value; 4])), numbers().map(|value| Lanes([value; 4])));
        timed!(batched, way, times, csr::<Four>(cube), matrix, cube, hand, lanes)
    }
}

#[cfg(feature = "petsc")]
fn with_petsc(cube: &Cube, way: &str, times: usize) -> Result<std::time::Duration, Box<dyn std::error::Error>> {
    use std::sync::OnceLock;

    use biotissue::backends::petsc::{Context, Petsc};
    use biotissue::las::Backend;

    use crate::by_hand::petsc::Matrix;

    // MPI can be initialized only once per process.
    static CONTEXT: OnceLock<Context> = OnceLock::new();
    let context = match CONTEXT.get() {
        Some(context) => context,
        None => CONTEXT.get_or_init({
            let context = Context::world()?;
            || context
        }),
    };
    let matrix = Petsc::matrix(context, &cube.pattern)?;
    let other = Petsc::matrix(context, &cube.pattern)?;
    let by_hand = Matrix { mat: other.as_ptr(), array: std::ptr::null_mut(), len: 0 };
    let numbers: [f64; ENTRIES] = std::array::from_fn(|k| k as f64);
    timed!(petsc, way, times, by_hand, matrix, cube, numbers, numbers)
}
