//! Compares the Cholesky factorization of the backend `sparse` with that of faer, as compiled in a crate that uses
//! both:
//!
//! ```text
//! cargo run --release --package downstream --example cholesky -- [CELLS ...]
//! ```
//!
//! The matrix is the stiffness of a box of CELLS cells per side with six tetrahedra each, clamped at one face or on
//! rollers at three faces. Both solvers factor the same values in the same elimination order, alternately, and each
//! reuses its memory; each time is the minimum of many, in ms. The following command builds with cargo's default
//! release profile instead of the profile of this workspace:
//!
//! ```text
//! CARGO_PROFILE_RELEASE_LTO=false CARGO_PROFILE_RELEASE_CODEGEN_UNITS=16 cargo run ...
//! ```

use std::sync::Arc;
use std::time::Instant;

use biotissue::backends::sparse::{Matrix, Sparse, Symbolic};
use biotissue::fem::assembly::{self, Assembler, Unknowns};
use biotissue::fem::material::NeoHookean;
use biotissue::fem::mesh::shapes;
use biotissue::fem::point_field::{FormulaField, PointField, PointResponses};
use biotissue::las::{Backend, MatrixOps, Solver, SolverParams, Sparsity, Symmetry};
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::perm::PermRef;
use faer::sparse::linalg::SupernodalThreshold;
use faer::sparse::linalg::cholesky::{CholeskySymbolicParams, SymbolicCholesky, SymmetricOrdering};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMat};
use faer::{Par, Side, Spec};

type Error = Box<dyn std::error::Error>;

/// The supports of a body.
#[derive(Clone, Copy, Debug)]
enum Supports {
    /// All components are prescribed on one face.
    Clamped,
    /// The normal component is prescribed on three faces: the planes of symmetry of a larger body.
    Rollers,
}

impl Supports {
    /// Returns whether the displacement in this direction is prescribed at `x`.
    fn fix(self, x: [f64; 3], direction: usize) -> bool {
        match self {
            Self::Clamped => x[0] == 0.0,
            Self::Rollers => x[direction] == 0.0,
        }
    }
}

/// Assembles the stiffness of the unit cube at rest.
fn stiffness(cells: usize, supports: Supports) -> Result<(Arc<Sparsity>, Matrix), Error> {
    let mesh = shapes::cuboid([cells; 3], [1.0; 3])?;
    let unknowns = Unknowns::new(mesh.nodes().len(), |node, direction| supports.fix(mesh.nodes()[node], direction))?;
    let pattern = Arc::new(unknowns.pattern(&mesh)?);
    let mut matrix = Sparse::<f64>::matrix(&(), &pattern)?;
    let assembler = Assembler::<Sparse>::new(assembly::geometry(&mesh)?, &unknowns, &matrix)?;
    let mut field = FormulaField::uniform(NeoHookean { mu: 3846.0, lambda: 5769.0 }, &mesh);
    let (mut gradients, mut responses) = (Vec::new(), PointResponses::zeros(mesh.points().len()));
    let at_rest = vec![[0.0; 3]; mesh.nodes().len()];
    assembler.deformation_gradients(&at_rest, &mut gradients);
    field.update(&gradients, &mut responses)?;
    assembler.stiffness(&at_rest, &[], &responses, &mut matrix)?;
    matrix.finish()?;
    Ok((pattern, matrix))
}

/// faer's supernodal Cholesky factorization in a given order.
struct Faer {
    lower: SymbolicSparseColMat<u32>,
    values: Vec<f64>,
    symbolic: SymbolicCholesky<u32>,
    factor: Vec<f64>,
    memory: MemBuffer,
}

impl Faer {
    /// Copies the lower triangle of the matrix and analyzes it; `order` lists the unknowns by pivot.
    fn new(pattern: &Sparsity, matrix: &Matrix, order: &[u32]) -> Result<Self, Error> {
        let n = pattern.rows();
        let (mut starts, mut rows, mut values) = (vec![0], Vec::new(), Vec::new());
        for column in 0..n {
            let first = pattern.row_offsets()[column] as usize;
            for (k, &row) in pattern.row(column).iter().enumerate().filter(|&(_, &row)| row as usize >= column) {
                rows.push(row);
                values.push(matrix.values()[first + k]);
            }
            starts.push(rows.len() as u32);
        }
        let lower = SymbolicSparseColMat::new_checked(n, n, starts, None, rows);
        let mut inverse = vec![0; n];
        for (position, &unknown) in (0..).zip(order) {
            inverse[unknown as usize] = position;
        }
        let order = SymmetricOrdering::Custom(PermRef::new_checked(order, &inverse, n));
        let params = CholeskySymbolicParams {
            supernodal_flop_ratio_threshold: SupernodalThreshold::FORCE_SUPERNODAL,
            ..CholeskySymbolicParams::default()
        };
        let symbolic =
            faer::sparse::linalg::cholesky::factorize_symbolic_cholesky(lower.as_ref(), Side::Lower, order, params)
                .map_err(|error| format!("{error:?}"))?;
        let memory = MemBuffer::new(symbolic.factorize_numeric_llt_scratch::<f64>(Par::Seq, Spec::default()));
        let factor = vec![0.0; symbolic.len_val()];
        Ok(Self { lower, values, symbolic, factor, memory })
    }

    fn factor(&mut self) -> Result<(), Error> {
        let matrix = SparseColMatRef::new(self.lower.as_ref(), &self.values);
        let stack = MemStack::new(&mut self.memory);
        self.symbolic
            .factorize_numeric_llt(
                &mut self.factor,
                matrix,
                Side::Lower,
                Default::default(),
                Par::Seq,
                stack,
                Spec::default(),
            )
            .map(drop)
            .map_err(|error| format!("{error:?}").into())
    }
}

/// The minimum of several times, ms.
struct Smallest(f64);

impl Smallest {
    /// Measures the time of `work` and returns its result.
    fn of<R>(&mut self, work: impl FnOnce() -> R) -> R {
        let start = Instant::now();
        let result = work();
        self.0 = self.0.min(1e3 * start.elapsed().as_secs_f64());
        result
    }
}

/// Prints the row of the table for one matrix.
fn compare(cells: usize, supports: Supports) -> Result<(), Error> {
    let (pattern, matrix) = stiffness(cells, supports)?;
    let params = SolverParams::new(Symmetry::Definite);
    let [mut analysis, mut ours, mut theirs, mut one, mut six] = [const { Smallest(f64::INFINITY) }; 5];
    let analyze = || Sparse::<f64>::analyze(&(), &pattern, &params);
    let mut symbolic: Arc<Symbolic> = analysis.of(analyze)?;
    for _ in 0..if pattern.rows() < 10_000 { 4 } else { 1 } {
        symbolic = analysis.of(analyze)?;
    }
    let mut solver = Sparse::solver(&symbolic)?;
    let mut faer = Faer::new(&pattern, &matrix, symbolic.order())?;
    let right = vec![vec![1.0; pattern.rows()].into(); 6];
    let mut solution = right.clone();
    let operations = symbolic.operations().unwrap_or(0.0);
    let rounds = (4e10 / operations).clamp(5.0, 500.0) as usize;
    for _ in 0..rounds {
        ours.of(|| solver.factor(&matrix))?;
        theirs.of(|| faer.factor())?;
        one.of(|| solver.solve(&right[0], &mut solution[0]))?;
        six.of(|| solver.solve_many(&right, &mut solution))?;
    }
    println!(
        "| {:8} | {:5} | {:8.1} | {:8.3} | {:8.3} | {:5.2} | {:7.3} | {:7.3} | {:8.2} |",
        format!("{supports:?}").to_lowercase(),
        pattern.rows(),
        1e-6 * operations,
        ours.0,
        theirs.0,
        theirs.0 / ours.0,
        one.0,
        six.0,
        analysis.0
    );
    Ok(())
}

fn main() -> Result<(), Error> {
    let cells: Vec<usize> = std::env::args().skip(1).map(|word| word.parse()).collect::<Result<_, _>>()?;
    let cells = if cells.is_empty() { vec![4, 9, 14] } else { cells };
    println!("| supports | unknowns | MFLOP | factor | faer's | faer's / ours | solve | 6 at once | analysis |");
    println!("|---|---|---|---|---|---|---|---|---|");
    for cells in cells {
        for supports in [Supports::Clamped, Supports::Rollers] {
            compare(cells, supports)?;
        }
    }
    Ok(())
}
