//! Shares of time per column of pixels, so that a chart of any number of segments stays small.

use std::ops::Range;

use super::timeline::{Segment, Status};

/// The share of each column of pixels that each status takes, in the order of [`Status::ALL`].
#[derive(Clone, Debug, PartialEq)]
pub struct Columns(pub Vec<[f64; 4]>);

impl Columns {
    /// Returns the mean shares of some ranks in `count` columns, which divide `seconds`.
    pub fn of(ranks: &[Vec<Segment>], seconds: f64, count: usize) -> Self {
        let mut columns = vec![[0.0; 4]; count];
        let width = seconds / count as f64;
        for segment in ranks.iter().flatten() {
            let (from, to) = (segment.start / width, segment.end / width);
            let first = (from.max(0.0) as usize).min(count.saturating_sub(1));
            for (k, column) in columns.iter_mut().enumerate().skip(first) {
                if k as f64 >= to {
                    break;
                }
                let part = to.min((k + 1) as f64) - from.max(k as f64);
                column[segment.status as usize] += part.max(0.0) / ranks.len() as f64;
            }
        }
        Self(columns)
    }

    /// Returns the sum of the shares of a status and of those below it in the stack, per column, in units of which
    /// `whole` fill a column.
    pub fn levels(&self, status: Status, whole: usize) -> Vec<usize> {
        let level = |column: &[f64; 4]| {
            let sum: f64 = column[..=status as usize].iter().sum();
            ((whole as f64 * sum).round() as usize).min(whole)
        };
        self.0.iter().map(level).collect()
    }
}

/// Returns the status of a whole scale over time: idle where some rank is idle, else balancing where some rank balances,
/// else busy where the time of all ranks is recorded.
pub fn of_scale(ranks: &[Vec<Segment>]) -> Vec<Segment> {
    let mut changes: Vec<(f64, usize, isize)> = Vec::new();
    for segment in ranks.iter().flatten() {
        changes.extend([(segment.start, segment.status as usize, 1), (segment.end, segment.status as usize, -1)]);
    }
    changes.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut active = [0isize; 4];
    let mut segments: Vec<Segment> = Vec::new();
    for pair in changes.windows(2) {
        let [(start, status, change), (end, ..)] = *pair else { continue };
        active[status] += change;
        let of_all = active.iter().sum::<isize>() >= ranks.len() as isize;
        let Some(status) = summary(active, of_all).filter(|_| end > start) else { continue };
        match segments.last_mut() {
            Some(last) if last.status == status && last.end == start => last.end = end,
            _ => segments.push(Segment { start, end, status }),
        }
    }
    segments
}

/// Returns the status of a scale with so many ranks of each status; `None` if nothing is recorded of a rank and no other
/// one is idle or balances.
fn summary(active: [isize; 4], of_all: bool) -> Option<Status> {
    let some = |status: Status| active[status as usize] > 0;
    [Status::Idle, Status::Balancing].into_iter().find(|&status| some(status)).or(of_all.then_some(Status::Busy))
}

/// Returns the seconds that a scale has a status.
pub fn seconds_of(segments: &[Segment], status: Status) -> f64 {
    let of_status = segments.iter().filter(|segment| segment.status == status);
    of_status.map(|segment| segment.end - segment.start).sum()
}

/// Divides ranks into at most `most` groups of equally many neighbors; the last one may be smaller.
pub fn groups(ranks: Range<usize>, most: usize) -> Vec<Range<usize>> {
    let size = ranks.len().div_ceil(most).max(1);
    ranks.clone().step_by(size).map(|first| first..(first + size).min(ranks.end)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn segment(start: f64, end: f64, status: Status) -> Segment {
        Segment { start, end, status }
    }

    #[test]
    fn columns_have_the_shares_of_all_segments() {
        let ranks = [
            vec![segment(0.0, 1.5, Status::Busy), segment(1.5, 4.0, Status::Idle)],
            vec![segment(0.0, 2.0, Status::Busy), segment(2.0, 2.5, Status::Balancing)],
        ];
        let Columns(columns) = Columns::of(&ranks, 4.0, 4);
        assert_eq!(columns[0], [1.0, 0.0, 0.0, 0.0]);
        assert_eq!(columns[1], [0.75, 0.0, 0.0, 0.25]);
        assert_eq!(columns[2], [0.0, 0.0, 0.25, 0.5]);
        assert_eq!(columns[3], [0.0, 0.0, 0.0, 0.5]);
        let columns = Columns(columns);
        assert_eq!(columns.levels(Status::Busy, 8), [8, 6, 0, 0]);
        assert_eq!(columns.levels(Status::Idle, 8), [8, 8, 6, 4]);
    }

    #[test]
    fn a_thousand_segments_in_a_column_are_merged() {
        let status = |k: usize| if k.is_multiple_of(4) { Status::Idle } else { Status::Busy };
        let many = (0..4000).map(|k| segment(k as f64, (k + 1) as f64, status(k))).collect();
        let Columns(columns) = Columns::of(&[many], 4000.0, 4);
        assert!(columns.iter().all(|shares| (shares[0] - 0.75).abs() < 1e-9 && (shares[3] - 0.25).abs() < 1e-9));
    }

    #[test]
    fn a_scale_is_idle_where_some_rank_is() {
        let ranks = [
            vec![
                segment(0.0, 3.0, Status::Busy),
                segment(3.0, 4.0, Status::Balancing),
                segment(5.0, 6.0, Status::Busy),
            ],
            vec![
                segment(0.0, 1.0, Status::Idle),
                segment(1.0, 2.0, Status::Exchanging),
                segment(2.0, 3.0, Status::Busy),
                segment(3.0, 4.0, Status::Balancing),
            ],
        ];
        let of_scale = of_scale(&ranks);
        let expected =
            [segment(0.0, 1.0, Status::Idle), segment(1.0, 3.0, Status::Busy), segment(3.0, 4.0, Status::Balancing)];
        assert_eq!(of_scale, expected);
        assert_eq!(seconds_of(&of_scale, Status::Busy), 2.0);
    }

    #[test]
    fn ranks_are_grouped_beyond_a_number() {
        assert_eq!(groups(1..4, 32), [1..2, 2..3, 3..4]);
        assert_eq!(groups(4..70, 32).len(), 22);
        assert_eq!(groups(4..70, 32).last(), Some(&(67..70)));
        assert!(groups(0..0, 32).is_empty());
    }
}
