//! The interface between the body and its material: stress and tangent at every integration point.
//!
//! Points are numbered by [`PointNumbering`]. The body passes all deformation gradients in one call and receives all
//! responses from it, so that an implementation can evaluate the points in parallel or on other ranks.

use nalgebra::{Matrix3, SMatrix};
use thiserror::Error;

use super::material::{Material, MaterialError, Response};
use super::mesh::{IntegrationPoint, Mesh, PointNumbering};
use crate::parallel;

/// The number of points that one thread evaluates at a time.
pub(crate) const POINTS_PER_CHUNK: usize = 256;

/// The responses of all points, in the order of [`PointNumbering`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PointResponses {
    /// Energy per reference volume of each point, J/m^3.
    pub energy: Vec<f64>,
    /// First Piola-Kirchhoff stress `P` of each point, Pa.
    pub pk1: Vec<Matrix3<f64>>,
    /// `A = dP/dF` of each point, Pa: row `3 * i + J`, column `3 * k + L`.
    pub tangent: Vec<SMatrix<f64, 9, 9>>,
}

impl PointResponses {
    /// Creates zero responses of `points` points.
    pub fn zeros(points: usize) -> Self {
        Self {
            energy: parallel::filled(0.0, points),
            pk1: parallel::filled(Matrix3::zeros(), points),
            tangent: parallel::filled(SMatrix::zeros(), points),
        }
    }

    /// Resizes to `points` points; new entries are zero.
    pub fn resize(&mut self, points: usize) {
        self.energy.resize(points, 0.0);
        self.pk1.resize(points, Matrix3::zeros());
        self.tangent.resize(points, SMatrix::zeros());
    }

    /// Returns the number of points.
    pub fn len(&self) -> usize {
        self.pk1.len()
    }

    /// Returns true if there are no points.
    pub fn is_empty(&self) -> bool {
        self.pk1.is_empty()
    }

    /// Returns energies, stresses and tangents in chunks of `size` points.
    pub(crate) fn chunks_mut(&mut self, size: usize) -> impl Iterator<Item = ResponseChunk<'_>> {
        let arrays = self.energy.chunks_mut(size).zip(self.pk1.chunks_mut(size)).zip(self.tangent.chunks_mut(size));
        arrays.map(|((energy, pk1), tangent)| ResponseChunk { energy, pk1, tangent })
    }
}

/// The responses of consecutive points; see [`PointResponses`].
pub(crate) struct ResponseChunk<'a> {
    energy: &'a mut [f64],
    pk1: &'a mut [Matrix3<f64>],
    tangent: &'a mut [SMatrix<f64, 9, 9>],
}

impl ResponseChunk<'_> {
    /// Stores the response of a point, given by its position in the chunk.
    pub fn set(&mut self, point: usize, response: &Response) {
        self.energy[point] = response.energy;
        self.pk1[point] = response.pk1;
        self.tangent[point] = response.tangent;
    }
}

/// The material of all points: evaluates stresses and tangents at given deformation gradients.
///
/// A field may have memory: the micro states from which the next update starts. In an attempt at a load step, the
/// driver calls
///
/// 1. [`PointField::update`] at as many trial states as Newton and its line search need;
/// 2. [`PointField::verify`] after Newton has converged, and step 1 again if it returns true;
/// 3. [`PointField::evolve`], and step 1 again at the same pseudo-time if it returns true;
/// 4. [`PointField::commit`].
///
/// If the attempt fails before step 4, the driver calls [`PointField::revert`].
pub trait PointField {
    /// The reason why a trial state has no stress; it should name the point. Newton's line search treats the error as
    /// a too long step and shortens it.
    type Error: std::error::Error;

    /// Evaluates energies, stresses and tangents at these deformation gradients, one per point.
    ///
    /// # Errors
    /// Returns an error if any point cannot be evaluated.
    fn update(&mut self, gradients: &[Matrix3<f64>], out: &mut PointResponses) -> Result<(), Self::Error>;

    /// Checks the responses at the gradients of the last [`PointField::update`], at which Newton has converged: each
    /// must continue the last committed state, independently of the trial states in between. Replaces those that do not
    /// and returns true if it replaced any; `out` then holds the new responses.
    ///
    /// # Errors
    /// Returns an error if a continuation does not exist; a shorter step may help.
    fn verify(&mut self, gradients: &[Matrix3<f64>], out: &mut PointResponses) -> Result<bool, Self::Error> {
        let _ = (gradients, out);
        Ok(false)
    }

    /// Changes the material of points as the converged state of the last [`PointField::update`] demands (damage, for
    /// example). Returns true if the response of a point changed; the body is then out of balance. The number of
    /// possible changes is finite, so repeated calls eventually return false.
    ///
    /// # Errors
    /// Returns an error if other ranks cannot be reached.
    fn evolve(&mut self) -> Result<bool, Self::Error> {
        Ok(false)
    }

    /// Commits the micro states at the gradients of the last [`PointField::update`], at which an increment converged. The
    /// next one starts from them. `ends_step` is true at the end of a load step, and false at the end of an increment
    /// within one.
    ///
    /// # Errors
    /// Returns an error if other ranks cannot be reached; the run then ends.
    fn commit(&mut self, ends_step: bool) -> Result<(), Self::Error>;

    /// Returns to the micro states and materials of the last [`PointField::commit`] after a failed step.
    ///
    /// # Errors
    /// As for [`PointField::commit`].
    fn revert(&mut self) -> Result<(), Self::Error>;

    /// Returns true if all points together are evaluated in much less time than a large stiffness is factored, as
    /// formulas are, so that an additional iteration pays if it saves a factorization.
    fn is_cheap(&self) -> bool {
        false
    }

    /// Returns true if an error does not depend on the trial state (another rank is gone), so that no shorter step
    /// helps.
    fn is_final(_: &Self::Error) -> bool {
        false
    }
}

/// A point whose material cannot be evaluated.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
#[error("{point}: {reason}")]
pub struct PointError {
    /// The point.
    pub point: IntegrationPoint,
    /// The error of the material.
    pub reason: MaterialError,
}

/// The regions of the elements and the materials of a [`FormulaField`] do not match.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
#[error("element {element} lies in region {region}, but there are materials for {materials} regions")]
pub struct RegionError {
    /// Element index, from 0.
    pub element: usize,
    /// The region of the element, from 0.
    pub region: u32,
    /// The number of materials given.
    pub materials: usize,
}

/// A point field without memory that evaluates a formula at every point, selected by the region of the element, on all
/// threads of the current rayon pool. An error is that of the first point, in order, that has one.
///
/// # Panics
/// [`PointField::update`] panics if the number of gradients differs from the number of points.
pub struct FormulaField {
    materials: Vec<Box<dyn Material>>,
    /// The region of each point.
    region_of: Vec<u32>,
    points: PointNumbering,
}

impl FormulaField {
    /// Creates a field in which region `r` of the mesh has `materials[r]`.
    ///
    /// # Errors
    /// Returns [`RegionError`] if the region of an element has no material.
    pub fn new(materials: Vec<Box<dyn Material>>, mesh: &Mesh) -> Result<Self, RegionError> {
        let region_of = mesh.region_of();
        let beyond = region_of.iter().enumerate().find(|&(_, &region)| region as usize >= materials.len());
        if let Some((element, &region)) = beyond {
            return Err(RegionError { element, region, materials: materials.len() });
        }
        Ok(Self { materials, region_of: mesh.points().spread(region_of), points: mesh.points().clone() })
    }

    /// Creates a field with one material.
    pub fn uniform(material: impl Material + 'static, mesh: &Mesh) -> Self {
        let points = mesh.points().clone();
        Self { materials: vec![Box::new(material)], region_of: vec![0; points.len()], points }
    }
}

impl PointField for FormulaField {
    type Error = PointError;

    fn update(&mut self, gradients: &[Matrix3<f64>], out: &mut PointResponses) -> Result<(), PointError> {
        assert_eq!(gradients.len(), self.region_of.len(), "one deformation gradient per point");
        out.resize(gradients.len());
        let inputs = gradients.chunks(POINTS_PER_CHUNK).zip(self.region_of.chunks(POINTS_PER_CHUNK));
        let chunks = inputs.zip(out.chunks_mut(POINTS_PER_CHUNK)).enumerate();
        let Self { materials, points, .. } = &*self;
        parallel::try_each(chunks, |(number, ((gradients, regions), mut out))| {
            for (k, (f, &region)) in gradients.iter().zip(regions).enumerate() {
                let locate = || points.locate(number * POINTS_PER_CHUNK + k);
                let response = materials[region as usize].evaluate(f);
                out.set(k, &response.map_err(|reason| PointError { point: locate(), reason })?);
            }
            Ok(())
        })
    }

    fn is_cheap(&self) -> bool {
        true
    }

    fn commit(&mut self, _: bool) -> Result<(), PointError> {
        Ok(())
    }

    fn revert(&mut self) -> Result<(), PointError> {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fem::material::{LinearElastic, NeoHookean};
    use crate::fem::mesh::shapes;
    use crate::las::conformance::Random;
    use crate::parallel::tests::on_pools;

    /// Three tetrahedra in a row, with these regions.
    fn three_tetrahedra(region_of: &[u32]) -> Mesh {
        let nodes = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0; 3], [2.0, 0.0, 1.0]];
        let elements = vec![[0, 1, 2, 3], [1, 2, 3, 4], [1, 4, 3, 5]];
        let regions = (0..=region_of.iter().copied().max().unwrap_or(0)).map(|region| region.to_string());
        Mesh::new(nodes, elements, region_of.to_vec(), regions.collect(), vec![]).unwrap()
    }

    #[test]
    fn every_element_has_the_material_of_its_region() {
        let (soft, stiff) = (NeoHookean { mu: 1.0, lambda: 2.0 }, LinearElastic { mu: 10.0, lambda: 20.0 });
        let mut field =
            FormulaField::new(vec![Box::new(soft), Box::new(stiff)], &three_tetrahedra(&[1, 0, 1])).unwrap();
        let f = Matrix3::new(1.1, 0.1, 0.0, 0.0, 0.9, 0.0, 0.2, 0.0, 1.0);
        let mut out = PointResponses::default();
        field.update(&[f; 3], &mut out).unwrap();
        let expected = [stiff.evaluate(&f), soft.evaluate(&f), stiff.evaluate(&f)].map(Result::unwrap);
        assert_eq!(out.len(), 3);
        for (e, response) in expected.iter().enumerate() {
            assert_eq!((out.energy[e], out.pk1[e], out.tangent[e]), (response.energy, response.pk1, response.tangent));
        }
    }

    #[test]
    fn errors_name_the_element() {
        let mut field = FormulaField::uniform(NeoHookean { mu: 1.0, lambda: 2.0 }, &three_tetrahedra(&[0, 0, 0]));
        let mirrored = Matrix3::from_diagonal(&[-1.0, 1.0, 1.0].into());
        let error =
            field.update(&[Matrix3::identity(), mirrored, mirrored], &mut PointResponses::zeros(3)).unwrap_err();
        assert_eq!(error, PointError { point: IntegrationPoint::of_element(1), reason: MaterialError::Inverted(-1.0) });
        let missing = FormulaField::new(vec![], &three_tetrahedra(&[0, 0, 0])).err().unwrap();
        assert_eq!(missing, RegionError { element: 0, region: 0, materials: 0 });
    }

    #[test]
    fn responses_and_errors_do_not_depend_on_the_number_of_threads() {
        let mesh = shapes::cuboid([7; 3], [1.0; 3]).unwrap();
        let points = mesh.points().len();
        assert!(points > 4 * POINTS_PER_CHUNK);
        let mut field = FormulaField::uniform(NeoHookean { mu: 1.0, lambda: 2.0 }, &mesh);
        let mut random = Random::new(3);
        let mut gradients: Vec<Matrix3<f64>> =
            (0..points).map(|_| Matrix3::identity() + Matrix3::from_fn(|_, _| 0.1 * random.signed())).collect();
        let mut update = |gradients: &[Matrix3<f64>]| {
            on_pools(|| {
                let mut out = PointResponses::default();
                field.update(gradients, &mut out).map(|()| out)
            })
        };
        let [one, two, five] = update(&gradients);
        assert!(one.is_ok() && one == two && one == five);
        for point in [points - 1, 1500, 700, 260] {
            gradients[point] = Matrix3::from_diagonal(&[-1.0, 1.0, 1.0].into());
            let expected = PointError { point: mesh.points().locate(point), reason: MaterialError::Inverted(-1.0) };
            assert!(update(&gradients).iter().all(|result| *result == Err(expected)), "point {point}");
        }
    }
}
