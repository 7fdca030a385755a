//! Ranks as MPI processes.
#![allow(unsafe_code, reason = "the interface to a C library")]

mod collectives;
mod requests;

use std::fmt;
use std::fmt::Display;
use std::io::Write;
use std::mem::{ManuallyDrop, MaybeUninit};
use std::ops::Range;
use std::panic;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use mpi::environment::{Threading, Universe, initialize_with_threading, threading_support};
use mpi::ffi;
use mpi::raw::AsRaw;
use mpi::topology::{Color, Communicator, SimpleCommunicator};

use self::requests::{MAX_PART_BYTES, Requests, check, poll};
pub use self::requests::{MpiReceiveRequest, MpiSendRequest};
use crate::las::{Comm, CommError, Message, SendRequest, Tag};

/// A communicator whose ranks are MPI processes. Any thread may use it; MPI must be initialized to allow that.
#[derive(Clone)]
pub struct MpiComm {
    group: Arc<Group>,
    time_out: Option<Duration>,
    /// Whether any rank of the group has a time-out; the same on all ranks.
    has_time_out: bool,
}

/// A duplicated communicator, freed with the last `MpiComm` or pending receive that holds it.
struct Group {
    /// Freed in `drop` only, not by its own destructor.
    comm: ManuallyDrop<SimpleCommunicator>,
    raw: ffi::MPI_Comm,
    rank: usize,
    size: usize,
    /// Whether this rank gave up a receive, so that its message may still arrive.
    has_late_messages: AtomicBool,
}

impl Group {
    /// Keeps MPI from giving the number of this communicator to another one, on which a receive would accept a message
    /// that arrives late for this one.
    fn keep(&self) {
        self.has_late_messages.store(true, Ordering::Relaxed);
    }
}

// SAFETY: a communicator is not bound to a thread, and `MpiComm::new` creates none unless MPI allows concurrent calls
// from all threads.
unsafe impl Send for Group {}
// SAFETY: as above.
unsafe impl Sync for Group {}

impl Drop for Group {
    fn drop(&mut self) {
        // MPI must not free communicators after it is finalized, or while it is about to be aborted.
        if !is_over() && !thread::panicking() && !self.has_late_messages.load(Ordering::Relaxed) {
            // SAFETY: a communicator that was duplicated or split for this group alone, and is freed once.
            unsafe { ffi::MPI_Comm_free(&raw mut self.raw) };
        }
    }
}

/// Returns true if MPI is finalized.
fn is_over() -> bool {
    let mut over = 0;
    // SAFETY: may be called at any time.
    unsafe { ffi::MPI_Finalized(&raw mut over) };
    over != 0
}

impl fmt::Debug for MpiComm {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "MpiComm {{ {:?} }}", self.group)
    }
}

impl fmt::Debug for Group {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "rank {} of {}", self.rank, self.size)
    }
}

/// An initialized MPI, finalized when this value is dropped.
pub struct Mpi {
    _universe: Universe,
}

impl Mpi {
    /// Initializes MPI; returns `None` if it is already initialized.
    pub fn start() -> Option<Self> {
        initialize_with_threading(Threading::Multiple).map(|(universe, _)| Self { _universe: universe })
    }
}

/// Runs `main` on all ranks that `mpirun` started, and returns its result once it has returned on all ranks. A rank
/// that fails or panics prints the reason and aborts all other ranks at once, with the exit code that `code` returns
/// for its error; a panic on any thread does so, even if it would be caught. If a rank returns normally while others
/// wait for its messages, they keep waiting; a time-out ([`Comm::duplicate`]) reports that rank.
pub fn run<R, E: Display>(main: impl FnOnce(MpiComm) -> Result<R, E>, code: impl FnOnce(&E) -> i32) -> R {
    let mpi = Mpi::start();
    let world = SimpleCommunicator::world();
    let (comm, end) = match (MpiComm::new(&world), MpiComm::new(&world)) {
        (Ok(comm), Ok(end)) => (comm, end),
        (Err(error), _) | (_, Err(error)) => end_all(&error.to_string(), PANICKED),
    };
    let before = Arc::new(panic::take_hook());
    let hook = Arc::clone(&before);
    // The hook runs before any unwinding, because destructors of libraries may wait for other ranks.
    panic::set_hook(Box::new(move |info| {
        hook(info);
        end_all(&super::panic_message(info.payload()), PANICKED);
    }));
    let outcome = main(comm);
    panic::set_hook(Box::new(move |info| before(info)));
    match outcome {
        Ok(found) => {
            // Open MPI may hang if one rank aborts while others finalize MPI; therefore no rank finalizes before all
            // ranks are here.
            let _ = end.barrier();
            drop(end);
            drop(mpi);
            found
        }
        Err(error) => end_all(&error.to_string(), code(&error)),
    }
}

/// Prints the reason and aborts all ranks.
fn end_all(reason: &str, code: i32) -> ! {
    let world = SimpleCommunicator::world();
    // A single write, because other ranks may print too.
    let _ = std::io::stderr().write_all(format!("rank {} ends all ranks: {reason}\n", world.rank()).as_bytes());
    // The launcher of MPICH discards what it has not read when a rank aborts.
    thread::sleep(TIME_TO_PRINT);
    // Other ranks may wait for this rank forever; only an abort ends them.
    world.abort(code)
}

/// The time for which a failing rank waits for the launcher to read its message.
const TIME_TO_PRINT: Duration = Duration::from_millis(200);

/// The exit code of a rank that panicked, as for any Rust program.
const PANICKED: i32 = 101;

impl MpiComm {
    /// Creates an [`MpiComm`] on a duplicate of a communicator (collective).
    ///
    /// # Errors
    /// Returns [`CommError::Library`] if MPI was initialized without `MPI_THREAD_MULTIPLE`.
    pub fn new(comm: &impl Communicator) -> Result<Self, CommError> {
        match threading_support() {
            Threading::Multiple => Ok(Self::of(comm.duplicate())),
            less => Err(CommError::Library(format!(
                "MPI was started for {less:?} threads, and Multiple (MPI_THREAD_MULTIPLE) is needed: start it so, with \
                 an MPI that allows it"
            ))),
        }
    }

    /// Creates an [`MpiComm`] without a time-out.
    fn of(comm: SimpleCommunicator) -> Self {
        let (raw, rank, size) = (comm.as_raw(), comm.rank() as usize, comm.size() as usize);
        let (comm, has_late_messages) = (ManuallyDrop::new(comm), AtomicBool::new(false));
        let group = Arc::new(Group { comm, raw, rank, size, has_late_messages });
        Self { group, time_out: None, has_time_out: false }
    }

    /// Returns the communicator, for libraries that use MPI themselves.
    pub fn communicator(&self) -> &SimpleCommunicator {
        &self.group.comm
    }

    fn known(&self, rank: usize) -> Result<i32, CommError> {
        let size = self.group.size;
        if rank < size { Ok(rank as i32) } else { Err(CommError::Rank { rank, size }) }
    }

    /// Probes for a message; returns its handle and its length in bytes.
    fn matched_probe(&self, from: i32, tag: Tag) -> Result<Option<(ffi::MPI_Message, usize)>, CommError> {
        let (mut there, mut message, mut status) = (0, MaybeUninit::uninit(), MaybeUninit::uninit());
        // SAFETY: a live communicator; all three are written if a message has arrived.
        let code = unsafe {
            ffi::MPI_Improbe(
                from,
                tag.0 as i32,
                self.group.raw,
                &raw mut there,
                message.as_mut_ptr(),
                status.as_mut_ptr(),
            )
        };
        check(code)?;
        if there == 0 {
            return Ok(None);
        }
        let mut bytes = 0;
        // SAFETY: the status was written by the probe; the type is a constant of MPI.
        check(unsafe { ffi::MPI_Get_count(status.as_ptr(), ffi::RSMPI_UINT8_T, &raw mut bytes) })?;
        // SAFETY: written by the probe.
        Ok(Some((unsafe { message.assume_init() }, bytes as usize)))
    }

    /// Waits for a message and returns its handle and its length in bytes (matched probe).
    fn matched(&self, from: i32, tag: Tag) -> Result<(ffi::MPI_Message, usize), CommError> {
        self.poll(from, || self.matched_probe(from, tag))
    }

    /// Polls for a message, for no longer than the time-out.
    fn poll<T>(&self, from: i32, find: impl FnMut() -> Result<Option<T>, CommError>) -> Result<T, CommError> {
        poll(from, self.time_out, find).inspect_err(|_| self.group.keep())
    }

    /// Starts to send bytes in parts. A part of full length indicates that another part follows, which may be empty.
    ///
    /// # Safety
    /// The bytes stay in place, unchanged, until all `requests` are completed, also if this function fails.
    unsafe fn start_parts(&self, to: i32, tag: Tag, bytes: &[u8], requests: &mut Requests) -> Result<(), CommError> {
        let send = |part: Range<usize>, request| {
            let part = &bytes[part];
            // SAFETY: a live communicator, and bytes that stay in place, as the caller promises.
            unsafe {
                ffi::MPI_Isend(
                    part.as_ptr().cast(),
                    part.len() as i32,
                    ffi::RSMPI_UINT8_T,
                    to,
                    tag.0 as i32,
                    self.group.raw,
                    request,
                )
            }
        };
        // SAFETY: the call writes the request if it succeeds.
        unsafe { requests.start(bytes.len(), send) }
    }
}

/// Receives a part of a message that a probe has found; `memory` has the length that the probe returned.
fn receive_part(mut handle: ffi::MPI_Message, memory: &mut [u8]) -> Result<(), CommError> {
    // SAFETY: the memory has the length of the message; the handle is used once.
    check(unsafe {
        ffi::MPI_Mrecv(
            memory.as_mut_ptr().cast(),
            memory.len() as i32,
            ffi::RSMPI_UINT8_T,
            &raw mut handle,
            ffi::RSMPI_STATUS_IGNORE,
        )
    })
}

impl Comm for MpiComm {
    type SendRequest = MpiSendRequest;
    type ReceiveRequest = MpiReceiveRequest;

    fn rank(&self) -> usize {
        self.group.rank
    }

    fn size(&self) -> usize {
        self.group.size
    }

    fn start_send(&self, to: usize, tag: Tag, message: Message) -> Result<MpiSendRequest, CommError> {
        let rank = self.known(to)?;
        let mut sending = MpiSendRequest { message, requests: Requests::default(), to, time_out: self.time_out };
        let MpiSendRequest { message, requests, .. } = &mut sending;
        // SAFETY: the memory of the message stays in place until `MpiSendRequest` completes the requests or leaks it.
        unsafe { self.start_parts(rank, tag, message.bytes(), requests) }?;
        Ok(sending)
    }

    fn send_bytes(&self, tag: Tag, parcels: &[(usize, &[u8])]) -> Result<(), CommError> {
        let known = |&(to, bytes): &(usize, _)| Ok((self.known(to)?, bytes));
        let known: Vec<(i32, &[u8])> = parcels.iter().map(known).collect::<Result<_, CommError>>()?;
        if self.time_out.is_some() {
            // Borrowed bytes cannot outlive this call after a time-out; copies can.
            let start = |&(to, bytes): &(usize, &[u8])| self.start_send(to, tag, Message::of(bytes));
            let sendings: Vec<MpiSendRequest> = parcels.iter().map(start).collect::<Result<_, _>>()?;
            return sendings.into_iter().try_for_each(|sending| sending.wait().map(drop));
        }
        let mut requests = Requests::default();
        let mut parcels = known.into_iter();
        // SAFETY: the bytes are borrowed until the requests are completed below, whether or not all sends could be
        // started.
        let started = parcels.try_for_each(|(to, bytes)| unsafe { self.start_parts(to, tag, bytes, &mut requests) });
        started.and(requests.complete())
    }

    fn receive(&self, from: usize, tag: Tag) -> Result<Message, CommError> {
        self.receive_into(from, tag, Message::new())
    }

    fn wait_for(&self, from: usize, tag: Tag) -> Result<(), CommError> {
        self.poll(self.known(from)?, || Ok(self.probe(from, tag)?.then_some(())))
    }

    fn receive_into(&self, from: usize, tag: Tag, memory: Message) -> Result<Message, CommError> {
        let rank = self.known(from)?;
        let (mut message, mut there) = (memory, 0);
        loop {
            let (handle, count) = self.matched(rank, tag)?;
            message.resize(there + count);
            receive_part(handle, &mut message.bytes_mut()[there..])?;
            there += count;
            if count < MAX_PART_BYTES {
                return Ok(message);
            }
        }
    }

    fn receive_bytes(&self, from: usize, tag: Tag, bytes: &mut [u8]) -> Result<(), CommError> {
        let rank = self.known(from)?;
        let mut there = 0;
        loop {
            let (handle, count) = self.matched(rank, tag)?;
            match bytes.get_mut(there..there + count) {
                Some(memory) => receive_part(handle, memory)?,
                // Receive the excess as well, so that no part of the message stays pending.
                None => receive_part(handle, &mut vec![0; count])?,
            }
            there += count;
            if count < MAX_PART_BYTES {
                break;
            }
        }
        let expected = bytes.len();
        if there == expected { Ok(()) } else { Err(CommError::Size { from, found: there, expected }) }
    }

    fn start_receive(
        &self,
        from: usize,
        tag: Tag,
        len: usize,
        memory: Message,
    ) -> Result<MpiReceiveRequest, CommError> {
        let from = self.known(from)?;
        let (requests, group) = (Requests::default(), Arc::clone(&self.group));
        let mut receiving = MpiReceiveRequest { message: memory, requests, from, time_out: self.time_out, group };
        receiving.message.resize(len);
        let MpiReceiveRequest { message, requests, .. } = &mut receiving;
        let bytes = message.bytes_mut();
        let receive = |part: Range<usize>, request| {
            let part = &mut bytes[part];
            // SAFETY: a live communicator, and the memory of the message, which stays in place until
            // `MpiReceiveRequest` completes the requests or leaks it.
            unsafe {
                ffi::MPI_Irecv(
                    part.as_mut_ptr().cast(),
                    part.len() as i32,
                    ffi::RSMPI_UINT8_T,
                    from,
                    tag.0 as i32,
                    self.group.raw,
                    request,
                )
            }
        };
        // SAFETY: the call writes the request if it succeeds.
        unsafe { requests.start(len, receive) }?;
        Ok(receiving)
    }

    fn probe(&self, from: usize, tag: Tag) -> Result<bool, CommError> {
        let (from, mut there) = (self.known(from)?, 0);
        // SAFETY: a live communicator.
        let code =
            unsafe { ffi::MPI_Iprobe(from, tag.0 as i32, self.group.raw, &raw mut there, ffi::RSMPI_STATUS_IGNORE) };
        check(code)?;
        Ok(there != 0)
    }

    fn split(&self, color: Option<usize>, key: usize) -> Result<Option<Self>, CommError> {
        let number = |number| {
            i32::try_from(number)
                .map_err(|_| CommError::Library(format!("{number} is too large a color or key for MPI")))
        };
        let color = match color {
            Some(color) => Color::with_value(number(color)?),
            None => Color::undefined(),
        };
        let comm = self.group.comm.split_by_color_with_key(color, number(key)?);
        Ok(comm.map(|comm| Self { time_out: self.time_out, has_time_out: self.has_time_out, ..Self::of(comm) }))
    }

    fn duplicate(&self, time_out: Option<Duration>) -> Result<Self, CommError> {
        let comm = Self::of(self.group.comm.duplicate());
        // All ranks have to use the same collectives.
        let mut has_time_out = [f64::from(u8::from(time_out.is_some()))];
        comm.max(&mut has_time_out)?;
        Ok(Self { time_out, has_time_out: has_time_out[0] > 0.0, ..comm })
    }

    fn barrier(&self) -> Result<(), CommError> {
        collectives::barrier(self)
    }

    fn broadcast(&self, root: usize, message: Message) -> Result<Message, CommError> {
        collectives::broadcast(self, root, message)
    }

    fn gather(&self, root: usize, message: Message) -> Result<Option<Vec<Message>>, CommError> {
        collectives::gather(self, root, message)
    }

    fn gather_all(&self, message: Message) -> Result<Vec<Message>, CommError> {
        collectives::gather_all(self, message)
    }
}
