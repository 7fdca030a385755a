//! Homogenization of a network in equilibrium: stress and condensed tangent.
//!
//! Two steps lead from the stiffness `K = dT/dx` of all nodes to the tangent `A = dP/dF` of the macro scale (C. Miehe
//! and A. Koch, *Computational micro-to-macro transitions of discretized microstructures undergoing small strains*,
//! Archive of Applied Mechanics 72 (2002) 300-317). `i` denotes the interior nodes, `b` those on the boundary, `T` the
//! nodal forces, `v` the sensitivities of the node positions to a strain, and `q = K v` those of the nodal forces.
//!
//! 1. *Static condensation* of the interior (Guyan 1965). In equilibrium, `T_i = 0` at every strain, so the
//!    sensitivities of the interior forces vanish:
//!
//!    ```text
//!    [ K_ii  K_ib ] [ v_i ]   [  0  ]          v_i = -K_ii^-1 K_ib v_b
//!    [ K_bi  K_bb ] [ v_b ] = [ q_b ]   =>     q_b = (K_bb - K_bi K_ii^-1 K_ib) v_b
//!    ```
//!
//!    The matrix in parentheses is the Schur complement of `K_ii`. It is never formed: its products with the few
//!    boundary motions of step 2 suffice, and each takes one solve with the factor of `K_ii`.
//! 2. *From boundary forces to stress and tangent.* The boundary follows the macro scale, `x_b = F X_b`. The work of
//!    both scales is equal (Hill 1963), `P : dF = kappa sum_b T_b . dF X_b` for every `dF`, with `kappa` from
//!    [`RveModel::scale`]. Hence `P` and its derivative, with `v_b(dF) = dF X_b`, are
//!
//!    ```text
//!    P = kappa sum_b T_b (x) X_b
//!    dF : A : dG = kappa v_b(dF) . q_b(dG) = kappa v(dF) . K v(dG)
//!    ```
//!
//!    The last product runs over all nodes, to which the interior contributes nothing because `q_i = 0`. It is
//!    stationary in `v_i`, so an error of the solve enters squared.
//!
//! Nine increments `dF = D F` span all `dF`. For the six symmetric unit increments `D = S_k`, the *strain modes*, the
//! boundary moves with `v_b = S_k x_b`; they need the solves of step 1. For the three skew ones, `D = W`, the network
//! rotates rigidly: `P(R F) = R P(F)` gives `A : (W F) = W P` without a solve. The form `D_k F : A : D_l F` is then known
//! for all pairs of these increments, hence for the unit entries of `D`, each a sum of two of them, and with
//! `D = dF F^-1` for those of `dF`: the components of `A`.
//!
//! The public interface is [`EquilibriumState`](super::equilibrium::EquilibriumState), which
//! [`super::equilibrium::equilibrate`] returns; the functions here read the workspace that it borrows.

use nalgebra::{Matrix3, SMatrix, Vector3};

use super::equilibrium::RveError;
use super::rve::{RveModel, transform};
use super::workspace::{MODES, Workspace};
use crate::las::{Backend, MatrixOps, RealBackend, SolveError, Solver, VectorOps};

/// The result of work with the linear system.
type Solved<B, T = ()> = Result<T, SolveError<<B as Backend>::Error>>;

/// `dP/dF`, with row or column index `3 i + J` for `P_iJ` or `F_iJ`.
pub type Tangent = SMatrix<f64, 9, 9>;

/// Implements [`EquilibriumState::pk1`](super::equilibrium::EquilibriumState::pk1).
pub(super) fn pk1<B: RealBackend>(model: &RveModel<B>, workspace: &Workspace<B>) -> Matrix3<f64> {
    let network = model.network();
    let mut sum = Matrix3::zeros();
    for &node in network.boundary() {
        let (t, x) = (workspace.forces[node as usize], network.nodes()[node as usize]);
        sum += Vector3::from(t) * Vector3::from(x).transpose();
    }
    sum * model.scale()
}

/// Implements [`EquilibriumState::tangent`](super::equilibrium::EquilibriumState::tangent); requires [`solve_modes`].
pub(super) fn tangent<B: RealBackend>(
    model: &RveModel<B>,
    f: &Matrix3<f64>,
    pk1: &Matrix3<f64>,
    workspace: &Workspace<B>,
) -> Result<Tangent, RveError<B::Error>> {
    let form = sensitivity_products(workspace);
    tangent_from_form(&form, model.scale(), f, pk1).ok_or(RveError::Inverted(f.determinant()))
}

/// Returns the tangent at `f`, where the stress is `pk1`, from the products of [`sensitivity_products`] and the stress
/// scale; `None` if `f` has no inverse.
pub(crate) fn tangent_from_form(
    products: &[[f64; MODES]; 9],
    scale: f64,
    f: &Matrix3<f64>,
    pk1: &Matrix3<f64>,
) -> Option<Tangent> {
    let inverse = f.try_inverse()?;
    // Rows are entries `(i, j)` of an increment `D`, columns the nine unit increments. The six columns of the strains
    // follow from the force sensitivities, the three columns of the spins from the stress, `E F : W P = E : W P F^T`.
    // The two mixed blocks are not assumed to be transposes of each other: they are only to the accuracy of the balance
    // of forces and moments.
    let mut columns = Tangent::zeros();
    for l in 0..MODES {
        for (entry, value) in entries(|k| products[k][l]).into_iter().enumerate() {
            columns[(entry, l)] = value * scale;
        }
    }
    let moment = pk1 * f.transpose();
    for w in 0..3 {
        let turned = spin(w) * moment;
        for entry in 0..9 {
            columns[(entry, MODES + w)] = turned[(entry / 3, entry % 3)];
        }
    }
    let mut form = Tangent::zeros();
    for row in 0..9 {
        for (entry, value) in entries(|l| columns[(row, l)]).into_iter().enumerate() {
            form[(row, entry)] = value;
        }
    }
    Some(times_inverse(&form, &inverse))
}

/// The `k`-th symmetric unit increment `S_k`, in Voigt order 11, 22, 33, 23, 13, 12.
pub(super) fn strain(k: usize) -> Matrix3<f64> {
    const PAIRS: [(usize, usize); MODES] = [(0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1)];
    let (i, j) = PAIRS[k];
    let mut s = Matrix3::zeros();
    s[(i, j)] = 1.0;
    s[(j, i)] = 1.0;
    s
}

/// The `w`-th skew unit increment: the rotation about axis `w`.
fn spin(w: usize) -> Matrix3<f64> {
    let (i, j) = [(2, 1), (0, 2), (1, 0)][w];
    let mut s = Matrix3::zeros();
    s[(i, j)] = 1.0;
    s[(j, i)] = -1.0;
    s
}

/// Transforms a linear form, given by its values at the nine unit increments, to its values at the unit entries
/// `e_i (x) e_j`, in the order `3 i + j`: on the diagonal `S_k` itself, otherwise half of `S_k` plus or minus half of `W`.
fn entries(at: impl Fn(usize) -> f64) -> [f64; 9] {
    let [sum, difference] = [1.0, -1.0].map(|sign| [0, 1, 2].map(|k| 0.5 * (at(3 + k) + sign * at(MODES + k))));
    [at(0), difference[2], sum[1], sum[2], at(1), difference[0], difference[1], sum[0], at(2)]
}

/// Transforms a form in the entries of `D = dF F^-1` to one in those of `dF`: `dF = e_i (x) e_J` has the entries
/// `D_ij = F^-1_Jj`.
fn times_inverse(form: &Tangent, inverse: &Matrix3<f64>) -> Tangent {
    let mut tangent = Tangent::zeros();
    for i in 0..3 {
        for k in 0..3 {
            let block = inverse * form.fixed_view::<3, 3>(3 * i, 3 * k) * inverse.transpose();
            tangent.fixed_view_mut::<3, 3>(3 * i, 3 * k).copy_from(&block);
        }
    }
    tangent
}

/// Computes, for every mode, the sensitivities of all nodes for which those of the interior forces vanish.
pub(super) fn solve_modes<B: RealBackend>(model: &RveModel<B>, workspace: &mut Workspace<B>) -> Solved<B> {
    /// Tolerance of the interior force sensitivities, relative to those at all nodes: they enter the tangent squared.
    const TOLERANCE: f64 = 1e-8;
    /// Interior force sensitivities that are accepted if the matrix is singular to working precision.
    const SINGULAR_TOLERANCE: f64 = 1e-4;

    set_affine_sensitivities(workspace);
    force_sensitivities(model, workspace);
    if model.unknowns() == 0 {
        return Ok(());
    }
    let mut factor = if workspace.factor_is_exact { Factor::Exact } else { factor_or_shift(model, workspace)? };
    let mut before = f64::INFINITY;
    loop {
        let imbalance = relative_imbalance(model, workspace);
        if imbalance <= TOLERANCE {
            return Ok(());
        }
        if imbalance <= factor.max_reduction_ratio() * before {
            before = imbalance;
        } else {
            factor = match factor {
                _ if imbalance < SINGULAR_TOLERANCE => return Ok(()),
                Factor::Exact => factor_shifted(model, workspace)?,
                Factor::Shifted => return Err(SolveError::Inaccurate { residual: imbalance }),
            };
            // The inaccurate factor may have added large motions in the null space, exact or approximate.
            set_affine_sensitivities(workspace);
            force_sensitivities(model, workspace);
            before = f64::INFINITY;
        }
        correct_modes(model, workspace)?;
        force_sensitivities(model, workspace);
    }
}

/// Sets `v = S x` for all nodes and modes.
fn set_affine_sensitivities<B: Backend>(workspace: &mut Workspace<B>) {
    let strains: [Matrix3<f64>; MODES] = std::array::from_fn(strain);
    for (sensitivities, x) in workspace.sensitivities.iter_mut().zip(&workspace.positions) {
        for (v, s) in sensitivities.chunks_exact_mut(3).zip(&strains) {
            v.copy_from_slice(&transform(s, x));
        }
    }
}

/// The factor that corrects the modes.
#[derive(Clone, Copy, Debug)]
enum Factor {
    /// Factor of the stiffness itself.
    Exact,
    /// Factor of the stiffness with a shifted diagonal.
    Shifted,
}

impl Factor {
    /// Largest accepted ratio of the interior force sensitivities after and before a correction; a larger ratio means
    /// that the factor is too inaccurate.
    fn max_reduction_ratio(self) -> f64 {
        match self {
            Self::Exact => 0.05,
            Self::Shifted => 0.5,
        }
    }
}

/// Factors the stiffness at the state in the workspace, with a small shift of the diagonal if it is singular.
fn factor_or_shift<B: RealBackend>(model: &RveModel<B>, workspace: &mut Workspace<B>) -> Solved<B, Factor> {
    match factor_here(model, workspace, 0.0) {
        Err(SolveError::Singular { .. }) => factor_shifted(model, workspace),
        outcome => outcome.map(|()| Factor::Exact),
    }
}

/// Factors the stiffness at the state in the workspace with a small shift of the diagonal.
///
/// A floppy network at rest has motions that no fiber resists, and no force acts on them: `K v = q` has solutions. With
/// `K + s I` in place of `K` every correction removes the fraction `lambda / (lambda + s)` of the error, and leaves the
/// motions with `lambda = 0` unchanged.
fn factor_shifted<B: RealBackend>(model: &RveModel<B>, workspace: &mut Workspace<B>) -> Solved<B, Factor> {
    /// Relative shift: far above rounding, far below the stiffness of a fiber.
    const SHIFT: f64 = 1e-9;
    let stiffest = workspace.diagonal.iter().map(|block| block[0].max(block[4]).max(block[8])).fold(0.0, f64::max);
    factor_here(model, workspace, SHIFT * stiffest).map(|()| Factor::Shifted)
}

/// Factors the stiffness at the state in the workspace, with `shift` added to its diagonal.
fn factor_here<B: RealBackend>(model: &RveModel<B>, workspace: &mut Workspace<B>, shift: f64) -> Solved<B> {
    let Workspace { system, states, diagonal, factor_is_exact, .. } = workspace;
    system.matrix.assemble(|k| model.slots.assemble(&model.truss, states, diagonal, k))?;
    if shift > 0.0 {
        system.shift_diagonal(shift)?;
    }
    system.solver.factor(&system.matrix)?;
    *factor_is_exact = shift == 0.0;
    Ok(())
}

/// Computes `q = K v` at all nodes, fiber by fiber.
fn force_sensitivities<B: RealBackend>(model: &RveModel<B>, workspace: &mut Workspace<B>) {
    let Workspace { states, sensitivities, force_sensitivities, .. } = workspace;
    force_sensitivities.fill([0.0; 3 * MODES]);
    for (fiber, &[a, b]) in model.truss.ends().iter().enumerate() {
        let (va, vb) = (&sensitivities[a as usize], &sensitivities[b as usize]);
        let block = states.block(fiber);
        let mut force = [0.0; 3 * MODES];
        for mode in 0..MODES {
            let at = 3 * mode;
            let v = [vb[at] - va[at], vb[at + 1] - va[at + 1], vb[at + 2] - va[at + 2]];
            for i in 0..3 {
                force[at + i] = block[3 * i] * v[0] + block[3 * i + 1] * v[1] + block[3 * i + 2] * v[2];
            }
        }
        force_sensitivities[b as usize].iter_mut().zip(&force).for_each(|(q, f)| *q += f);
        force_sensitivities[a as usize].iter_mut().zip(&force).for_each(|(q, f)| *q -= f);
    }
}

/// The norm of the force sensitivities at interior nodes over that at all nodes.
fn relative_imbalance<B: RealBackend>(model: &RveModel<B>, workspace: &Workspace<B>) -> f64 {
    let square = |node: &[f64; 3 * MODES]| node.iter().map(|q| q * q).sum::<f64>();
    let all: f64 = workspace.force_sensitivities.iter().map(square).sum();
    let interior: f64 =
        model.network().interior().iter().map(|&node| square(&workspace.force_sensitivities[node as usize])).sum();
    if all > 0.0 { (interior / all).sqrt() } else { 0.0 }
}

/// Applies `v_i -= K_ii^-1 q_i`, all modes in one solve.
fn correct_modes<B: RealBackend>(model: &RveModel<B>, workspace: &mut Workspace<B>) -> Solved<B> {
    let interior = model.network().interior();
    let Workspace { system, mode_loads, mode_solutions, sensitivities, force_sensitivities, .. } = workspace;
    for (mode, load) in mode_loads.iter_mut().enumerate() {
        let at = 3 * mode;
        load.with_local_mut(|load| {
            for (q, &node) in load.chunks_exact_mut(3).zip(interior) {
                q.copy_from_slice(&force_sensitivities[node as usize][at..at + 3]);
            }
        })?;
        load.finish()?;
    }
    system.solver.solve_many(mode_loads, mode_solutions)?;
    for (mode, solution) in mode_solutions.iter().enumerate() {
        let at = 3 * mode;
        solution.with_local(|solution| {
            for (u, &node) in solution.chunks_exact(3).zip(interior) {
                let v = &mut sensitivities[node as usize][at..at + 3];
                v.iter_mut().zip(u).for_each(|(v, u)| *v -= u);
            }
        })?;
    }
    Ok(())
}

/// Column `l`: the products, over all nodes, of `K v_l` with the sensitivities `v_k` of the six strains and with `W x`
/// of the three spins, computed in one pass.
fn sensitivity_products<B: Backend>(workspace: &Workspace<B>) -> [[f64; MODES]; 9] {
    let spins: [Matrix3<f64>; 3] = std::array::from_fn(spin);
    let mut products = [[0.0; MODES]; 9];
    for ((v, q), x) in workspace.sensitivities.iter().zip(&workspace.force_sensitivities).zip(&workspace.positions) {
        let mut sensitivities = [0.0; 3 * 9];
        sensitivities[..3 * MODES].copy_from_slice(v);
        for (sensitivity, spin) in sensitivities[3 * MODES..].chunks_exact_mut(3).zip(&spins) {
            sensitivity.copy_from_slice(&transform(spin, x));
        }
        for (row, v) in products.iter_mut().zip(sensitivities.chunks_exact(3)) {
            for (product, q) in row.iter_mut().zip(q.chunks_exact(3)) {
                *product += v[0] * q[0] + v[1] * q[1] + v[2] * q[2];
            }
        }
    }
    products
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::las::conformance::Random;

    /// With all nine unit increments, `A : (S_l F)` has the given products, symmetric or not, and `A : (W F)` those of
    /// `W P`.
    #[test]
    fn the_tangent_has_the_given_products_with_all_increments() {
        let mut random = Random::new(6);
        let f = Matrix3::identity() + Matrix3::from_fn(|_, _| 0.3 * random.signed());
        let pk1 = Matrix3::from_fn(|_, _| random.signed());
        let products: [[f64; MODES]; 9] = std::array::from_fn(|_| std::array::from_fn(|_| random.signed()));
        let scale = 2.5;
        let tangent = tangent_from_form(&products, scale, &f, &pk1).unwrap();
        let unit = |k: usize| if k < MODES { strain(k) } else { spin(k - MODES) };
        let increment = |k: usize| unit(k) * f;
        for (k, of_increment) in products.iter().enumerate() {
            for l in 0..9 {
                let entry = |of: &Matrix3<f64>, at: usize| of[(at / 3, at % 3)];
                let sum =
                    |at: usize| (0..9).map(|other| tangent[(at, other)] * entry(&increment(l), other)).sum::<f64>();
                let found: f64 = (0..9).map(|at| entry(&increment(k), at) * sum(at)).sum();
                let of_spin = || increment(k).dot(&(spin(l - MODES) * pk1));
                let expected = of_increment.get(l).map_or_else(of_spin, |product| scale * product);
                assert!((found - expected).abs() < 1e-13, "{k}, {l}: {found} instead of {expected}");
            }
        }
    }
}
