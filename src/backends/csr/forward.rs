//! The macro that implements the traits of a backend with compressed rows by the functions that all such backends
//! share.

/// Implements the vector and matrix operations of assembly, products, sums, diagonals and the traversal of all entries;
/// `norm`, `dot`, `axpy` and, if given, `axpby` and `multiply` are functions of slices.
macro_rules! impl_backend_ops {
    ([$($generics:tt)*] $backend:ty, $value:ty, $reduced:ty, norm: $norm:path, dot: $dot:path, axpy: $axpy:path
        $(, axpby: $axpby:path, multiply: $multiply:path)?
    ) => {
        $crate::backends::local::impl_vector_ops!(
            [$($generics)*] $backend, $crate::backends::csr::Vector<$value>, $value, $reduced,
            norm: $norm, dot: $dot, axpy: $axpy $(, axpby: $axpby, multiply: $multiply)?
        );

        const _: () = {
            use std::convert::Infallible;
            use std::sync::Arc;

            use $crate::backends::csr::{Matrix, Vector};
            use $crate::las::{BlockSlots, Entries, MatMat, MatVec, MatrixOps, NodePositions, SolveError, Sparsity};

            type Failure = SolveError<Infallible>;

            impl<$($generics)*> MatrixOps<$backend> for Matrix<$value> {
                #[inline(always)]
                fn shape(&self) -> (usize, usize) {
                    (self.pattern.rows(), self.pattern.cols())
                }

                #[inline(always)]
                fn zero(&mut self) -> Result<(), Infallible> {
                    self.zero_all();
                    Ok(())
                }

                fn assemble<E: From<Infallible>>(
                    &mut self,
                    add: impl FnOnce(&mut Self) -> Result<(), E>,
                ) -> Result<(), E> {
                    self.zero_before_assembly();
                    add(self)?;
                    Ok(self.finish()?)
                }

                #[inline(always)]
                fn zero_rows(&mut self, rows: &[i32]) -> Result<(), Infallible> {
                    self.zero_whole_rows(rows);
                    Ok(())
                }

                #[inline(always)]
                fn add(&mut self, rows: &[i32], cols: &[i32], block: &[$value]) -> Result<(), Infallible> {
                    self.scatter(rows, cols, block, |entry, value| *entry += value);
                    Ok(())
                }

                #[inline(always)]
                fn set(&mut self, rows: &[i32], cols: &[i32], block: &[$value]) -> Result<(), Infallible> {
                    self.scatter(rows, cols, block, |entry, value| *entry = value);
                    Ok(())
                }

                #[inline(always)]
                fn get(&self, rows: &[i32], cols: &[i32], block: &mut [$value]) -> Result<(), Infallible> {
                    self.get_block(rows, cols, block);
                    Ok(())
                }

                #[inline(always)]
                fn locate(&self, rows: &[i32], cols: &[i32], slots: &mut Vec<u32>) -> Result<(), Infallible> {
                    self.positions(rows, cols, slots);
                    Ok(())
                }

                #[inline(always)]
                fn add_at(&mut self, slots: &[u32], block: &[$value]) -> Result<(), Infallible> {
                    self.add_at_positions(slots, block);
                    Ok(())
                }

                fn locate_blocks(&self, size: usize, indices: &[i32]) -> Result<BlockSlots<$backend>, Infallible> {
                    if let Some(positions) = NodePositions::new(&self.pattern, size, indices) {
                        return Ok(BlockSlots::of_nodes(positions));
                    }
                    let mut slots = Vec::with_capacity(size * indices.len());
                    for rows in indices.chunks_exact(size.max(1)) {
                        self.positions(rows, rows, &mut slots);
                    }
                    Ok(BlockSlots::new(size, slots))
                }

                fn add_blocks(
                    &mut self,
                    slots: &BlockSlots<$backend>,
                    compute: impl Fn(usize, &mut [$value]) -> bool + Sync,
                ) -> Result<(), Infallible> {
                    self.add_all_blocks(slots.size(), slots.positions(), compute);
                    Ok(())
                }

                #[inline(always)]
                fn finish(&mut self) -> Result<(), Infallible> {
                    Ok(())
                }
            }

            impl<$($generics)*> MatVec<$backend> for Matrix<$value> {
                fn mul(&self, x: &Vector<$value>, y: &mut Vector<$value>) -> Result<(), Failure> {
                    self.times(&x.values, &mut y.values)
                }

                fn mul_transpose(&self, x: &Vector<$value>, y: &mut Vector<$value>) -> Result<(), Failure> {
                    self.transposed_times(&x.values, &mut y.values)
                }

                fn diagonal(&self, d: &mut Vector<$value>) -> Result<(), Failure> {
                    self.diagonal_into(&mut d.values)
                }
            }

            impl<$($generics)*> MatMat<$backend> for Matrix<$value> {
                fn scale(&mut self, factor: $value) -> Result<(), Infallible> {
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

            impl<$($generics)*> Entries<$backend> for Matrix<$value> {
                fn pattern(&self) -> Result<Arc<Sparsity>, Infallible> {
                    Ok(Arc::clone(&self.pattern))
                }

                fn for_each(&self, mut visit: impl FnMut(usize, usize, $value)) -> Result<(), Infallible> {
                    for row in 0..self.pattern.rows() {
                        for (column, value) in self.row(row) {
                            visit(row, column, value);
                        }
                    }
                    Ok(())
                }
            }
        };
    };
}

pub(in crate::backends) use impl_backend_ops;
