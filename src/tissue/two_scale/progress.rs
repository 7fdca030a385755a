//! Progress of the RVEs, from the ranks of the micro scale to the root of the macro scale.
//!
//! Each rank of the micro scale has a thread that sends messages while the rank evaluates its RVEs, one after the
//! evaluation has ended, and a last one at the end of the run, up to which the root receives all messages.

use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use serde::{Deserialize, Serialize};

use super::TwoScaleError;
use super::protocol::{MACRO, MICRO, pack, unpack};
use crate::coupling::Scales;
use crate::las::{Comm, CommError, Tag};
use crate::tissue::micro_scale::{Activity, ProgressSource, RveProgress};

const PROGRESS: Tag = Tag::of(0);

/// A connection of all ranks for messages about the progress of the RVEs, separate from all others.
#[derive(Clone, Debug)]
pub struct ProgressChannel<C> {
    comm: C,
    every: Duration,
}

impl<C: Comm> ProgressChannel<C> {
    /// Connects the ranks of `world`, that of the scales. What the root of the macro scale knows of an evaluation is not
    /// older than `report_every` as a rule. Its calls wait at most `time_out`. Collective.
    ///
    /// # Errors
    /// Returns [`CommError`] if the communication fails.
    pub fn new(world: &C, report_every: Duration, time_out: Option<Duration>) -> Result<Self, CommError> {
        Ok(Self { comm: world.duplicate(time_out)?, every: report_every / 2 })
    }
}

/// A message of a rank of the micro scale.
#[derive(Serialize, Deserialize)]
enum Report {
    Evaluation(Evaluation),
    /// The rank sends nothing more.
    End,
}

/// The last evaluation of a rank. All ranks of the micro scale have the same evaluations.
#[derive(Clone, Serialize, Deserialize)]
struct Evaluation {
    number: u64,
    is_in_progress: bool,
    progress: RveProgress,
}

/// Sends the progress of a rank of the micro scale from a thread of its own, until it is dropped.
pub(super) struct ProgressSender<C> {
    comm: C,
    /// The rank that receives the messages.
    root: usize,
    /// Ends the thread when it is dropped.
    running: Sender<()>,
    thread: Option<JoinHandle<()>>,
}

impl<C: Comm> ProgressSender<C> {
    pub fn start(
        channel_of_ranks: &ProgressChannel<C>,
        scales: &Scales<C>,
        activity: Arc<Activity>,
    ) -> Result<Self, TwoScaleError> {
        let macro_scale = scales.find(MACRO).ok_or(TwoScaleError::Scale(MACRO))?;
        let root = *scales.ranks(macro_scale).first().ok_or(TwoScaleError::Scale(MACRO))?;
        let ProgressChannel { comm, every } = channel_of_ranks.clone();
        let (running, stopped) = channel();
        let of_thread = comm.clone();
        let send = move || {
            let mut last_sent = (0, false);
            while let Err(RecvTimeoutError::Timeout) = stopped.recv_timeout(every) {
                let (number, is_in_progress, progress) = activity.last();
                if !is_in_progress && last_sent == (number, false) {
                    continue;
                }
                last_sent = (number, is_in_progress);
                let report = Report::Evaluation(Evaluation { number, is_in_progress, progress });
                // The rank itself reports that communication fails.
                let sent = pack(&report).map(|message| of_thread.send(root, PROGRESS, message));
                if !matches!(sent, Ok(Ok(()))) {
                    break;
                }
            }
        };
        // Without the thread, the run continues without these messages.
        let thread = thread::Builder::new().spawn(send).ok();
        Ok(Self { comm, root, running, thread })
    }

    /// Ends the messages of this rank. After an error, the sender is dropped instead: nothing is sent then, and no thread
    /// is waited for.
    pub fn end(self) -> Result<(), TwoScaleError> {
        let Self { comm, root, running, thread } = self;
        drop(running);
        if let Some(thread) = thread {
            // A thread that panicked sends nothing more either.
            let _ = thread.join();
        }
        Ok(comm.send(root, PROGRESS, pack(&Report::End)?)?)
    }
}

/// What the root of the macro scale knows about the progress of the micro scale.
pub(super) struct ProgressReceiver<C> {
    comm: C,
    ranks: Vec<RankProgress>,
}

struct RankProgress {
    rank: usize,
    last: Option<Evaluation>,
    has_ended: bool,
}

impl<C: Comm> ProgressReceiver<C> {
    pub fn new(channel: &ProgressChannel<C>, scales: &Scales<C>) -> Result<Self, TwoScaleError> {
        let micro_scale = scales.find(MICRO).ok_or(TwoScaleError::Scale(MICRO))?;
        let ranks = scales.ranks(micro_scale).iter();
        let ranks = ranks.map(|&rank| RankProgress { rank, last: None, has_ended: false }).collect();
        Ok(Self { comm: channel.comm.clone(), ranks })
    }

    /// Returns a function that returns the progress of all ranks, from any thread.
    pub fn source(receiver: &Arc<Mutex<Self>>) -> ProgressSource {
        let receiver = Arc::clone(receiver);
        Box::new(move || receiver.lock().unwrap_or_else(PoisonError::into_inner).progress())
    }

    /// Returns the progress of all ranks according to the messages that have arrived; `None` if none of them evaluates.
    fn progress(&mut self) -> Option<RveProgress> {
        let Self { comm, ranks } = self;
        for rank in ranks.iter_mut() {
            // The main thread finds errors of communication itself.
            while !rank.has_ended && comm.probe(rank.rank, PROGRESS).ok()? {
                rank.receive(comm).ok()?;
            }
        }
        sum(ranks.iter().filter_map(|rank| rank.last.as_ref()))
    }

    /// Receives the messages of all ranks up to their last ones.
    ///
    /// # Errors
    /// Returns [`TwoScaleError`] if communication fails.
    pub fn receive_all(&mut self) -> Result<(), TwoScaleError> {
        for rank in &mut self.ranks {
            while !rank.has_ended {
                rank.receive(&self.comm)?;
            }
        }
        Ok(())
    }
}

impl RankProgress {
    fn receive(&mut self, comm: &impl Comm) -> Result<(), TwoScaleError> {
        match unpack(&comm.receive(self.rank, PROGRESS)?)? {
            Report::Evaluation(evaluation) => self.last = Some(evaluation),
            Report::End => self.has_ended = true,
        }
        Ok(())
    }
}

/// Sums the progress of ranks in the newest evaluation that any of them has reported. What a rank has done in it counts
/// from its first message about it.
fn sum<'a>(ranks: impl Iterator<Item = &'a Evaluation> + Clone) -> Option<RveProgress> {
    let newest = ranks.clone().map(|rank| rank.number).max()?;
    let in_newest = ranks.clone().filter(|rank| rank.number == newest);
    let slowest = in_newest.clone().filter_map(|rank| rank.progress.slowest).max_by_key(|slowest| slowest.elapsed);
    in_newest.clone().any(|rank| rank.is_in_progress).then(|| RveProgress {
        rves: ranks.map(|rank| rank.progress.rves).sum(),
        done: in_newest.map(|rank| rank.progress.done).sum(),
        slowest,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::backends::comm::thread;
    use crate::coupling::{Plan, Share};
    use crate::fem::mesh::IntegrationPoint;
    use crate::tissue::micro_scale::SlowestRve;

    fn evaluation(number: u64, is_in_progress: bool, done: usize, slowest: Option<(usize, u64)>) -> Evaluation {
        let slowest = slowest.map(|(element, seconds)| SlowestRve {
            point: IntegrationPoint::of_element(element),
            elapsed: Duration::from_secs(seconds),
            stage: None,
        });
        Evaluation { number, is_in_progress, progress: RveProgress { rves: 10, done, slowest } }
    }

    #[test]
    fn ranks_are_summed_in_the_newest_evaluation() {
        let ranks = [
            evaluation(3, true, 4, Some((7, 20))),
            evaluation(3, false, 10, None),
            evaluation(2, false, 10, None),
            evaluation(3, true, 1, Some((8, 30))),
            evaluation(2, true, 9, Some((9, 90))),
        ];
        let progress = sum(ranks.iter()).unwrap();
        assert_eq!((progress.rves, progress.done, progress.slowest.unwrap().point.element), (50, 15, 8));
        assert_eq!(sum(ranks[1..3].iter()), None, "the newest evaluation has ended");
        assert_eq!(sum([].iter()), None);
    }

    /// The root knows of an evaluation while it lasts and when it has ended, and receives all messages at the end.
    #[test]
    fn messages_arrive_until_the_ranks_end() {
        let main = |world: thread::ThreadComm| -> Result<(), TwoScaleError> {
            let plan = Plan::default().with(MACRO, Share::Count(1)).with(MICRO, Share::Count(2));
            let scales = Scales::new(&world, &plan)?;
            let channel = ProgressChannel::new(&world, Duration::from_millis(2), None)?;
            if scales.name(scales.own()) == MACRO {
                let receiver = Arc::new(Mutex::new(ProgressReceiver::new(&channel, &scales)?));
                let source = ProgressReceiver::source(&receiver);
                let wait_until = |is_reached: &dyn Fn(Option<RveProgress>) -> bool| {
                    while !is_reached(source()) {
                        std::thread::sleep(Duration::from_millis(1));
                    }
                };
                wait_until(&|progress| progress.is_some_and(|progress| (progress.rves, progress.done) == (7, 2)));
                world.barrier()?;
                // Rank 2 continues: all that is missing are its RVEs.
                wait_until(&|progress| progress.is_some_and(|progress| (progress.rves, progress.done) == (7, 4)));
                world.barrier()?;
                wait_until(&|progress| progress.is_none());
                let mut receiver = receiver.lock().unwrap();
                receiver.receive_all()?;
                assert!(
                    receiver.ranks.iter().all(|rank| rank.has_ended && !rank.last.as_ref().unwrap().is_in_progress)
                );
                return Ok(());
            }
            let activity = Arc::<Activity>::default();
            let sender = ProgressSender::start(&channel, &scales, Arc::clone(&activity))?;
            let evaluation = activity.evaluate(2 + world.rank());
            activity.skip(1);
            world.barrier()?;
            let of_second = (world.rank() == 2).then_some(evaluation);
            world.barrier()?;
            drop(of_second);
            // The end of the evaluation is sent before that of the run.
            std::thread::sleep(Duration::from_millis(100));
            sender.end()
        };
        thread::run(3, main).unwrap();
    }
}
