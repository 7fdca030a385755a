//! The vector: one contiguous array.

/// A vector in one contiguous array.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Vector<T = f64> {
    pub(in crate::backends) values: Vec<T>,
}

impl<T> Vector<T> {
    /// Returns the entries.
    #[inline(always)]
    #[must_use]
    pub fn as_slice(&self) -> &[T] {
        &self.values
    }

    /// Returns the entries, mutably.
    #[inline(always)]
    #[must_use]
    pub fn as_mut_slice(&mut self) -> &mut [T] {
        &mut self.values
    }
}

impl<T> From<Vec<T>> for Vector<T> {
    fn from(values: Vec<T>) -> Self {
        Self { values }
    }
}

impl<T> From<Vector<T>> for Vec<T> {
    fn from(vector: Vector<T>) -> Self {
        vector.values
    }
}
