//! Ranks as threads of one process: what tests run on, and a laptop.

use std::collections::VecDeque;
use std::collections::hash_map::{Entry, HashMap};
use std::fmt::Display;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use crate::las::{Comm, CommError, Message, Receiving, Sending, Tag};

/// Threads that run side by side, each a rank.
#[derive(Clone, Debug)]
pub struct ThreadComm {
    world: Arc<World>,
    /// Tells messages of one group from those of others.
    group: u64,
    /// The ranks of the group, by their numbers in the world.
    members: Arc<[usize]>,
    rank: usize,
    time_out: Option<Duration>,
}

/// All threads.
#[derive(Debug)]
struct World {
    mailboxes: Vec<Mailbox>,
    /// The first rank that failed, and what it said.
    failed: Mutex<Option<Failed>>,
    /// Ranks that have come to their end and send nothing more.
    ended: Vec<AtomicBool>,
    groups: AtomicU64,
}

/// What has come and was not received: by address, never an empty queue.
type Messages = HashMap<Address, VecDeque<Message>>;

#[derive(Debug, Default)]
struct Mailbox {
    messages: Mutex<Messages>,
    arrived: Condvar,
}

/// What tells messages in a mailbox apart: the group, the rank in the world that sent it, and the tag.
type Address = (u64, usize, Tag);

/// A rank that failed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Failed {
    /// Its number.
    pub rank: usize,
    /// What it said, or panicked with.
    pub reason: String,
    /// Whether it panicked.
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

/// What a thread does not know of another's panic: every value that is locked here is whole at any time.
fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Runs `main` as so many ranks, and waits for all of them: one that computes or sleeps when another fails is not disturbed
/// until it sends or receives. What they return comes in their order.
///
/// # Errors
/// The first rank that returned an error or panicked; the others are ended by it.
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
                Err(panic) => world.fail(Failed { rank, reason: super::words_of(panic.as_ref()), has_panicked: true }),
            };
            let started = thread::Builder::new().spawn_scoped(scope, run);
            // Those that have started wait for this one.
            let without = |error| format!("the system gives it no thread: {error}");
            let failed = |error| world.fail::<R>(Failed { rank, reason: without(error), has_panicked: false });
            started.map_err(failed).ok()
        };
        let threads: Vec<_> = (0..ranks).map_while(start).collect();
        threads.into_iter().map(|thread| thread.join().unwrap_or(None)).collect()
    });
    match locked(&world.failed).take() {
        Some(failed) => Err(failed),
        None => Ok(outcomes.into_iter().flatten().collect()),
    }
}

impl World {
    /// Ends all ranks, unless another has before.
    fn fail<R>(&self, failed: Failed) -> Option<R> {
        locked(&self.failed).get_or_insert(failed);
        self.wake();
        None
    }

    /// Lets all ranks that wait look again.
    fn wake(&self) {
        for mailbox in &self.mailboxes {
            // With the lock, so that nobody goes to sleep between looking and waiting.
            let _messages = locked(&mailbox.messages);
            mailbox.arrived.notify_all();
        }
    }

    fn check(&self) -> Result<(), CommError> {
        locked(&self.failed).clone().map_or(Ok(()), |failed| Err(failed.into()))
    }
}

impl ThreadComm {
    /// One rank alone.
    #[must_use]
    pub fn alone() -> Self {
        let mailboxes = vec![Mailbox::default()];
        let ended = vec![AtomicBool::new(false)];
        let world = World { mailboxes, failed: Mutex::new(None), ended, groups: AtomicU64::new(1) };
        Self { world: Arc::new(world), group: 0, members: [0].into(), rank: 0, time_out: None }
    }

    /// The number in the world of a rank of this group.
    fn in_world(&self, rank: usize) -> Result<usize, CommError> {
        let size = self.members.len();
        self.members.get(rank).copied().ok_or(CommError::Rank { rank, size })
    }

    /// As many new numbers of groups, the same for all ranks: the first of them.
    fn new_groups(&self, count: usize) -> Result<u64, CommError> {
        let first = match self.rank {
            0 => self.world.groups.fetch_add(count as u64, Ordering::Relaxed),
            _ => 0,
        };
        let agreed = self.broadcast(0, Message::of(&[first]))?;
        Ok(agreed.values::<u64>().and_then(|numbers| numbers.first()).copied().unwrap_or(first))
    }

    /// Waits until a message of a rank has come: the mailbox, in which there is one at that address.
    fn arrived(&self, from: usize, tag: Tag) -> Result<(MutexGuard<'_, Messages>, Address), CommError> {
        let sender = self.in_world(from)?;
        let address = (self.group, sender, tag);
        let mailbox = &self.world.mailboxes[self.members[self.rank]];
        let end = self.time_out.and_then(|time_out| Some((Instant::now().checked_add(time_out)?, time_out)));
        let mut messages = locked(&mailbox.messages);
        loop {
            // Asked before looking: what a rank sends before its end is there then.
            let has_ended = self.world.ended[sender].load(Ordering::Acquire);
            if messages.get(&address).is_some_and(|queue| !queue.is_empty()) {
                return Ok((messages, address));
            }
            self.world.check()?;
            if has_ended {
                let reason = "it came to its end without sending what others wait for".into();
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

/// A message that has arrived.
#[derive(Clone, Copy, Debug)]
pub struct Sent;

impl Sending for Sent {
    fn wait(self) -> Result<Option<Message>, CommError> {
        Ok(None)
    }
}

/// A message that is put into this rank's mailbox some time.
#[derive(Clone, Debug)]
pub struct Expected {
    comm: ThreadComm,
    from: usize,
    tag: Tag,
    len: usize,
}

impl Receiving for Expected {
    fn wait(self) -> Result<Message, CommError> {
        let Self { comm, from, tag, len } = self;
        let message = comm.receive(from, tag)?;
        let found = message.len();
        if found == len { Ok(message) } else { Err(CommError::Size { from, found, expected: len }) }
    }
}

impl Comm for ThreadComm {
    type Sending = Sent;
    type Receiving = Expected;

    fn rank(&self) -> usize {
        self.rank
    }

    fn size(&self) -> usize {
        self.members.len()
    }

    fn start_send(&self, to: usize, tag: Tag, message: Message) -> Result<Sent, CommError> {
        self.world.check()?;
        let mailbox = &self.world.mailboxes[self.in_world(to)?];
        let address = (self.group, self.members[self.rank], tag);
        locked(&mailbox.messages).entry(address).or_default().push_back(message);
        mailbox.arrived.notify_all();
        Ok(Sent)
    }

    fn receive(&self, from: usize, tag: Tag) -> Result<Message, CommError> {
        let (mut messages, address) = self.arrived(from, tag)?;
        let Entry::Occupied(mut queue) = messages.entry(address) else { return Ok(Message::new()) };
        let message = queue.get_mut().pop_front().unwrap_or_default();
        // Nothing stays of addresses that nobody writes to again.
        if queue.get().is_empty() {
            queue.remove();
        }
        Ok(message)
    }

    fn wait_for(&self, from: usize, tag: Tag) -> Result<(), CommError> {
        self.arrived(from, tag).map(drop)
    }

    fn start_receive(&self, from: usize, tag: Tag, len: usize, _: Message) -> Result<Expected, CommError> {
        self.in_world(from)?;
        Ok(Expected { comm: self.clone(), from, tag, len })
    }

    fn is_there(&self, from: usize, tag: Tag) -> Result<bool, CommError> {
        let address = (self.group, self.in_world(from)?, tag);
        self.world.check()?;
        let messages = locked(&self.world.mailboxes[self.members[self.rank]].messages);
        Ok(messages.get(&address).is_some_and(|queue| !queue.is_empty()))
    }

    fn split(&self, color: Option<usize>, place: usize) -> Result<Option<Self>, CommError> {
        let own = color.map_or(u64::MAX, |color| color as u64);
        let all = self.gather_all(Message::of(&[own, place as u64]))?;
        let all = all.iter().enumerate().filter_map(|(rank, message)| match *message.values::<u64>()? {
            [color, place] if color == own => Some((place, rank)),
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
        // A group is numbered by its first rank, of which no other group has it.
        let group = first + ranks.first().copied().unwrap_or(0) as u64;
        let members = ranks.iter().map(|&rank| self.members[rank]).collect();
        Ok(Some(Self { world: Arc::clone(&self.world), group, members, rank, time_out: self.time_out }))
    }

    fn duplicate(&self, time_out: Option<Duration>) -> Result<Self, CommError> {
        Ok(Self { group: self.new_groups(1)?, time_out, ..self.clone() })
    }
}
