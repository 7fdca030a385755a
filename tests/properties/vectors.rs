//! The verbs of vectors.

use biotissue::las::{Backend, Value, VectorOps};

use super::draw::{VectorCase, VectorVerb};
use super::{
    Outcome, check, done, epsilon, equal, exactly, factor, factor_in_lane, in_lane, lanes, scalars, untouched,
};

/// Two vectors, and what they must be: lane by lane, entry by entry.
struct Pair<B: Backend> {
    found: [B::Vector; 2],
    expected: [Vec<Vec<f64>>; 2],
    /// Whether `set` was the last verb that wrote to them; `None` behind a `finish`.
    pending: [Option<bool>; 2],
}

pub fn agree<B>(context: &B::Context, case: &VectorCase) -> Outcome
where
    B: Backend<Index = i32>,
    B::Reduced: Value,
{
    let zeros = || vec![vec![0.0; case.len]; lanes::<B>()];
    let mut pair = Pair::<B> {
        found: [done(B::vector(context, case.len))?, done(B::vector(context, case.len))?],
        expected: [zeros(), zeros()],
        pending: [None; 2],
    };
    for (which, verb) in &case.steps {
        pair.step(*which, verb)?;
    }
    let everything: Vec<i32> = (0..case.len as i32).collect();
    for which in 0..2 {
        pair.read(which, &everything)?;
    }
    pair.reductions()
}

impl<B: Backend<Index = i32>> Pair<B> {
    fn step(&mut self, which: usize, verb: &VectorVerb) -> Outcome {
        let len = self.found[0].len();
        match verb {
            VectorVerb::Zero => {
                done(self.found[which].zero())?;
                self.expected[which].iter_mut().for_each(|lane| lane.fill(0.0));
            }
            VectorVerb::Add(rows, values) => {
                self.turn_to(which, false)?;
                done(self.found[which].add(rows, &scalars::<B>(&values[..rows.len()])))?;
                self.write(which, rows, values, |entry, value| *entry += value);
            }
            VectorVerb::Set(rows, values) => {
                self.turn_to(which, true)?;
                done(self.found[which].set(rows, &scalars::<B>(&values[..rows.len()])))?;
                self.write(which, rows, values, |entry, value| *entry = value);
            }
            VectorVerb::Axpy(a) => {
                self.finish(0)?;
                self.finish(1)?;
                let [first, second] = &mut self.found;
                let (y, x) = if which == 0 { (first, &*second) } else { (second, &*first) };
                done(y.axpy(factor::<B>(*a), x))?;
                let [first, second] = &mut self.expected;
                let (y, x) = if which == 0 { (first, &*second) } else { (second, &*first) };
                for (lane, (y, x)) in y.iter_mut().zip(x).enumerate() {
                    y.iter_mut().zip(x).for_each(|(y, x)| *y += factor_in_lane(*a, lane) * x);
                }
            }
            VectorVerb::Lend(values) => {
                self.finish(which)?;
                let values = &values[..len];
                done(self.found[which].with_local_mut(|entries| entries.copy_from_slice(&scalars::<B>(values))))?;
                for (lane, entries) in self.expected[which].iter_mut().enumerate() {
                    entries.iter_mut().zip(values).for_each(|(entry, &value)| *entry = in_lane(value, lane));
                }
            }
            VectorVerb::Get(rows) => self.read(which, rows)?,
            VectorVerb::Finish => self.finish(which)?,
        }
        Ok(())
    }

    fn write(&mut self, which: usize, rows: &[i32], values: &[i8], write: impl Fn(&mut f64, f64)) {
        for (lane, entries) in self.expected[which].iter_mut().enumerate() {
            for (&row, &value) in rows.iter().zip(values).filter(|(row, _)| **row >= 0) {
                write(&mut entries[row as usize], in_lane(value, lane));
            }
        }
    }

    /// `finish` stands between adding and setting.
    fn turn_to(&mut self, which: usize, set: bool) -> Outcome {
        if self.pending[which].is_some_and(|pending| pending != set) {
            self.finish(which)?;
        }
        self.pending[which] = Some(set);
        Ok(())
    }

    fn finish(&mut self, which: usize) -> Outcome {
        self.pending[which] = None;
        done(self.found[which].finish())
    }

    fn read(&mut self, which: usize, rows: &[i32]) -> Outcome {
        self.finish(which)?;
        let (found, expected) = (&self.found[which], &self.expected[which]);
        let mut values = untouched::<B>(rows.len());
        done(found.get(rows, &mut values))?;
        for (&row, value) in rows.iter().zip(&values) {
            let expected = |lane: usize| match usize::try_from(row) {
                Ok(row) => expected[lane][row],
                Err(_) => in_lane(super::UNTOUCHED, lane),
            };
            check(format_args!("row {row} of vector {which}"), value, expected, exactly)?;
        }
        let entries = done(found.with_local(<[_]>::to_vec))?;
        let len = expected[0].len();
        equal("the length", (entries.len(), found.len(), found.is_empty()), (len, len, len == 0))?;
        for (row, value) in entries.iter().enumerate() {
            check(format_args!("entry {row} of vector {which}"), value, |lane| expected[lane][row], exactly)?;
        }
        Ok(())
    }

    /// Of what was read just now.
    fn reductions(&self) -> Outcome
    where
        B::Reduced: Value,
    {
        let [x, y] = &self.expected;
        let slack = (x[0].len() + 4) as f64 * epsilon::<B>();
        let dot = |x: &[f64], y: &[f64]| x.iter().zip(y).map(|(x, y)| x * y).sum::<f64>();
        let sizes = |lane: usize| x[lane].iter().zip(&y[lane]).map(|(x, y)| (x * y).abs()).sum::<f64>();
        let found = done(self.found[0].dot(&self.found[1]))?;
        check("the product", &found, |lane| dot(&x[lane], &y[lane]), |lane| slack * sizes(lane))?;
        let norm = |lane: usize| dot(&x[lane], &x[lane]).sqrt();
        check("the norm", &done(self.found[0].norm())?, norm, |lane| slack * norm(lane))
    }
}
