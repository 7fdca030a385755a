//! Processor time of a thread.

/// A time from which the calling thread has computed. Time in which the system runs other threads does not count, so that
/// the cost of an RVE does not depend on what else the cores do.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ProcessorTime(Clock);

/// The processor time of the calling thread, s.
#[cfg(unix)]
type Clock = f64;

#[cfg(unix)]
impl ProcessorTime {
    pub fn now() -> Self {
        let time = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
        Self(time.tv_sec as f64 + 1e-9 * time.tv_nsec as f64)
    }

    /// Returns the processor time since then, s.
    pub fn seconds(self) -> f64 {
        Self::now().0 - self.0
    }
}

/// Wall time, where the system has no clock for threads.
#[cfg(not(unix))]
type Clock = std::time::Instant;

#[cfg(not(unix))]
impl ProcessorTime {
    pub fn now() -> Self {
        Self(std::time::Instant::now())
    }

    /// Returns the time since then, s.
    pub fn seconds(self) -> f64 {
        self.0.elapsed().as_secs_f64()
    }
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    #[test]
    fn a_thread_that_sleeps_takes_no_time() {
        let start = ProcessorTime::now();
        std::thread::sleep(std::time::Duration::from_millis(50));
        let asleep = start.seconds();
        let mut sum = 0.0_f64;
        while start.seconds() < asleep + 2e-3 {
            sum += std::hint::black_box(1.0_f64).sqrt();
        }
        assert!(asleep < 0.02 && sum > 0.0, "{asleep}");
    }
}
