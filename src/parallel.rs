//! Loops over chunks of fixed sizes on all threads of the current rayon pool.
//!
//! The size of a chunk does not depend on the number of threads, and results come in the order of the chunks. A sum over
//! them therefore has the same bits for any number of threads. A single chunk, or a pool of one thread, runs on the
//! calling thread.

use std::cell::Cell;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

use rayon::prelude::*;

thread_local! {
    /// True inside [`alone`].
    static IS_ALONE: Cell<bool> = const { Cell::new(false) };
}

/// Returns the number of threads that the calling thread may use.
pub(crate) fn threads() -> usize {
    if IS_ALONE.get() { 1 } else { rayon::current_num_threads() }
}

/// Runs `work` on the calling thread alone. While a thread of a pool waits for others, it may begin with
/// the rest of another loop; a task that holds a lock, or that is one of many anyway, must not wait.
#[cfg(any(feature = "app", test))]
pub(crate) fn alone<R>(work: impl FnOnce() -> R) -> R {
    /// Restores the flag, also if `work` panics.
    struct Restore(bool);

    impl Drop for Restore {
        fn drop(&mut self) {
            IS_ALONE.set(self.0);
        }
    }

    let _restore = Restore(IS_ALONE.replace(true));
    work()
}

/// Calls `work` with every chunk: each thread takes the next one as soon as it is free. Returns the results in the order of the
/// chunks. If the chunks come in descending order of their cost, the threads end at about the same time.
pub(crate) fn map<I: Send, R: Send>(
    chunks: impl IntoIterator<Item = I>,
    work: impl Fn(I) -> R + Sync + Send,
) -> Vec<R> {
    // Loops instead of `collect`, which the compiler would specialize for every pair of types.
    let mut results = Vec::new();
    if threads() == 1 {
        for chunk in chunks {
            results.push(work(chunk));
        }
        return results;
    }
    let slots: Vec<Mutex<Slot<I, R>>> = chunks.into_iter().map(|chunk| Mutex::new(Slot::Chunk(chunk))).collect();
    for_each_number(slots.len(), &|number| {
        let mut slot = slots[number].lock().unwrap_or_else(PoisonError::into_inner);
        if let Slot::Chunk(chunk) = std::mem::replace(&mut *slot, Slot::Running) {
            *slot = Slot::Result(work(chunk));
        }
    });
    results.reserve_exact(slots.len());
    for slot in slots {
        if let Ok(Slot::Result(result)) = slot.into_inner() {
            results.push(result);
        }
    }
    results
}

/// What becomes of a chunk in [`map`].
enum Slot<I, R> {
    Chunk(I),
    Running,
    Result(R),
}

/// Calls `work` with each of `0..len`, on all threads: each takes the next number as soon as it is free. Rayon would divide
/// the numbers in advance into some parts per thread, and a thread that is slower than the others, because the system
/// interrupts it, would finish its last part alone. Not generic: rayon's code for one call is as long as that of a large
/// numerical kernel, and all loops over chunks share it.
fn for_each_number(len: usize, work: &(dyn Fn(usize) + Sync)) {
    if len <= 1 {
        return (0..len).for_each(work);
    }
    let next = AtomicUsize::new(0);
    let of_thread = |_| {
        let numbers = std::iter::repeat_with(|| next.fetch_add(1, Ordering::Relaxed));
        numbers.take_while(|&number| number < len).for_each(work);
    };
    (0..threads().min(len)).into_par_iter().with_max_len(1).for_each(of_thread);
}

/// Divides `values` into consecutive slices of the given lengths, the sum of which is theirs.
pub(crate) fn split<T>(mut values: &mut [T], lengths: impl IntoIterator<Item = usize>) -> Vec<&mut [T]> {
    let parts = lengths.into_iter().map(|length| {
        let (part, rest) = std::mem::take(&mut values).split_at_mut(length);
        values = rest;
        part
    });
    parts.collect()
}

/// Returns `len` copies of a value. With several threads each writes a part, because the first write to memory takes much
/// longer than later ones.
pub(crate) fn filled<T: Clone + Send + Sync>(value: T, len: usize) -> Vec<T> {
    /// The number of bytes from which the parts take longer than dividing the work.
    const LARGE: usize = 1 << 20;
    if threads() == 1 || len.saturating_mul(size_of::<T>()) < LARGE {
        return vec![value; len];
    }
    rayon::iter::repeat_n(value, len).collect()
}

/// Returns the results of `work` for `0..len`, in order.
pub(crate) fn collect<R: Send>(len: usize, work: impl Fn(usize) -> R + Sync + Send) -> Vec<R> {
    if threads() == 1 || len < LEAST_ITEMS {
        return (0..len).map(work).collect();
    }
    (0..len).into_par_iter().with_min_len(LEAST_ITEMS).map(work).collect()
}

/// Returns the results of `work` for `0..len`, in order. `placeholder` is any value; it takes the place of a result that is
/// missing until the error is found.
///
/// # Errors
/// Returns the error of the first number, in order, that has one. After an error, `work` is called again.
pub(crate) fn try_collect<R: Clone + Send + Sync, E>(
    len: usize,
    placeholder: R,
    work: impl Fn(usize) -> Result<R, E> + Sync + Send,
) -> Result<Vec<R>, E> {
    let has_failed = AtomicBool::new(false);
    if threads() > 1 && len >= LEAST_ITEMS {
        // Unlike `Result<Vec<R>, E>`, every thread writes its results where they stay.
        let all = collect(len, |number| {
            work(number).unwrap_or_else(|_| {
                has_failed.store(true, Ordering::Relaxed);
                placeholder.clone()
            })
        });
        if !has_failed.into_inner() {
            return Ok(all);
        }
    }
    (0..len).map(work).collect()
}

/// The least number of items of a task that takes less than a microsecond for each.
const LEAST_ITEMS: usize = 1024;

/// Calls `work` with every chunk.
///
/// # Errors
/// Returns the error of the first chunk, in order, that has one. Chunks after it may be skipped.
pub(crate) fn try_each<I: Send, E: Send>(
    chunks: impl IntoIterator<Item = I>,
    work: impl Fn(I) -> Result<(), E> + Sync + Send,
) -> Result<(), E> {
    let first_failed = AtomicUsize::new(usize::MAX);
    let outcomes = map(chunks.into_iter().enumerate(), |(number, chunk)| {
        if number > first_failed.load(Ordering::Relaxed) {
            return Ok(());
        }
        work(chunk).inspect_err(|_| _ = first_failed.fetch_min(number, Ordering::Relaxed))
    });
    outcomes.into_iter().collect()
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// Returns the results of `run` on pools of 1, 2 and 5 threads.
    pub(crate) fn on_pools<R: Send>(mut run: impl FnMut() -> R + Send) -> [R; 3] {
        [1, 2, 5].map(|threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(&mut run)
        })
    }

    #[test]
    fn results_come_in_order_and_the_first_error_wins() {
        for squares in on_pools(|| map(0..1000, |k| k * k)) {
            assert!(squares.iter().enumerate().all(|(k, &square)| square == k * k));
        }
        for _ in 0..20 {
            let fails_at = |k: usize| if k % 100 == 37 { Err(k) } else { Ok(()) };
            assert_eq!(on_pools(|| try_each(0..1000, fails_at)), [Err(37); 3]);
        }
        assert_eq!(on_pools(|| try_each(0..1000, |_| Ok::<(), ()>(()))), [Ok(()); 3]);
        for squares in
            on_pools(|| [collect(10_000, |k| k * k), try_collect(10_000, 0, |k| Ok::<_, ()>(k * k)).unwrap()])
        {
            assert!(squares.iter().all(|squares| squares.iter().enumerate().all(|(k, &square)| square == k * k)));
        }
        let fails_late = |k: usize| if k % 5000 == 3777 { Err(k) } else { Ok(()) };
        assert_eq!(on_pools(|| try_collect(10_000, (), fails_late)), [const { Err(3777) }; 3]);
    }

    #[test]
    fn a_thread_that_is_alone_uses_no_other() {
        let [.., on_five] = on_pools(|| {
            let of_chunk = |_| std::thread::current().id();
            let ids = alone(|| map(0..1000, of_chunk));
            (threads(), ids.iter().all(|&id| id == ids[0]))
        });
        assert_eq!(on_five, (5, true));
    }
}
