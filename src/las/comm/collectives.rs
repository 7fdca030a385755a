//! Collectives built from point-to-point messages along binary trees, whose depth grows logarithmically with the number
//! of ranks.

use std::fmt::Display;

use super::{Comm, CommError, Disagreement, Message, Tag};

/// Returns the parent of this rank in the binary tree with root `root`, and its children.
fn family<C: Comm>(comm: &C, root: usize) -> (Option<usize>, impl Iterator<Item = usize>) {
    let (size, place) = (comm.size(), (comm.rank() + comm.size() - root) % comm.size());
    let rank = move |place: usize| (place + root) % size;
    let above = (place > 0).then(|| rank((place - 1) / 2));
    (above, [2 * place + 1, 2 * place + 2].into_iter().filter(move |&below| below < size).map(rank))
}

pub(super) fn broadcast<C: Comm>(comm: &C, root: usize, message: Message) -> Result<Message, CommError> {
    check(comm, root)?;
    let (above, below) = family(comm, root);
    let message = match above {
        Some(above) => comm.receive(above, Tag::COLLECTIVE)?,
        None => message,
    };
    for below in below {
        comm.send(below, Tag::COLLECTIVE, message.clone())?;
    }
    Ok(message)
}

/// Gathers along the tree: each rank forwards its own message and those of its subtree, labeled with their ranks.
pub(super) fn gather<C: Comm>(comm: &C, root: usize, message: Message) -> Result<Option<Vec<Message>>, CommError> {
    check(comm, root)?;
    let (above, below) = family(comm, root);
    let mut parcels = vec![(comm.rank(), message)];
    for below in below {
        parcels.extend(unpack(&comm.receive(below, Tag::COLLECTIVE)?, below)?);
    }
    match above {
        Some(above) => {
            comm.send(above, Tag::COLLECTIVE, pack(&parcels))?;
            Ok(None)
        }
        None => {
            parcels.sort_unstable_by_key(|&(rank, _)| rank);
            Ok(Some(parcels.into_iter().map(|(_, message)| message).collect()))
        }
    }
}

pub(super) fn gather_all<C: Comm>(comm: &C, message: Message) -> Result<Vec<Message>, CommError> {
    let all = gather(comm, 0, message)?;
    let packed = all.map_or_else(Message::new, |all| pack(&all.into_iter().enumerate().collect::<Vec<_>>()));
    let packed = broadcast(comm, 0, packed)?;
    Ok(unpack(&packed, 0)?.into_iter().map(|(_, message)| message).collect())
}

pub(super) fn barrier<C: Comm>(comm: &C) -> Result<(), CommError> {
    gather(comm, 0, Message::new())?;
    broadcast(comm, 0, Message::new()).map(drop)
}

/// Reduces in the order of the ranks on rank 0 and broadcasts the result, so that all ranks get the same values.
pub(super) fn reduce<C: Comm>(
    comm: &C,
    values: &mut [f64],
    mut combine: impl FnMut(&mut f64, f64),
) -> Result<(), CommError> {
    let all = gather(comm, 0, Message::of(values))?;
    let mut reduced = Message::of(values);
    if let (Some(all), Some(reduced)) = (all, reduced.values_mut::<f64>()) {
        for (from, message) in all.iter().enumerate().skip(1) {
            let size = CommError::Size { from, found: message.len(), expected: size_of_val(values) };
            let found = message.values::<f64>().filter(|found| found.len() == values.len()).ok_or(size)?;
            reduced.iter_mut().zip(found).for_each(|(reduced, &value)| combine(reduced, value));
        }
    }
    let reduced = broadcast(comm, 0, reduced)?;
    let size = CommError::Size { from: 0, found: reduced.len(), expected: size_of_val(values) };
    values.copy_from_slice(reduced.values::<f64>().filter(|found| found.len() == values.len()).ok_or(size)?);
    Ok(())
}

pub(super) fn agree<C: Comm, T, E: Display>(comm: &C, outcome: Result<T, E>) -> Result<T, Disagreement<E>> {
    // The prefix distinguishes an empty error message from success.
    let own = match &outcome {
        Ok(_) => Message::new(),
        Err(error) => Message::text(&format!("!{error}")),
    };
    let all = gather_all(comm, own)?;
    let failed = all.iter().enumerate().find(|(_, message)| !message.is_empty());
    match (outcome, failed) {
        (Err(error), _) => Err(Disagreement::Own(error)),
        (Ok(found), None) => Ok(found),
        (Ok(_), Some((rank, message))) => {
            Err(Disagreement::Failed { rank, reason: message.to_text().chars().skip(1).collect() })
        }
    }
}

fn check<C: Comm>(comm: &C, rank: usize) -> Result<(), CommError> {
    let size = comm.size();
    if rank < size { Ok(()) } else { Err(CommError::Rank { rank, size }) }
}

/// Concatenates labeled messages: for each its rank, its length and its content, padded to eight bytes.
fn pack(parcels: &[(usize, Message)]) -> Message {
    let words: usize = parcels.iter().map(|(_, message)| 2 + message.len().div_ceil(8)).sum();
    let mut packed = Message::zeros(8 * words);
    let bytes = packed.bytes_mut();
    let mut at = 0;
    for (rank, message) in parcels {
        bytes[at..at + 8].copy_from_slice(&(*rank as u64).to_ne_bytes());
        bytes[at + 8..at + 16].copy_from_slice(&(message.len() as u64).to_ne_bytes());
        bytes[at + 16..at + 16 + message.len()].copy_from_slice(message.bytes());
        at += 16 + 8 * message.len().div_ceil(8);
    }
    packed
}

fn unpack(packed: &Message, from: usize) -> Result<Vec<(usize, Message)>, CommError> {
    let broken = || CommError::Size { from, found: packed.len(), expected: 0 };
    let mut rest = packed.bytes();
    let mut parcels = Vec::new();
    while !rest.is_empty() {
        let (rank, behind) = rest.split_first_chunk().ok_or_else(broken)?;
        let (len, behind) = behind.split_first_chunk().ok_or_else(broken)?;
        let (rank, len) = (u64::from_ne_bytes(*rank) as usize, u64::from_ne_bytes(*len) as usize);
        parcels.push((rank, Message::of(behind.get(..len).ok_or_else(broken)?)));
        rest = behind.get(8 * len.div_ceil(8)..).ok_or_else(broken)?;
    }
    Ok(parcels)
}
