//! Macros that implement the traits of a backend with compressed rows by the functions that all such backends share.

/// Implements the vector and matrix operations of assembly; `norm` and `dot` are functions of slices.
macro_rules! impl_assembly_ops {
    ([$($generics:tt)*] $backend:ty, $value:ty, $reduced:ty, norm: $norm:path, dot: $dot:path) => {
        impl<$($generics)*> $crate::las::VectorOps<$backend> for $crate::backends::csr::Vector<$value> {
            #[inline(always)]
            fn len(&self) -> usize {
                self.values.len()
            }

            #[inline(always)]
            fn zero(&mut self) -> Result<(), ::std::convert::Infallible> {
                $crate::backends::local::zero(&mut self.values);
                Ok(())
            }

            #[inline(always)]
            fn add(&mut self, rows: &[i32], values: &[$value]) -> Result<(), ::std::convert::Infallible> {
                $crate::backends::local::add(&mut self.values, rows, values);
                Ok(())
            }

            #[inline(always)]
            fn set(&mut self, rows: &[i32], values: &[$value]) -> Result<(), ::std::convert::Infallible> {
                $crate::backends::local::set(&mut self.values, rows, values);
                Ok(())
            }

            #[inline(always)]
            fn get(&self, rows: &[i32], values: &mut [$value]) -> Result<(), ::std::convert::Infallible> {
                $crate::backends::local::get(&self.values, rows, values);
                Ok(())
            }

            #[inline(always)]
            fn norm(&self) -> Result<$reduced, ::std::convert::Infallible> {
                Ok($norm(&self.values))
            }

            #[inline(always)]
            fn dot(&self, y: &Self) -> Result<$reduced, ::std::convert::Infallible> {
                Ok($dot(&self.values, &y.values))
            }

            #[inline(always)]
            fn axpy(&mut self, a: $value, x: &Self) -> Result<(), ::std::convert::Infallible> {
                $crate::backends::local::axpy(a, &x.values, &mut self.values);
                Ok(())
            }

            #[inline(always)]
            fn with_local<R>(&self, read: impl FnOnce(&[$value]) -> R) -> Result<R, ::std::convert::Infallible> {
                Ok(read(&self.values))
            }

            #[inline(always)]
            fn with_local_mut<R>(
                &mut self,
                write: impl FnOnce(&mut [$value]) -> R,
            ) -> Result<R, ::std::convert::Infallible> {
                Ok(write(&mut self.values))
            }

            #[inline(always)]
            fn finish(&mut self) -> Result<(), ::std::convert::Infallible> {
                Ok(())
            }
        }

        impl<$($generics)*> $crate::las::MatrixOps<$backend> for $crate::backends::csr::Matrix<$value> {
            #[inline(always)]
            fn shape(&self) -> (usize, usize) {
                (self.pattern.rows(), self.pattern.cols())
            }

            #[inline(always)]
            fn zero(&mut self) -> Result<(), ::std::convert::Infallible> {
                $crate::backends::local::zero(&mut self.values);
                Ok(())
            }

            #[inline(always)]
            fn zero_rows(&mut self, rows: &[i32]) -> Result<(), ::std::convert::Infallible> {
                self.zero_whole_rows(rows);
                Ok(())
            }

            #[inline(always)]
            fn add(
                &mut self,
                rows: &[i32],
                cols: &[i32],
                block: &[$value],
            ) -> Result<(), ::std::convert::Infallible> {
                self.scatter(rows, cols, block, |entry, value| *entry += value);
                Ok(())
            }

            #[inline(always)]
            fn set(
                &mut self,
                rows: &[i32],
                cols: &[i32],
                block: &[$value],
            ) -> Result<(), ::std::convert::Infallible> {
                self.scatter(rows, cols, block, |entry, value| *entry = value);
                Ok(())
            }

            #[inline(always)]
            fn get(
                &self,
                rows: &[i32],
                cols: &[i32],
                block: &mut [$value],
            ) -> Result<(), ::std::convert::Infallible> {
                self.get_block(rows, cols, block);
                Ok(())
            }

            #[inline(always)]
            fn locate(
                &self,
                rows: &[i32],
                cols: &[i32],
                slots: &mut Vec<u32>,
            ) -> Result<(), ::std::convert::Infallible> {
                self.positions(rows, cols, slots);
                Ok(())
            }

            #[inline(always)]
            fn add_at(&mut self, slots: &[u32], block: &[$value]) -> Result<(), ::std::convert::Infallible> {
                self.add_at_positions(slots, block);
                Ok(())
            }

            #[inline(always)]
            fn finish(&mut self) -> Result<(), ::std::convert::Infallible> {
                Ok(())
            }
        }
    };
}

/// Implements products, sums, diagonals and the traversal of all entries; `invert` inverts the entries of a slice.
macro_rules! impl_matrix_ops {
    ([$($generics:tt)*] $backend:ty, $value:ty, invert: $invert:path) => {
        type Failure = $crate::las::SolveError<::std::convert::Infallible>;

        impl<$($generics)*> $crate::las::MatVec<$backend> for $crate::backends::csr::Matrix<$value> {
            fn mul(
                &self,
                x: &$crate::backends::csr::Vector<$value>,
                y: &mut $crate::backends::csr::Vector<$value>,
            ) -> Result<(), Failure> {
                self.times(&x.values, &mut y.values)
            }

            fn mul_transpose(
                &self,
                x: &$crate::backends::csr::Vector<$value>,
                y: &mut $crate::backends::csr::Vector<$value>,
            ) -> Result<(), Failure> {
                self.transposed_times(&x.values, &mut y.values)
            }

            fn diagonal(&self, d: &mut $crate::backends::csr::Vector<$value>) -> Result<(), Failure> {
                self.diagonal_into(&mut d.values)
            }

            fn inverse_diagonal(&self, d: &mut $crate::backends::csr::Vector<$value>) -> Result<(), Failure> {
                self.diagonal_into(&mut d.values)?;
                $invert(&mut d.values)
            }
        }

        impl<$($generics)*> $crate::las::MatMat<$backend> for $crate::backends::csr::Matrix<$value> {
            fn scale(&mut self, factor: $value) -> Result<(), ::std::convert::Infallible> {
                self.values.iter_mut().for_each(|value| *value *= factor);
                Ok(())
            }

            fn sum(&self, a: $value, other: &Self, b: $value) -> Result<Self, Failure> {
                self.sum_with(a, other, b)
            }

            fn product(&self, other: &Self) -> Result<Self, Failure> {
                self.product_with(other)
            }

            fn transpose(&self) -> Result<Self, Failure> {
                Ok(self.transposed())
            }
        }

        impl<$($generics)*> $crate::las::Entries<$backend> for $crate::backends::csr::Matrix<$value> {
            fn pattern(&self) -> Result<::std::sync::Arc<$crate::las::Sparsity>, ::std::convert::Infallible> {
                Ok(::std::sync::Arc::clone(&self.pattern))
            }

            fn for_each(
                &self,
                mut visit: impl FnMut(usize, usize, $value),
            ) -> Result<(), ::std::convert::Infallible> {
                for row in 0..self.pattern.rows() {
                    for (column, value) in self.row(row) {
                        visit(row, column, value);
                    }
                }
                Ok(())
            }
        }
    };
}

pub(in crate::backends) use {impl_assembly_ops, impl_matrix_ops};
