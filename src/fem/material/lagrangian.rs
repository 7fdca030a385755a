//! Materials given by an energy in the Green-Lagrange strain: tensors of their moduli, and the step from the second to
//! the first Piola-Kirchhoff stress.
//!
//! Fourth-order tensors have row `3 * I + J` and column `3 * K + L`.

use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

use super::small_strain::{Dilatation, green_lagrange};
use super::{MaterialError, Response, checked_determinant};
use crate::tensor::row_major;

/// A fourth-order tensor.
pub(super) type Moduli = SMatrix<f64, 9, 9>;

/// The strain measures of a deformation, accurate for arbitrarily small strains.
pub(super) struct Strain {
    /// Green-Lagrange strain `E`.
    pub e: Matrix3<f64>,
    /// `C^-1` with `C = I + 2 E`.
    pub c_inverse: Matrix3<f64>,
    /// The volume change.
    pub dilatation: Dilatation,
    /// `tr E - ln J`, which is of second order.
    pub trace_beyond_ln: f64,
}

impl Strain {
    /// Computes the strain measures of a deformation gradient.
    pub fn of(f: &Matrix3<f64>) -> Result<Self, MaterialError> {
        let determinant = checked_determinant(f)?;
        let inverse = f.try_inverse().ok_or(MaterialError::Inverted(determinant))?;
        let h = f - Matrix3::identity();
        let dilatation = Dilatation::of(&h, determinant);
        let trace_beyond_ln = dilatation.trace_beyond_ln(&h);
        Ok(Self { e: green_lagrange(&h), c_inverse: inverse * inverse.transpose(), dilatation, trace_beyond_ln })
    }
}

/// An energy of the Green-Lagrange strain with its derivatives.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lagrangian {
    /// Energy per reference volume, J/m^3.
    pub energy: f64,
    /// Second Piola-Kirchhoff stress `S = dW/dE`, Pa.
    pub pk2: Matrix3<f64>,
    /// `dS/dE`, Pa, with both minor symmetries and the major one.
    pub moduli: Moduli,
}

impl Lagrangian {
    /// The volumetric energy `U = K/4 (J^2 - 1 - 2 ln J)`, in a form without cancellation at small strains. With
    /// `dJ/dE = J C^-1`, `S = K/2 (J^2 - 1) C^-1`.
    pub fn volumetric(bulk_modulus: f64, strain: &Strain) -> Self {
        let Dilatation { change, beyond_ln, .. } = strain.dilatation;
        let square_less_one = change * (change + 2.0);
        let (k, inverse) = (bulk_modulus, &strain.c_inverse);
        Self {
            energy: 0.25 * k * (change * change + 2.0 * beyond_ln),
            pk2: inverse * (0.5 * k * square_less_one),
            moduli: outer(inverse, inverse) * (k * (square_less_one + 1.0))
                - symmetric_square(inverse) * (k * square_less_one),
        }
    }

    /// Returns the sum of two energies.
    pub fn plus(self, other: &Self) -> Self {
        Self { energy: self.energy + other.energy, pk2: self.pk2 + other.pk2, moduli: self.moduli + other.moduli }
    }

    /// Computes `P_iJ = F_iM S_MJ` and `A_iJkL = d_ik S_JL + F_iM (dS/dE)_MJLP F_kP`.
    pub fn response(&self, f: &Matrix3<f64>) -> Response {
        let half = from_blocks(|i, j, n| (0..3).map(|m| f[(i, m)] * self.moduli[(3 * m + j, n)]).sum());
        // The minor symmetry exchanges the order `LP` of the columns.
        let tangent = from_blocks(|k, l, row| (0..3).map(|p| f[(k, p)] * half[(row, 3 * p + l)]).sum()).transpose();
        let geometric = Moduli::from_fn(|row, col| if row / 3 == col / 3 { self.pk2[(row % 3, col % 3)] } else { 0.0 });
        Response { energy: self.energy, pk1: f * self.pk2, tangent: tangent + geometric }
    }
}

/// Returns the matrix with entry `of(i, j, n)` at row `3 * i + j` and column `n`.
fn from_blocks(of: impl Fn(usize, usize, usize) -> f64) -> Moduli {
    Moduli::from_fn(|row, col| of(row / 3, row % 3, col))
}

/// `a_IJ b_KL`.
pub(super) fn outer(a: &Matrix3<f64>, b: &Matrix3<f64>) -> Moduli {
    SVector::from(row_major(a)) * SVector::from(row_major(b)).transpose()
}

/// `a_IJ b_KL + b_IJ a_KL`.
pub(super) fn symmetric_outer(a: &Matrix3<f64>, b: &Matrix3<f64>) -> Moduli {
    let product = outer(a, b);
    product + product.transpose()
}

/// `(b_IK b_JL + b_IL b_JK) / 2` for a symmetric `b`. For `b = C^-1` it is `-1/2 dC^-1/dE`; for the identity, it is the
/// identity on symmetric tensors.
pub(super) fn symmetric_square(b: &Matrix3<f64>) -> Moduli {
    Moduli::from_fn(|row, col| {
        let (i, j, k, l) = (row / 3, row % 3, col / 3, col % 3);
        0.5 * (b[(i, k)] * b[(j, l)] + b[(i, l)] * b[(j, k)])
    })
}

/// The invariants of the strain along a unit vector `a`.
pub(super) struct Axial {
    /// `a (x) a`.
    pub structure: Matrix3<f64>,
    /// `a . E a`.
    pub strain: f64,
    /// `|E a|^2`.
    pub square: f64,
    /// `d|E a|^2 / dE = a (x) E a + E a (x) a`.
    pub square_slope: Matrix3<f64>,
}

impl Axial {
    /// Computes the invariants of `e` along the unit vector `axis`.
    pub fn of(axis: &Vector3<f64>, e: &Matrix3<f64>) -> Self {
        let stretched = e * axis;
        let product = axis * stretched.transpose();
        Self {
            structure: axis * axis.transpose(),
            strain: axis.dot(&stretched),
            square: stretched.norm_squared(),
            square_slope: product + product.transpose(),
        }
    }

    /// `d^2|E a|^2 / dE^2`: `(d_IK a_J a_L + d_IL a_J a_K + d_JK a_I a_L + d_JL a_I a_K) / 2`.
    pub fn square_moduli(&self) -> Moduli {
        Moduli::from_fn(|row, col| {
            let (i, j, k, l) = (row / 3, row % 3, col / 3, col % 3);
            let term = |a: usize, b: usize, c: usize, d: usize| if a == b { self.structure[(c, d)] } else { 0.0 };
            0.5 * (term(i, k, j, l) + term(i, l, j, k) + term(j, k, i, l) + term(j, l, i, k))
        })
    }
}
