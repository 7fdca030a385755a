//! Messages between processes that are underway: MPI may still be reading or writing their memory.

use std::ffi::c_int;
use std::mem::MaybeUninit;
use std::ops::Range;
use std::thread;
use std::time::{Duration, Instant};

use mpi::ffi;

use super::is_over;
use crate::las::{CommError, Message, Receiving, Sending};

/// Bytes in one message of MPI, which counts them in 32 bits; longer ones go in parts.
pub(super) const PART: usize = 1 << 30;

/// How long a rank looks for a message without a nap.
const AWAKE: Duration = Duration::from_millis(20);
/// How long it naps then: little beside what it has waited.
const NAP: Duration = Duration::from_micros(50);

/// Looks for something that another rank does: first at full speed, then letting other processes of the machine work, and after
/// a while asleep most of the time, so that a rank that waits for the work of others does not take a core from them.
pub(super) fn look<T>(
    from: i32,
    time_out: Option<Duration>,
    mut find: impl FnMut() -> Result<Option<T>, CommError>,
) -> Result<T, CommError> {
    let start = Instant::now();
    let mut looks = 0_u64;
    loop {
        if let Some(found) = find()? {
            return Ok(found);
        }
        looks += 1;
        if looks < 1000 {
            continue;
        }
        let elapsed = start.elapsed();
        if let Some(waited) = time_out
            && elapsed > waited
        {
            return Err(CommError::TimeOut { from: from as usize, waited });
        }
        if elapsed > AWAKE { thread::sleep(NAP) } else { thread::yield_now() }
    }
}

/// The bytes that a receive has taken in, once it has.
fn received(request: &mut ffi::MPI_Request) -> Result<Option<usize>, CommError> {
    let (mut done, mut status, mut bytes) = (0, MaybeUninit::uninit(), 0);
    // SAFETY: a request that was started and not completed, whose memory lives; MPI forgets it once it is done.
    check(unsafe { ffi::MPI_Test(request, &raw mut done, status.as_mut_ptr()) })?;
    if done == 0 {
        return Ok(None);
    }
    // SAFETY: the status was written, since the request is done; the type is a constant of MPI.
    check(unsafe { ffi::MPI_Get_count(status.as_ptr(), ffi::RSMPI_UINT8_T, &raw mut bytes) })?;
    Ok(Some(bytes as usize))
}

/// What MPI says of a code.
pub(super) fn check(code: i32) -> Result<(), CommError> {
    if code == ffi::MPI_SUCCESS as i32 { Ok(()) } else { Err(CommError::Library(format!("MPI reports error {code}"))) }
}

/// What MPI has started and not completed.
#[derive(Debug, Default)]
pub(super) struct Requests(Vec<ffi::MPI_Request>);

impl Requests {
    /// Starts each part of a message of so many bytes. Parts of full length say that another one follows, which may be empty.
    ///
    /// # Safety
    /// `start` writes a request of MPI where it says that it succeeded, and the bytes stay where they are until all requests
    /// are completed, also where this fails.
    pub(super) unsafe fn start(
        &mut self,
        len: usize,
        mut start: impl FnMut(Range<usize>, *mut ffi::MPI_Request) -> c_int,
    ) -> Result<(), CommError> {
        for k in 0..=len / PART {
            let mut request = MaybeUninit::uninit();
            check(start(k * PART..len.min((k + 1) * PART), request.as_mut_ptr()))?;
            // SAFETY: written by the call, as the caller says.
            self.0.push(unsafe { request.assume_init() });
        }
        Ok(())
    }

    /// Waits for all.
    pub(super) fn complete(&mut self) -> Result<(), CommError> {
        let mut outcome = Ok(());
        for mut request in self.0.drain(..) {
            // SAFETY: a request that was started and not completed, whose memory lives.
            outcome = outcome.and(check(unsafe { ffi::MPI_Wait(&raw mut request, ffi::RSMPI_STATUS_IGNORE) }));
        }
        outcome
    }

    /// The same, for so long.
    fn complete_in(&mut self, to: usize, waited: Duration) -> Result<(), CommError> {
        let start = Instant::now();
        while let Some(request) = self.0.last_mut() {
            let mut done = 0;
            // SAFETY: a request that was started and not completed, whose memory lives; MPI forgets it once it is done.
            check(unsafe { ffi::MPI_Test(request, &raw mut done, ffi::RSMPI_STATUS_IGNORE) })?;
            if done != 0 {
                self.0.pop();
            } else if start.elapsed() > waited {
                return Err(CommError::NotTaken { to, waited });
            } else {
                thread::yield_now();
            }
        }
        Ok(())
    }

    /// Waits for nothing: `false` where MPI may go on reading or writing.
    fn give_up(&mut self) -> bool {
        if is_over() {
            self.0.clear();
        }
        let mut is_out = true;
        for mut request in self.0.drain(..) {
            let mut done = 0;
            // SAFETY: a request that was started and not completed; its memory lives.
            let code = unsafe { ffi::MPI_Test(&raw mut request, &raw mut done, ffi::RSMPI_STATUS_IGNORE) };
            if code != ffi::MPI_SUCCESS as i32 || done == 0 {
                is_out = false;
                // SAFETY: a live request, which MPI may complete when it likes.
                unsafe { ffi::MPI_Request_free(&raw mut request) };
            }
        }
        is_out
    }
}

/// A message that MPI may still be reading.
#[derive(Debug)]
pub struct Underway {
    pub(super) message: Message,
    pub(super) requests: Requests,
    pub(super) to: usize,
    pub(super) time_out: Option<Duration>,
}

// SAFETY: a request belongs to no thread.
unsafe impl Send for Underway {}

impl Drop for Underway {
    fn drop(&mut self) {
        // Nobody waits for it any more. Waiting here could last for ever: a rank that fails must come to the point where it
        // ends the others. What MPI may still read stays where it is.
        if !self.requests.give_up() {
            std::mem::forget(std::mem::take(&mut self.message));
        }
    }
}

impl Sending for Underway {
    fn wait(mut self) -> Result<Option<Message>, CommError> {
        match self.time_out {
            None => self.requests.complete()?,
            Some(time_out) => self.requests.complete_in(self.to, time_out)?,
        }
        Ok(Some(std::mem::take(&mut self.message)))
    }
}

/// A message into whose memory MPI may still be writing.
#[derive(Debug)]
pub struct Arriving {
    pub(super) message: Message,
    /// Those of the parts that are not there yet.
    pub(super) requests: Requests,
    pub(super) from: i32,
    pub(super) time_out: Option<Duration>,
}

// SAFETY: a request belongs to no thread.
unsafe impl Send for Arriving {}

impl Drop for Arriving {
    fn drop(&mut self) {
        let pending = if is_over() { &mut [][..] } else { &mut self.requests.0[..] };
        for request in pending {
            // SAFETY: a request that was started and not completed; where its message has come, nothing comes of this.
            unsafe { ffi::MPI_Cancel(request) };
        }
        // As for `Underway`: nothing is waited for, and memory that MPI may still write to stays where it is.
        if !self.requests.give_up() {
            std::mem::forget(std::mem::take(&mut self.message));
        }
    }
}

impl Receiving for Arriving {
    fn wait(mut self) -> Result<Message, CommError> {
        let (from, expected, mut found) = (self.from, self.message.len(), 0);
        while let Some(request) = self.requests.0.last_mut() {
            found += look(from, self.time_out, || received(request))?;
            self.requests.0.pop();
        }
        if found == expected {
            Ok(std::mem::take(&mut self.message))
        } else {
            Err(CommError::Size { from: from as usize, found, expected })
        }
    }
}
