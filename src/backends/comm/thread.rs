//! Ranks as threads of one process, for tests and for single machines.

use std::collections::VecDeque;
use std::collections::hash_map::{Entry, HashMap};
use std::fmt::Display;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use crate::las::{Comm, CommError, Message, ReceiveRequest, SendRequest, Tag};

/// A communicator whose ranks are threads.
#[derive(Clone, Debug)]
pub struct ThreadComm {
    world: Arc<World>,
    /// Distinguishes the messages of one group from those of others.
    group: u64,
    /// The ranks of the group, by their numbers among all threads.
    members: Arc<[usize]>,
    rank: usize,
    time_out: Option<Duration>,
}

/// The state shared by all threads.
#[derive(Debug)]
struct World {
    mailboxes: Vec<Mailbox>,
    /// The first rank that failed, and its reason.
    failed: Mutex<Option<Failed>>,
    /// For each rank, whether it has ended and sends no more messages.
    ended: Vec<AtomicBool>,
    groups: AtomicU64,
}

/// Messages that have arrived and were not yet received, by address; no queue is empty.
type Messages = HashMap<Address, VecDeque<Message>>;

#[derive(Debug, Default)]
struct Mailbox {
    messages: Mutex<Messages>,
    arrived: Condvar,
}

/// The address of messages in a mailbox: the group, the sender's number among all threads, and the tag.
type Address = (u64, usize, Tag);

/// A rank that failed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Failed {
    /// The number of the rank.
    pub rank: usize,
    /// The message of its error or panic.
    pub reason: String,
    /// True if the rank panicked.
    pub has_panicked: bool,
}

impl Display for Failed {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "rank {} failed: {}", self.rank, self.reason)
    }
}

impl std::error::Error for Failed {}

impl From<Failed> for CommError {
    fn from(Failed { rank, reason, .. }: Failed) -> Self {
        Self::Ended { rank, reason }
    }
}

/// Locks a mutex and ignores poisoning: every value locked here is consistent at any time.
fn lock_ignoring_poison<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Runs `main` on `ranks` threads and waits for all of them. If a rank fails, another rank that computes or sleeps
/// continues until it sends or receives. The results are in rank order.
///
/// # Errors
/// Returns the first rank that returned an error or panicked; it ends the other ranks.
pub fn run<R: Send, E: Display>(
    ranks: usize,
    main: impl Fn(ThreadComm) -> Result<R, E> + Sync,
) -> Result<Vec<R>, Failed> {
    let world = Arc::new(World {
        mailboxes: (0..ranks).map(|_| Mailbox::default()).collect(),
        failed: Mutex::new(None),
        ended: (0..ranks).map(|_| AtomicBool::new(false)).collect(),
        groups: AtomicU64::new(1),
    });
    let members: Arc<[usize]> = (0..ranks).collect();
    let outcomes: Vec<Option<R>> = thread::scope(|scope| {
        let start = |rank: usize| {
            let comm =
                ThreadComm { world: Arc::clone(&world), group: 0, members: Arc::clone(&members), rank, time_out: None };
            let (main, world) = (&main, &world);
            let run = move || match catch_unwind(AssertUnwindSafe(|| main(comm))) {
                Ok(Ok(found)) => {
                    world.ended[rank].store(true, Ordering::Release);
                    world.wake();
                    Some(found)
                }
                Ok(Err(error)) => world.fail(Failed { rank, reason: error.to_string(), has_panicked: false }),
                Err(panic) => {
                    world.fail(Failed { rank, reason: super::panic_message(panic.as_ref()), has_panicked: true })
                }
            };
            let started = thread::Builder::new().spawn_scoped(scope, run);
            // The ranks that already run may wait for this one; the failure ends them.
            let without = |error| format!("no thread could be started for it: {error}");
            let failed = |error| world.fail::<R>(Failed { rank, reason: without(error), has_panicked: false });
            started.map_err(failed).ok()
        };
        let threads: Vec<_> = (0..ranks).map_while(start).collect();
        threads.into_iter().map(|thread| thread.join().unwrap_or(None)).collect()
    });
    match lock_ignoring_poison(&world.failed).take() {
        Some(failed) => Err(failed),
        None => Ok(outcomes.into_iter().flatten().collect()),
    }
}

impl World {
    /// Records a failure, unless another rank failed before, and ends all ranks.
    fn fail<R>(&self, failed: Failed) -> Option<R> {
        lock_ignoring_poison(&self.failed).get_or_insert(failed);
        self.wake();
        None
    }

    /// Wakes all waiting ranks, which then check the state again.
    fn wake(&self) {
        for mailbox in &self.mailboxes {
            // The lock ensures that no rank starts to wait between its check and this notification.
            let _messages = lock_ignoring_poison(&mailbox.messages);
            mailbox.arrived.notify_all();
        }
    }

    fn check(&self) -> Result<(), CommError> {
        lock_ignoring_poison(&self.failed).clone().map_or(Ok(()), |failed| Err(failed.into()))
    }
}

impl ThreadComm {
    /// Creates a communicator with a single rank.
    pub fn alone() -> Self {
        let mailboxes = vec![Mailbox::default()];
        let ended = vec![AtomicBool::new(false)];
        let world = World { mailboxes, failed: Mutex::new(None), ended, groups: AtomicU64::new(1) };
        Self { world: Arc::new(world), group: 0, members: [0].into(), rank: 0, time_out: None }
    }

    /// Returns the number among all threads of a rank of this group.
    fn in_world(&self, rank: usize) -> Result<usize, CommError> {
        let size = self.members.len();
        self.members.get(rank).copied().ok_or(CommError::Rank { rank, size })
    }

    /// Returns the first of `count` new group numbers, the same on all ranks (collective).
    fn new_groups(&self, count: usize) -> Result<u64, CommError> {
        let first = match self.rank {
            0 => self.world.groups.fetch_add(count as u64, Ordering::Relaxed),
            _ => 0,
        };
        let agreed = self.broadcast(0, Message::of(&[first]))?;
        Ok(agreed.values::<u64>().and_then(|numbers| numbers.first()).copied().unwrap_or(first))
    }

    /// Waits until a message from a rank has arrived. Returns the locked mailbox and the address of the message.
    fn wait_for_message(&self, from: usize, tag: Tag) -> Result<(MutexGuard<'_, Messages>, Address), CommError> {
        let sender = self.in_world(from)?;
        let address = (self.group, sender, tag);
        let mailbox = &self.world.mailboxes[self.members[self.rank]];
        let end = self.time_out.and_then(|time_out| Some((Instant::now().checked_add(time_out)?, time_out)));
        let mut messages = lock_ignoring_poison(&mailbox.messages);
        loop {
            // Read before the queue: the messages that a rank sends before it ends are then already in the mailbox.
            let has_ended = self.world.ended[sender].load(Ordering::Acquire);
            if messages.get(&address).is_some_and(|queue| !queue.is_empty()) {
                return Ok((messages, address));
            }
            self.world.check()?;
            if has_ended {
                let reason = "it ended without sending a message that another rank waits for".into();
                return Err(CommError::Ended { rank: sender, reason });
            }
            messages = match end {
                None => mailbox.arrived.wait(messages).unwrap_or_else(PoisonError::into_inner),
                Some((end, time_out)) => {
                    let left = end.saturating_duration_since(Instant::now());
                    if left.is_zero() {
                        return Err(CommError::TimeOut { from, waited: time_out });
                    }
                    mailbox.arrived.wait_timeout(messages, left).unwrap_or_else(PoisonError::into_inner).0
                }
            };
        }
    }
}

/// A send that is complete: the message is in the mailbox of the receiver.
#[derive(Clone, Copy, Debug)]
pub struct CompletedSend;

impl SendRequest for CompletedSend {
    fn wait(self) -> Result<Option<Message>, CommError> {
        Ok(None)
    }
}

/// A receive whose message has yet to arrive in the mailbox of this rank.
#[derive(Clone, Debug)]
pub struct PendingReceive {
    comm: ThreadComm,
    from: usize,
    tag: Tag,
    len: usize,
}

impl ReceiveRequest for PendingReceive {
    fn wait(self) -> Result<Message, CommError> {
        let Self { comm, from, tag, len } = self;
        let message = comm.receive(from, tag)?;
        let found = message.len();
        if found == len { Ok(message) } else { Err(CommError::Size { from, found, expected: len }) }
    }
}

impl Comm for ThreadComm {
    type SendRequest = CompletedSend;
    type ReceiveRequest = PendingReceive;

    fn rank(&self) -> usize {
        self.rank
    }

    fn size(&self) -> usize {
        self.members.len()
    }

    fn start_send(&self, to: usize, tag: Tag, message: Message) -> Result<CompletedSend, CommError> {
        self.world.check()?;
        let mailbox = &self.world.mailboxes[self.in_world(to)?];
        let address = (self.group, self.members[self.rank], tag);
        lock_ignoring_poison(&mailbox.messages).entry(address).or_default().push_back(message);
        mailbox.arrived.notify_all();
        Ok(CompletedSend)
    }

    fn receive(&self, from: usize, tag: Tag) -> Result<Message, CommError> {
        let (mut messages, address) = self.wait_for_message(from, tag)?;
        let Entry::Occupied(mut queue) = messages.entry(address) else { return Ok(Message::new()) };
        let message = queue.get_mut().pop_front().unwrap_or_default();
        // Remove the empty queue, because it is possible that no rank writes to this address again.
        if queue.get().is_empty() {
            queue.remove();
        }
        Ok(message)
    }

    fn wait_for(&self, from: usize, tag: Tag) -> Result<(), CommError> {
        self.wait_for_message(from, tag).map(drop)
    }

    fn start_receive(&self, from: usize, tag: Tag, len: usize, _: Message) -> Result<PendingReceive, CommError> {
        self.in_world(from)?;
        Ok(PendingReceive { comm: self.clone(), from, tag, len })
    }

    fn probe(&self, from: usize, tag: Tag) -> Result<bool, CommError> {
        let address = (self.group, self.in_world(from)?, tag);
        self.world.check()?;
        let messages = lock_ignoring_poison(&self.world.mailboxes[self.members[self.rank]].messages);
        Ok(messages.get(&address).is_some_and(|queue| !queue.is_empty()))
    }

    fn split(&self, color: Option<usize>, key: usize) -> Result<Option<Self>, CommError> {
        let own = color.map_or(u64::MAX, |color| color as u64);
        let all = self.gather_all(Message::of(&[own, key as u64]))?;
        let all = all.iter().enumerate().filter_map(|(rank, message)| match *message.values::<u64>()? {
            [color, key] if color == own => Some((key, rank)),
            _ => None,
        });
        let mut members: Vec<(u64, usize)> = all.collect();
        members.sort_unstable();
        let first = self.new_groups(self.size())?;
        if color.is_none() {
            return Ok(None);
        }
        let ranks: Vec<usize> = members.into_iter().map(|(_, rank)| rank).collect();
        let rank = ranks.iter().position(|&rank| rank == self.rank).unwrap_or(0);
        // The number of a group derives from its first rank, which belongs to no other group.
        let group = first + ranks.first().copied().unwrap_or(0) as u64;
        let members = ranks.iter().map(|&rank| self.members[rank]).collect();
        Ok(Some(Self { world: Arc::clone(&self.world), group, members, rank, time_out: self.time_out }))
    }

    fn duplicate(&self, time_out: Option<Duration>) -> Result<Self, CommError> {
        Ok(Self { group: self.new_groups(1)?, time_out, ..self.clone() })
    }
}
