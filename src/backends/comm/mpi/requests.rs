//! Pending messages between processes: MPI may still read or write their memory.

use std::ffi::c_int;
use std::mem::MaybeUninit;
use std::ops::Range;
use std::sync::Arc;
use std::thread;
use std::time::{Duration, Instant};

use mpi::ffi;

use super::{Group, is_over};
use crate::las::{CommError, Message, ReceiveRequest, SendRequest};

/// The largest number of bytes in one MPI message, which counts them in 32 bits; longer messages are sent in parts.
pub(super) const MAX_PART_BYTES: usize = 1 << 30;

/// The time for which a rank polls without sleeping.
const SPIN_TIME: Duration = Duration::from_millis(20);
/// The length of one sleep, which is short compared with the time already waited.
const SLEEP_TIME: Duration = Duration::from_micros(50);

/// Polls for an action of another rank: first at full speed, then yielding the core between polls, and after
/// [`SPIN_TIME`] sleeping most of the time, so that a waiting rank does not take a core from working ones.
pub(super) fn poll<T>(
    from: i32,
    time_out: Option<Duration>,
    mut find: impl FnMut() -> Result<Option<T>, CommError>,
) -> Result<T, CommError> {
    let start = Instant::now();
    let mut polls = 0_u64;
    loop {
        if let Some(found) = find()? {
            return Ok(found);
        }
        polls += 1;
        if polls < 1000 {
            continue;
        }
        let elapsed = start.elapsed();
        if let Some(waited) = time_out
            && elapsed > waited
        {
            return Err(CommError::TimeOut { from: from as usize, waited });
        }
        if elapsed > SPIN_TIME { thread::sleep(SLEEP_TIME) } else { thread::yield_now() }
    }
}

/// Tests a receive; returns the number of received bytes once it is complete.
fn received(request: &mut ffi::MPI_Request) -> Result<Option<usize>, CommError> {
    let (mut done, mut status, mut bytes) = (0, MaybeUninit::uninit(), 0);
    // SAFETY: a request that was started and not completed, whose memory is live; MPI sets it to null once it is
    // complete.
    check(unsafe { ffi::MPI_Test(request, &raw mut done, status.as_mut_ptr()) })?;
    if done == 0 {
        return Ok(None);
    }
    // SAFETY: the status was written, since the request is complete; the type is a constant of MPI.
    check(unsafe { ffi::MPI_Get_count(status.as_ptr(), ffi::RSMPI_UINT8_T, &raw mut bytes) })?;
    Ok(Some(bytes as usize))
}

/// Converts an MPI error code into a result.
pub(super) fn check(code: i32) -> Result<(), CommError> {
    if code == ffi::MPI_SUCCESS as i32 { Ok(()) } else { Err(CommError::Library(format!("MPI reports error {code}"))) }
}

/// The MPI requests that are started and not completed.
#[derive(Debug, Default)]
pub(super) struct Requests(Vec<ffi::MPI_Request>);

impl Requests {
    /// Starts each part of a message of `len` bytes. A part of full length indicates that another part follows, which
    /// may be empty.
    ///
    /// # Safety
    /// `start` writes an MPI request if it returns success, and the bytes stay in place until all requests are
    /// completed, also if this function fails.
    pub(super) unsafe fn start(
        &mut self,
        len: usize,
        mut start: impl FnMut(Range<usize>, *mut ffi::MPI_Request) -> c_int,
    ) -> Result<(), CommError> {
        for k in 0..=len / MAX_PART_BYTES {
            let mut request = MaybeUninit::uninit();
            check(start(k * MAX_PART_BYTES..len.min((k + 1) * MAX_PART_BYTES), request.as_mut_ptr()))?;
            // SAFETY: written by the call, as the caller promises.
            self.0.push(unsafe { request.assume_init() });
        }
        Ok(())
    }

    /// Waits for all requests.
    pub(super) fn complete(&mut self) -> Result<(), CommError> {
        let mut outcome = Ok(());
        for mut request in self.0.drain(..) {
            // SAFETY: a request that was started and not completed, whose memory is live.
            outcome = outcome.and(check(unsafe { ffi::MPI_Wait(&raw mut request, ffi::RSMPI_STATUS_IGNORE) }));
        }
        outcome
    }

    /// Waits for all requests, for at most `waited`.
    fn complete_in(&mut self, to: usize, waited: Duration) -> Result<(), CommError> {
        let start = Instant::now();
        while let Some(request) = self.0.last_mut() {
            let mut done = 0;
            // SAFETY: a request that was started and not completed, whose memory is live; MPI sets it to null once it
            // is complete.
            check(unsafe { ffi::MPI_Test(request, &raw mut done, ffi::RSMPI_STATUS_IGNORE) })?;
            if done != 0 {
                self.0.pop();
            } else if start.elapsed() > waited {
                return Err(CommError::SendTimeOut { to, waited });
            } else {
                thread::yield_now();
            }
        }
        Ok(())
    }

    /// Abandons all requests without waiting. Returns false if MPI may continue to read or write their memory.
    fn abandon(&mut self) -> bool {
        if is_over() {
            self.0.clear();
        }
        let mut is_out = true;
        for mut request in self.0.drain(..) {
            let mut done = 0;
            // SAFETY: a request that was started and not completed; its memory is live.
            let code = unsafe { ffi::MPI_Test(&raw mut request, &raw mut done, ffi::RSMPI_STATUS_IGNORE) };
            if code != ffi::MPI_SUCCESS as i32 || done == 0 {
                is_out = false;
                // SAFETY: a live request, which MPI may complete at any later time.
                unsafe { ffi::MPI_Request_free(&raw mut request) };
            }
        }
        is_out
    }
}

/// A message that MPI may still read.
#[derive(Debug)]
pub struct MpiSendRequest {
    pub(super) message: Message,
    pub(super) requests: Requests,
    pub(super) to: usize,
    pub(super) time_out: Option<Duration>,
}

// SAFETY: a request is not bound to a thread.
unsafe impl Send for MpiSendRequest {}

impl Drop for MpiSendRequest {
    fn drop(&mut self) {
        // No caller waits for this message any more. A failing rank drops its requests before it aborts the other
        // ranks, so waiting here could block forever. Memory that MPI may still read is leaked.
        if !self.requests.abandon() {
            std::mem::forget(std::mem::take(&mut self.message));
        }
    }
}

impl SendRequest for MpiSendRequest {
    fn wait(mut self) -> Result<Option<Message>, CommError> {
        match self.time_out {
            None => self.requests.complete()?,
            Some(time_out) => self.requests.complete_in(self.to, time_out)?,
        }
        Ok(Some(std::mem::take(&mut self.message)))
    }
}

/// A message whose memory MPI may still write.
#[derive(Debug)]
pub struct MpiReceiveRequest {
    pub(super) message: Message,
    /// The requests of the parts that have not arrived yet.
    pub(super) requests: Requests,
    pub(super) from: i32,
    pub(super) time_out: Option<Duration>,
    pub(super) group: Arc<Group>,
}

// SAFETY: a request is not bound to a thread.
unsafe impl Send for MpiReceiveRequest {}

impl Drop for MpiReceiveRequest {
    fn drop(&mut self) {
        if !self.requests.0.is_empty() {
            self.group.keep();
        }
        let pending = if is_over() { &mut [][..] } else { &mut self.requests.0[..] };
        for request in pending {
            // SAFETY: a request that was started and not completed; if its message has arrived, the call has no effect.
            unsafe { ffi::MPI_Cancel(request) };
        }
        // As for `MpiSendRequest`: this does not wait, and memory that MPI may still write is leaked.
        if !self.requests.abandon() {
            std::mem::forget(std::mem::take(&mut self.message));
        }
    }
}

impl ReceiveRequest for MpiReceiveRequest {
    fn wait(mut self) -> Result<Message, CommError> {
        let (from, expected, mut found) = (self.from, self.message.len(), 0);
        while let Some(request) = self.requests.0.last_mut() {
            found += poll(from, self.time_out, || received(request))?;
            self.requests.0.pop();
        }
        if found == expected {
            Ok(std::mem::take(&mut self.message))
        } else {
            Err(CommError::Size { from: from as usize, found, expected })
        }
    }
}
