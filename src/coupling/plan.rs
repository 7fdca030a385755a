//! Distribution of the ranks over the scales.

use thiserror::Error;

/// The ranks that a scale gets.
#[derive(Clone, Debug, PartialEq)]
pub enum Share {
    /// These ranks, in this order.
    Ranks(Vec<usize>),
    /// A number of ranks, the next free ones.
    Count(usize),
    /// A share of the ranks left by [`Share::Ranks`] and [`Share::Count`], in proportion to this ratio among all
    /// ratios.
    Ratio(f64),
}

/// The scales with their shares of the ranks, in order.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Plan {
    /// Name and share of each scale.
    pub scales: Vec<(String, Share)>,
}

/// The reason why a plan cannot be applied to the ranks of the program.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum PlanError {
    /// The total number of planned ranks differs from the number of started ranks.
    #[error("{sum} = {planned} ranks, but {started} were started")]
    Sum {
        /// The sum as text: `macro 16 + micro 240`.
        sum: String,
        /// Its value.
        planned: usize,
        /// Number of ranks started.
        started: usize,
    },
    /// Two scales have the same name.
    #[error("there are two scales {0}")]
    Name(String),
    /// A rank appears twice, or does not exist.
    #[error("scale {scale}: rank {rank} {what}")]
    Rank {
        /// The scale.
        scale: String,
        /// The rank.
        rank: usize,
        /// Description of the error.
        what: &'static str,
    },
    /// One of two scales that share all ranks would get none.
    #[error("{first_ranks} of {started} ranks are for one of two scales; each needs at least one")]
    EmptyHalf {
        /// Ranks of the first scale.
        first_ranks: usize,
        /// Number of ranks started.
        started: usize,
    },
    /// A scale gets no rank.
    #[error("scale {0} gets no rank")]
    Empty(String),
    /// A ratio is not a positive finite number.
    #[error("the ratio of scale {0} is {1}; it must be positive and finite")]
    Ratio(String, f64),
    /// The plan contains no scale.
    #[error("there is no scale")]
    NoScales,
    /// The ranks were given different plans.
    #[error("this rank was given the plan {local}, and rank 0 the plan {root}; all must have the same")]
    Mismatch {
        /// The plan of this rank.
        local: String,
        /// The plan of rank 0.
        root: String,
    },
}

impl Plan {
    /// Appends a scale.
    #[must_use]
    pub fn with(mut self, name: &str, share: Share) -> Self {
        self.scales.push((name.to_owned(), share));
        self
    }

    /// Returns the smallest number of ranks that may suffice: the explicit ranks, the counts, and one for each ratio.
    /// Unequal ratios may need more.
    pub fn min_ranks(&self) -> usize {
        let of = |share: &Share| match share {
            Share::Ranks(ranks) => ranks.len(),
            Share::Count(count) => *count,
            Share::Ratio(_) => 1,
        };
        self.scales.iter().map(|(_, share)| of(share)).sum()
    }

    /// Returns the ranks of every scale, for `started` ranks; each rank belongs to exactly one scale.
    ///
    /// # Errors
    /// Returns [`PlanError`] if the plan does not fit.
    pub fn assign(&self, started: usize) -> Result<Vec<Vec<usize>>, PlanError> {
        self.check_names()?;
        let mut free = vec![true; started];
        let mut assigned = vec![Vec::new(); self.scales.len()];
        for ((name, share), ranks) in self.scales.iter().zip(&mut assigned) {
            let Share::Ranks(explicit) = share else { continue };
            for &rank in explicit {
                let wrong = |what| PlanError::Rank { scale: name.clone(), rank, what };
                let is_free = free.get_mut(rank).ok_or_else(|| wrong("was not started"))?;
                if !std::mem::replace(is_free, false) {
                    return Err(wrong("is given twice"));
                }
            }
            ranks.clone_from(explicit);
        }
        let left: Vec<usize> = (0..started).filter(|&rank| free[rank]).collect();
        let counts = self.counts(left.len())?;
        let planned = counts.iter().sum::<usize>();
        if planned != left.len() {
            return Err(self.sum(&counts, started));
        }
        let mut left = left.into_iter();
        for (ranks, count) in assigned.iter_mut().zip(counts) {
            ranks.extend(left.by_ref().take(count));
        }
        let empty = assigned.iter().position(Vec::is_empty);
        empty.map_or(Ok(assigned), |scale| Err(PlanError::Empty(self.scales[scale].0.clone())))
    }

    fn check_names(&self) -> Result<(), PlanError> {
        if self.scales.is_empty() {
            return Err(PlanError::NoScales);
        }
        for (k, (name, share)) in self.scales.iter().enumerate() {
            if self.scales[..k].iter().any(|(other, _)| other == name) {
                return Err(PlanError::Name(name.clone()));
            }
            if let &Share::Ratio(ratio) = share
                && !(ratio > 0.0 && ratio.is_finite())
            {
                return Err(PlanError::Ratio(name.clone(), ratio));
            }
        }
        Ok(())
    }

    /// Distributes the ranks that are not assigned explicitly; ratios are rounded by the largest-remainder method.
    fn counts(&self, left: usize) -> Result<Vec<usize>, PlanError> {
        let counted = |share: &Share| if let Share::Count(count) = share { *count } else { 0 };
        let mut counts: Vec<usize> = self.scales.iter().map(|(_, share)| counted(share)).collect();
        let ratio = |share: &Share| if let Share::Ratio(ratio) = share { *ratio } else { 0.0 };
        let ratios: Vec<f64> = self.scales.iter().map(|(_, share)| ratio(share)).collect();
        let (all, rest) = (ratios.iter().sum::<f64>(), left.saturating_sub(counts.iter().sum()));
        if all > 0.0 {
            let exact = |k: usize| ratios[k] / all * rest as f64;
            (0..counts.len()).for_each(|k| counts[k] += exact(k).floor() as usize);
            let mut order: Vec<usize> = (0..counts.len()).filter(|&k| ratios[k] > 0.0).collect();
            order.sort_by(|&a, &b| exact(b).fract().total_cmp(&exact(a).fract()));
            let missing = rest - (0..counts.len()).map(|k| exact(k).floor() as usize).sum::<usize>();
            order.iter().take(missing).for_each(|&k| counts[k] += 1);
        }
        Ok(counts)
    }

    fn sum(&self, counts: &[usize], started: usize) -> PlanError {
        let count = |(k, (_, share)): (usize, &(String, Share))| match share {
            Share::Ranks(ranks) => ranks.len(),
            _ => counts[k],
        };
        let all: Vec<usize> = self.scales.iter().enumerate().map(count).collect();
        let terms: Vec<String> =
            self.scales.iter().zip(&all).map(|((name, _), count)| format!("{name} {count}")).collect();
        PlanError::Sum { sum: terms.join(" + "), planned: all.iter().sum(), started }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_are_consecutive_ranks() {
        let plan = Plan::default().with("macro", Share::Count(1)).with("micro", Share::Count(3));
        assert_eq!(plan.assign(4), Ok(vec![vec![0], vec![1, 2, 3]]));
    }

    #[test]
    fn a_plan_that_does_not_add_up_shows_the_sum() {
        let plan = Plan::default().with("macro", Share::Count(16)).with("micro", Share::Count(240));
        let error = plan.assign(4).map_err(|error| error.to_string());
        assert_eq!(error, Err("macro 16 + micro 240 = 256 ranks, but 4 were started".to_owned()));
    }

    #[test]
    fn ratios_share_the_remaining_ranks() {
        let plan = Plan::default()
            .with("macro", Share::Ranks(vec![3]))
            .with("meso", Share::Ratio(1.0))
            .with("micro", Share::Ratio(3.0));
        assert_eq!(plan.assign(8), Ok(vec![vec![3], vec![0, 1], vec![2, 4, 5, 6, 7]]));
    }

    #[test]
    fn each_rank_belongs_to_one_scale() {
        let twice = Plan::default().with("a", Share::Ranks(vec![0, 1])).with("b", Share::Ranks(vec![1]));
        assert_eq!(twice.assign(2), Err(PlanError::Rank { scale: "b".into(), rank: 1, what: "is given twice" }));
        let absent = Plan::default().with("a", Share::Ranks(vec![2]));
        assert_eq!(absent.assign(2), Err(PlanError::Rank { scale: "a".into(), rank: 2, what: "was not started" }));
        let none = Plan::default().with("a", Share::Ratio(1.0)).with("b", Share::Ratio(1000.0));
        assert_eq!(none.assign(2), Err(PlanError::Empty("a".into())));
    }
}
