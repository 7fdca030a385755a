//! Equilibria of many fiber networks at once, one in each lane of the vector registers.
//!
//! The numbers of as many networks as a register has lanes (eight with AVX-512, four otherwise) alternate in memory.
//! Each operation acts on all of them: forces and stiffness, the factorization in 3x3 blocks, the solutions with the
//! factor. Every lane has its own iterations and its own line search; it waits where it is until all have finished, or
//! until most have finished and the others [pause](Paused), to go on in another group. The result of a network is the
//! same bit for bit in any lane, beside any others, and with any number of lanes, as long as the machine has fused
//! multiply-adds; in mixed precision, which only eight lanes have, in any lane and beside any others.
//!
//! The memory of a group belongs to the thread that solves it, and serves all networks that this thread solves.

#![allow(clippy::needless_range_loop, reason = "short loops over the numbers of blocks, which the compiler unrolls")]

mod arrays;
mod blocks;
mod check;
#[cfg(feature = "batched")]
mod cholesky;
mod course;
mod end;
mod energy_series;
mod factor;
mod forces;
mod laws;
mod network;
mod newton;
mod pause;
mod phases;
// On x86-64 it only serves the tests: its kernels take as long to compile as those of AVX2.
#[cfg(any(test, not(target_arch = "x86_64")))]
mod portable;
mod response;
mod simd;
mod single;
mod start;
mod tangent;
#[cfg(test)]
mod test_network;
mod triangular;
#[cfg(target_arch = "x86_64")]
mod x86;

#[cfg(target_arch = "x86_64")]
use pulp::x86::{V3, V4};

use arrays::with_arrays;
#[cfg(feature = "batched")]
pub(in crate::backends) use cholesky::{LaneAnalysis, LaneCholesky, LanePivots};
use course::Course;
pub use end::LaneEnd;
use end::{condense, read_ends, write_course};
use network::Network;
use newton::Newton;
pub use pause::Paused;
use phases::Clock;
pub use phases::{Phase, PhaseTimes};
#[cfg(any(test, not(target_arch = "x86_64")))]
use portable::Portable;
use simd::{Double, Simd};
pub use start::LaneStart;

use super::{BatchParams, NetworkData, Plan, RESULT_LEN, STEPS_OF_CONTINUATION, Status, TileShape};

/// The operations of a factorization up to which lanes were measured to be faster than single networks: the factors of
/// all lanes of larger networks take tens of megabytes. `docs/kernel.md` has the measurements.
pub const MOST_OPERATIONS: f64 = 1.5e8;

/// The instructions that the lanes use.
#[derive(Clone, Copy, Debug)]
pub enum Level {
    /// Those of any machine: four lanes. On x86-64 only the tests have it.
    #[cfg(any(test, not(target_arch = "x86_64")))]
    Portable,
    /// AVX2 with fused multiply-adds: four lanes.
    #[cfg(target_arch = "x86_64")]
    Avx2(V3),
    /// AVX-512: eight lanes.
    #[cfg(target_arch = "x86_64")]
    Avx512(V4),
}

impl Level {
    /// Returns all levels that this machine has, the fastest last; none on x86-64 without AVX2.
    pub fn all() -> Vec<Self> {
        let mut all = Vec::new();
        #[cfg(any(test, not(target_arch = "x86_64")))]
        all.push(Self::Portable);
        #[cfg(target_arch = "x86_64")]
        {
            all.extend(V3::try_new().map(Self::Avx2));
            all.extend(V4::try_new().map(Self::Avx512));
        }
        all
    }

    /// The number of lanes.
    pub fn lanes(self) -> usize {
        match self {
            #[cfg(any(test, not(target_arch = "x86_64")))]
            Self::Portable => Portable::LANES,
            #[cfg(target_arch = "x86_64")]
            Self::Avx2(_) => V3::LANES,
            #[cfg(target_arch = "x86_64")]
            Self::Avx512(_) => V4::LANES,
        }
    }

    /// Returns true if the lanes are in registers of vectors, not in what a compiler makes of arrays.
    pub fn has_vectors(self) -> bool {
        match self {
            #[cfg(any(test, not(target_arch = "x86_64")))]
            Self::Portable => false,
            #[cfg(target_arch = "x86_64")]
            Self::Avx2(_) | Self::Avx512(_) => true,
        }
    }
}

/// The shape of the tiles of a factorization with these instructions.
fn tile_of(level: Level) -> TileShape {
    match level {
        #[cfg(any(test, not(target_arch = "x86_64")))]
        Level::Portable => Portable::TILE,
        #[cfg(target_arch = "x86_64")]
        Level::Avx2(_) => V3::TILE,
        #[cfg(target_arch = "x86_64")]
        Level::Avx512(_) => V4::TILE,
    }
}

/// The networks that are solved at the same time, one in each lane. The functions run while the memory of the thread is
/// in use, and must not solve another group.
pub trait LaneGroup {
    /// Their number, at most [`NetworkLanes::lanes`].
    fn networks(&self) -> usize;

    /// Returns where a network starts.
    fn start(&self, lane: usize) -> LaneStart<'_>;

    /// Takes the outcome of a network. Not called for one that pauses.
    fn end(&mut self, lane: usize, end: LaneEnd<'_>);
}

/// A network whose equilibria are found in lanes.
#[derive(Debug)]
pub struct NetworkLanes {
    level: Level,
    network: Network,
    /// Whether factors of single precision serve for all but the last factorization.
    has_single: bool,
}

impl NetworkLanes {
    /// Orders a network for the lanes of this machine; `None` if it has none.
    ///
    /// # Panics
    /// Panics if the lists of the network have different lengths, or if a fiber has a node or a law that does not
    /// exist.
    pub fn new(network: &NetworkData) -> Option<Self> {
        Some(Self::with_level(network, Level::all().pop()?))
    }

    /// Orders a network for these instructions.
    ///
    /// # Panics
    /// As for [`NetworkLanes::new`].
    pub fn with_level(network: &NetworkData, level: Level) -> Self {
        Self { level, network: Network::new(network, tile_of(level)), has_single: false }
    }

    /// Uses factors of single precision for the directions of Newton's method, with residuals of double precision; the
    /// factor that shows that an equilibrium is stable, and serves its tangent, keeps double precision. Directions are
    /// then less accurate and cost less, so that any positive [`BatchParams::chord_steps`] means any number of them.
    /// Changes nothing if these instructions are no faster with single precision.
    pub fn use_single_precision(&mut self) {
        self.has_single = match self.level {
            #[cfg(any(test, not(target_arch = "x86_64")))]
            Level::Portable => Portable::HAS_SINGLE,
            #[cfg(target_arch = "x86_64")]
            Level::Avx2(_) => V3::HAS_SINGLE,
            #[cfg(target_arch = "x86_64")]
            Level::Avx512(_) => V4::HAS_SINGLE,
        };
    }

    /// Returns true if factors of single precision serve for the directions of Newton's method.
    pub fn has_single_precision(&self) -> bool {
        self.has_single
    }

    /// The number of networks that are solved at once.
    pub fn lanes(&self) -> usize {
        self.level.lanes()
    }

    /// Returns whether lanes are faster than one such network after the other, if there are enough: this machine has fast
    /// vectors, and a factorization takes at most [`MOST_OPERATIONS`]. Takes little memory also for a large network.
    ///
    /// # Panics
    /// As for [`NetworkLanes::new`].
    pub fn are_faster(network: &NetworkData) -> bool {
        Level::all().pop().is_some_and(Level::has_vectors) && Plan::operations(network) <= MOST_OPERATIONS
    }

    /// Floating-point operations of one factorization.
    pub fn operations(&self) -> f64 {
        self.network.schedule.operations()
    }

    /// Bytes of memory for each lane of a group.
    pub fn bytes_per_lane(&self) -> usize {
        arrays::bytes_per_lane(&self.network, self.has_single)
    }

    /// Finds the equilibria of a group of networks, and passes their outcomes to [`LaneGroup::end`], in ascending order.
    /// Adds to `times`, if given, what each phase takes.
    ///
    /// With `may_pause`, once most are in equilibrium, the others pause. They do not end, but are returned with their
    /// lanes, to be solved in another call ([`LaneStart::paused`]), with the same results.
    ///
    /// # Panics
    /// Panics if there are more networks than lanes, if one has another number of interior nodes, or if
    /// [`BatchParams::memory`] is not 1 to 8.
    pub fn solve(
        &self,
        group: &mut impl LaneGroup,
        params: &BatchParams,
        may_pause: bool,
        times: Option<&mut PhaseTimes>,
    ) -> Vec<(usize, Paused)> {
        let clock = Clock::new(times);
        match self.level {
            #[cfg(any(test, not(target_arch = "x86_64")))]
            Level::Portable => self.solve_with::<_, 1>(Portable, group, params, may_pause, clock),
            #[cfg(target_arch = "x86_64")]
            Level::Avx2(simd) => self.solve_with::<_, 1>(simd, group, params, may_pause, clock),
            #[cfg(target_arch = "x86_64")]
            Level::Avx512(simd) => self.solve_with::<_, 2>(simd, group, params, may_pause, clock),
        }
    }

    /// Tests for up to [`NetworkLanes::lanes`] networks whether Newton's method leads from their states, moved affinely
    /// to the targets, to the equilibria with these interior positions: [`Status::Continues`] if it evidently does.
    ///
    /// # Panics
    /// As for [`NetworkLanes::solve`], and if there are not positions for each network.
    pub fn continues(&self, starts: &[LaneStart<'_>], reached: &[&[[f64; 3]]], params: &BatchParams) -> Vec<Status> {
        assert_eq!(starts.len(), reached.len(), "one equilibrium for each start");
        self.check(starts, params);
        let order = &self.network.order;
        let reached: Vec<Vec<[f64; 3]>> =
            reached.iter().map(|reached| order.iter().map(|&node| reached[node as usize]).collect()).collect();
        let params = BatchParams { max_iterations: STEPS_OF_CONTINUATION, ..*params };
        match self.level {
            #[cfg(any(test, not(target_arch = "x86_64")))]
            Level::Portable => self.continues_with::<_, 1>(Portable, starts, &reached, &params),
            #[cfg(target_arch = "x86_64")]
            Level::Avx2(simd) => self.continues_with::<_, 1>(simd, starts, &reached, &params),
            #[cfg(target_arch = "x86_64")]
            Level::Avx512(simd) => self.continues_with::<_, 2>(simd, starts, &reached, &params),
        }
    }

    fn check(&self, starts: &[LaneStart<'_>], params: &BatchParams) {
        assert!(starts.len() <= self.lanes(), "at most one network for each lane");
        assert!((1..=8).contains(&params.memory), "1 to 8 iterates in the sufficient-decrease condition");
        let interior = self.network.interior;
        assert!(starts.iter().all(|start| start.positions.len() == interior), "a position for each interior node");
        let mut paused = starts.iter().filter_map(|start| start.paused);
        assert!(paused.all(|paused| paused.interior() == interior), "what paused is of this network");
    }

    fn continues_with<S: Double, const C: usize>(
        &self,
        simd: S,
        starts: &[LaneStart<'_>],
        reached: &[Vec<[f64; 3]>],
        params: &BatchParams,
    ) -> Vec<Status> {
        let network = &self.network;
        with_arrays(network, self.has_single, |arrays| {
            start::write_starts(simd, network, starts, arrays);
            let clock = &mut Clock::new(None);
            let newton =
                Newton { simd, network, arrays, params, has_single: false, chord_steps: 0, may_pause: false, clock };
            let courses = newton.approach::<C>(reached);
            courses.iter().map(|course| course.status.unwrap_or(Status::Inconclusive)).collect()
        })
    }

    fn solve_with<S: Double, const C: usize>(
        &self,
        simd: S,
        group: &mut impl LaneGroup,
        params: &BatchParams,
        may_pause: bool,
        mut clock: Clock<'_>,
    ) -> Vec<(usize, Paused)> {
        let Self { network, has_single, .. } = self;
        let has_single = *has_single;
        let chord_steps = if has_single && params.chord_steps > 0 { u32::MAX } else { params.chord_steps };
        with_arrays(network, has_single, |arrays| {
            let courses_so_far: Vec<Option<Course>> = {
                let starts: Vec<LaneStart<'_>> = (0..group.networks()).map(|lane| group.start(lane)).collect();
                self.check(&starts, params);
                start::write_starts(simd, network, &starts, arrays);
                starts.iter().map(|start| start.paused.map(|paused| paused.course)).collect()
            };
            clock.end(Phase::Start);
            let newton =
                Newton { simd, network, arrays, params, has_single, chord_steps, may_pause, clock: &mut clock };
            let courses = newton.run::<C>(&courses_so_far);
            let paused = courses.iter().enumerate().filter(|(_, course)| course.runs());
            let paused = paused.map(|(lane, course)| (lane, Paused::read(*course, network, arrays, lane))).collect();
            let mut results: Vec<[f64; RESULT_LEN]> = courses.iter().map(write_course).collect();
            if courses.iter().any(|course| course.status == Some(Status::Converged)) {
                condense::<S, C>(simd, network, arrays, params.wants_tangent, &mut results);
            }
            clock.end(Phase::Tangent);
            let ended = results.iter().enumerate().filter(|(lane, _)| !courses[*lane].runs());
            read_ends(simd, network, arrays, params.wants_tangent, ended, |lane, end| group.end(lane, end));
            clock.end(Phase::End);
            paused
        })
    }
}
