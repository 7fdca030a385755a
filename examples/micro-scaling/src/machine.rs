//! The modelled parts of an iteration: messages, and the computations of the macro scale.

use clap::ValueEnum;

/// The network between the ranks, and the speed of their cores.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Machine {
    /// Seconds of a message of no bytes.
    pub latency: f64,
    /// Bytes per second that a rank sends, or receives.
    pub bandwidth: f64,
    /// Factor of the times of planning and of messages in memory, which are measured on this computer.
    pub core: f64,
}

impl Machine {
    /// Returns the seconds of messages of so many bytes in total that one rank sends or receives one after the other.
    pub fn messages(&self, count: usize, bytes: u64) -> f64 {
        count as f64 * self.latency + bytes as f64 / self.bandwidth
    }

    /// Returns the seconds of a collective along a tree in which some rank sends or receives so many bytes in total.
    pub fn tree(&self, ranks: usize, bytes: u64) -> f64 {
        self.messages(depth(ranks), bytes)
    }

    /// Returns the seconds of `sum` or `max` of so many bytes: up the tree and down again, a message on each level.
    pub fn reduce(&self, ranks: usize, bytes: u64) -> f64 {
        2.0 * depth(ranks) as f64 * self.messages(1, bytes)
    }

    /// Returns the seconds of `gather_all`, of so many bytes of all ranks together: the lengths are exchanged first.
    pub fn gather_all(&self, ranks: usize, bytes: u64) -> f64 {
        self.tree(ranks, 8 * ranks as u64) + self.tree(ranks, bytes)
    }
}

fn depth(ranks: usize) -> usize {
    ranks.next_power_of_two().trailing_zeros() as usize
}

/// How the macro scale solves its linear system.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum MacroSolver {
    /// A direct solver: the work grows with the square of the elements.
    Direct,
    /// Multigrid: the work is proportional to the elements.
    Multigrid,
}

/// The time of the macro scale per iteration. It is that of one core, divided by the ranks of the macro scale, but by no
/// more ranks than have `elements_per_rank` elements each.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MacroModel {
    /// How it solves.
    pub solver: MacroSolver,
    /// Seconds of one core per iteration, for a body of `elements`.
    pub seconds: f64,
    /// Number of elements for which `seconds` is given.
    pub elements: f64,
    /// Number of elements per rank below which more ranks do not help.
    pub elements_per_rank: f64,
}

impl MacroModel {
    /// Returns the defaults of a solver. Direct: the factorization and solution of a body of 63 504 elements took 0.33 s
    /// on two cores (`docs/scaling-study.md`); the text's solver was fastest on 16 ranks for 64 000 elements. Multigrid:
    /// 0.92 s on one core for 196 677 unknowns (`docs/multigrid.md`), thus 320 000 tetrahedra.
    pub fn of(solver: MacroSolver) -> Self {
        let (seconds, elements, elements_per_rank) = match solver {
            MacroSolver::Direct => (0.66, 63_504.0, 4000.0),
            MacroSolver::Multigrid => (0.92, 320_000.0, 1000.0),
        };
        Self { solver, seconds, elements, elements_per_rank }
    }

    /// Returns the seconds of an iteration of a body of so many elements.
    pub fn seconds(&self, elements: usize, ranks: usize) -> f64 {
        let size = elements as f64 / self.elements;
        let work = match self.solver {
            MacroSolver::Direct => size * size,
            MacroSolver::Multigrid => size,
        };
        let most = (elements as f64 / self.elements_per_rank).max(1.0);
        self.seconds * work / most.min(ranks as f64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn collectives_have_the_depth_of_a_tree() {
        let machine = Machine { latency: 1.0, bandwidth: 128.0, core: 1.0 };
        assert_eq!(machine.messages(3, 64), 3.5);
        assert_eq!([1, 2, 3, 8, 9].map(|ranks| machine.tree(ranks, 0)), [0.0, 1.0, 2.0, 3.0, 4.0]);
        assert_eq!(machine.reduce(9, 64), 8.0 * 1.5);
        assert_eq!(machine.gather_all(8, 100), 6.0 + 64.0 / 128.0 + 100.0 / 128.0);
    }

    #[test]
    fn ranks_of_the_macro_scale_help_up_to_their_least_share() {
        let direct = MacroModel {
            seconds: 3.0,
            elements: 100.0,
            elements_per_rank: 50.0,
            ..MacroModel::of(MacroSolver::Direct)
        };
        assert_eq!([1, 2, 4, 64].map(|ranks| direct.seconds(200, ranks)), [12.0, 6.0, 3.0, 3.0]);
        let multigrid = MacroModel { solver: MacroSolver::Multigrid, ..direct };
        assert_eq!([1, 4, 8].map(|ranks| multigrid.seconds(200, ranks)), [6.0, 1.5, 1.5]);
        assert_eq!(direct.seconds(25, 8), 3.0 / 16.0);
    }
}
