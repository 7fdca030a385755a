//! Tests of the operations of vectors.

use super::cases::{VectorCase, VectorStep};
use super::{
    Outcome, epsilon, equal, indices, lanes, number_in_lane, same, scalar, scalars, sign_in_lane, tried, untouched,
    within,
};
use crate::las::{Backend, Index, VectorOps};

/// Two vectors, and their expected entries in every lane.
struct Pair<B: Backend> {
    found: [B::Vector; 2],
    expected: [Vec<Vec<f64>>; 2],
    /// Whether the last write was a `set`; `None` if there was no write since `finish`.
    pending: [Option<bool>; 2],
}

/// Performs the operations of the case on two vectors and compares every entry that it reads with the reference.
pub(super) fn check<B: Backend>(context: &B::Context, case: &VectorCase) -> Outcome {
    let zeros = || vec![vec![0.0; case.len]; lanes::<B>()];
    let mut pair = Pair::<B> {
        found: [tried(B::vector(context, case.len))?, tried(B::vector(context, case.len))?],
        expected: [zeros(), zeros()],
        pending: [None; 2],
    };
    let all: Vec<i32> = (0..case.len as i32).collect();
    pair.read(0, &all)?;
    for (which, step) in &case.steps {
        pair.step(*which, step)?;
    }
    pair.read(0, &all)?;
    pair.read(1, &all)?;
    pair.reductions()?;
    pair.products(context)?;
    out_of_range_is_dropped::<B>(context)
}

impl<B: Backend> Pair<B> {
    fn step(&mut self, which: usize, step: &VectorStep) -> Outcome {
        match step {
            VectorStep::Zero => {
                tried(self.found[which].zero())?;
                self.expected[which].iter_mut().for_each(|lane| lane.fill(0.0));
            }
            VectorStep::Add(rows, values) => {
                self.separate(which, false)?;
                tried(self.found[which].add(&indices::<B>(rows), &scalars::<B>(values)))?;
                self.write(which, rows, values, |entry, value| *entry += value);
            }
            VectorStep::Set(rows, values) => {
                self.separate(which, true)?;
                tried(self.found[which].set(&indices::<B>(rows), &scalars::<B>(values)))?;
                self.write(which, rows, values, |entry, value| *entry = value);
            }
            VectorStep::Axpy(a) => self.combine(which, *a, 1.0, |y, x, a, _| y.axpy(a, x))?,
            VectorStep::Axpby(a, b) => self.combine(which, *a, *b, |y, x, a, b| y.axpby(a, x, b))?,
            VectorStep::WriteLocal(values) => {
                self.finish(which)?;
                tried(self.found[which].with_local_mut(|entries| entries.copy_from_slice(&scalars::<B>(values))))?;
                let all: Vec<i32> = (0..values.len() as i32).collect();
                self.write(which, &all, values, |entry, value| *entry = value);
            }
            VectorStep::Get(rows) => self.read(which, rows)?,
            VectorStep::Finish => self.finish(which)?,
        }
        Ok(())
    }

    /// Replaces a vector `y` by `a x + b y` with the other vector `x`, which `combine` does.
    fn combine(
        &mut self,
        which: usize,
        a: f64,
        b: f64,
        combine: impl FnOnce(&mut B::Vector, &B::Vector, B::Scalar, B::Scalar) -> Result<(), B::Error>,
    ) -> Outcome {
        self.finish(0)?;
        self.finish(1)?;
        let [first, second] = &mut self.found;
        let (y, x) = if which == 0 { (first, &*second) } else { (second, &*first) };
        tried(combine(y, x, scalar::<B>(|lane| a * sign_in_lane(lane)), scalar::<B>(|_| b)))?;
        let [first, second] = &mut self.expected;
        let (y, x) = if which == 0 { (first, &*second) } else { (second, &*first) };
        for (lane, (y, x)) in y.iter_mut().zip(x).enumerate() {
            y.iter_mut().zip(x).for_each(|(y, x)| *y = a * sign_in_lane(lane) * x + b * *y);
        }
        Ok(())
    }

    /// Applies `write(entry, value)` to the expected entries in `rows`.
    fn write(&mut self, which: usize, rows: &[i32], values: &[f64], write: impl Fn(&mut f64, f64)) {
        for (lane, entries) in self.expected[which].iter_mut().enumerate() {
            for (&row, &value) in rows.iter().zip(values).filter(|(row, _)| **row >= 0) {
                write(&mut entries[row as usize], number_in_lane(value, lane));
            }
        }
    }

    /// Calls `finish` if the next write is a `set` and the last one was not, or the reverse.
    fn separate(&mut self, which: usize, set: bool) -> Outcome {
        if self.pending[which].is_some_and(|pending| pending != set) {
            self.finish(which)?;
        }
        self.pending[which] = Some(set);
        Ok(())
    }

    fn finish(&mut self, which: usize) -> Outcome {
        self.pending[which] = None;
        tried(self.found[which].finish())
    }

    /// Reads entries of a vector, and then all of them with `with_local`, and compares them with the expected ones.
    fn read(&mut self, which: usize, rows: &[i32]) -> Outcome {
        self.finish(which)?;
        let (found, expected) = (&self.found[which], &self.expected[which]);
        let mut values = untouched::<B>(rows.len());
        tried(found.get(&indices::<B>(rows), &mut values))?;
        for (&row, value) in rows.iter().zip(&values) {
            let expected = |lane: usize| match usize::try_from(row) {
                Ok(row) => expected[lane][row],
                Err(_) => number_in_lane(super::UNTOUCHED, lane),
            };
            same(format_args!("row {row} of vector {which}"), value, expected)?;
        }
        let entries = tried(found.with_local(<[_]>::to_vec))?;
        let len = expected[0].len();
        equal("the length", (entries.len(), found.len(), found.is_empty()), (len, len, len == 0))?;
        for (row, value) in entries.iter().enumerate() {
            same(format_args!("entry {row} of vector {which}"), value, |lane| expected[lane][row])?;
        }
        Ok(())
    }

    /// Compares the dot product and the norm with the reference, to within rounding.
    fn reductions(&self) -> Outcome {
        let [x, y] = &self.expected;
        let tolerance = (x[0].len() + 4) as f64 * epsilon::<B>();
        let dot = |x: &[f64], y: &[f64]| x.iter().zip(y).map(|(x, y)| x * y).sum::<f64>();
        let sizes = |lane: usize| x[lane].iter().zip(&y[lane]).map(|(x, y)| (x * y).abs()).sum::<f64>();
        let found = tried(self.found[0].dot(&self.found[1]))?;
        within("the dot product", &found, |lane| dot(&x[lane], &y[lane]), |lane| tolerance * sizes(lane))?;
        let norm = |lane: usize| dot(&x[lane], &x[lane]).sqrt();
        within("the norm", &tried(self.found[0].norm())?, norm, |lane| tolerance * norm(lane))
    }
}

impl<B: Backend> Pair<B> {
    /// Checks the products of entries, and that a combination with the factor zero overwrites what is not finite.
    fn products(&self, context: &B::Context) -> Outcome {
        let ([x, y], [of_x, of_y]) = (&self.expected, &self.found);
        let mut product = tried(B::vector(context, x[0].len()))?;
        tried(product.with_local_mut(|z| z.fill(scalar::<B>(|_| f64::NAN))))?;
        tried(product.finish())?;
        tried(product.multiply(of_x, of_y))?;
        let check = |found: &[B::Scalar], expected: &dyn Fn(usize, usize) -> f64| {
            found.iter().enumerate().try_for_each(|(row, found)| {
                let error = |lane: usize| 2.0 * epsilon::<B>() * expected(lane, row).abs();
                within(format_args!("row {row} of a product"), found, |lane| expected(lane, row), error)
            })
        };
        tried(product.with_local(|z| check(z, &|lane, row| x[lane][row] * y[lane][row])))??;
        tried(product.with_local_mut(|z| z.fill(scalar::<B>(|_| f64::NAN))))?;
        tried(product.finish())?;
        tried(product.axpby(scalar::<B>(|_| 2.0), of_x, scalar::<B>(|_| 0.0)))?;
        tried(product.with_local(|z| check(z, &|lane, row| 2.0 * x[lane][row])))?
    }
}

/// Checks that writes out of range are dropped. Debug assertions forbid such writes, so that builds with them skip the
/// check.
fn out_of_range_is_dropped<B: Backend>(context: &B::Context) -> Outcome {
    if cfg!(debug_assertions) {
        return Ok(());
    }
    let mut y = tried(B::vector(context, 3))?;
    tried(y.add(&[B::Index::of(3)], &scalars::<B>(&[1.0])))?;
    tried(y.finish())?;
    let entries = tried(y.with_local(<[_]>::to_vec))?;
    entries.iter().try_for_each(|value| same("an entry after a write out of range", value, |_| 0.0))
}
