//! Parser of the share of ranks of a scale.

use super::sentence;
use crate::coupling::plan::Share;

/// Limit for numbers of ranks in a file: more than on any machine, and small enough to list them.
const MAX_RANKS: usize = 1 << 24;

/// Problem, expected input, and remedy.
pub(super) type Problem = (String, &'static str, &'static str);

/// Parses the words that follow the name of a scale.
pub(super) fn share(name: &str, rest: &[&str]) -> Result<Share, Problem> {
    match rest {
        ["ranks", spans @ ..] if !spans.is_empty() => {
            let ranks = spans.iter().map(|span| ranks(span)).collect::<Result<Vec<_>, _>>()?;
            Ok(Share::Ranks(ranks.concat()))
        }
        ["ratio", ratio] => {
            let positive = ratio.parse().ok().filter(|ratio: &f64| *ratio > 0.0 && ratio.is_finite());
            let invalid = || (format!("`{ratio}` is not a ratio"), "a positive number", "write one, such as `1.5`");
            positive.map(Share::Ratio).ok_or_else(invalid)
        }
        [count] if !["ranks", "ratio"].contains(count) => {
            let positive = count.parse().ok().filter(|count: &usize| (1..=MAX_RANKS).contains(count));
            let invalid = || {
                let what = format!("`{count}` is not a number of ranks");
                (what, "a whole number from 1 to 16777216", "write how many ranks the scale gets")
            };
            positive.map(Share::Count).ok_or_else(invalid)
        }
        _ => Err((
            format!("`{}` does not give the ranks of the scale", sentence(name, rest)),
            "`NAME COUNT`, `NAME ranks 0 1 5-7` or `NAME ratio 1.5`",
            "write one of these",
        )),
    }
}

/// Parses a rank or an inclusive range of ranks: `5` or `5-7`.
fn ranks(span: &str) -> Result<Vec<usize>, Problem> {
    let rank = |word: &str| word.parse().ok().filter(|&rank: &usize| rank < MAX_RANKS);
    let (first, last) = span.split_once('-').unwrap_or((span, span));
    match (rank(first), rank(last)) {
        (Some(first), Some(last)) if first <= last => Ok((first..=last).collect()),
        _ => Err((
            format!("`{span}` names no ranks"),
            "a rank from 0 to 16777215, such as `1`, or a span of them, such as `5-7`",
            "write numbers, the smaller one first",
        )),
    }
}
