//! A rank with several threads: a pool of work.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Returns the seconds that a rank takes for its RVEs if each of its threads takes the next one as soon as it is free.
pub fn seconds(threads: usize, rves: impl Iterator<Item = f64>) -> f64 {
    if threads <= 1 {
        return rves.sum();
    }
    // Times are not negative, so that their bits have their order.
    let mut free: BinaryHeap<Reverse<u64>> = vec![Reverse(0.0_f64.to_bits()); threads].into();
    let mut end = 0.0_f64;
    for seconds in rves {
        if let Some(mut first) = free.peek_mut() {
            let time = f64::from_bits(first.0) + seconds;
            *first = Reverse(time.to_bits());
            end = end.max(time);
        }
    }
    end
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn threads_take_the_next_rve_when_they_are_free() {
        let rves = [5.0, 4.0, 3.0, 3.0, 2.0];
        // Thread 1: 5, 3 (from 5); thread 2: 4, 3 (from 4), 2 (from 7).
        assert_eq!(seconds(2, rves.into_iter()), 9.0);
        assert_eq!(seconds(2, [2.0, 3.0, 3.0, 4.0, 5.0].into_iter()), 10.0, "the longest last");
        // 5; 4, 2; 3, 3.
        assert_eq!(seconds(3, rves.into_iter()), 6.0);
        assert_eq!((seconds(1, rves.into_iter()), seconds(8, rves.into_iter())), (17.0, 5.0));
        assert_eq!(seconds(4, std::iter::empty()), 0.0);
    }
}
