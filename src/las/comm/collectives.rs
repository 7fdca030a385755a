//! The default implementations of the collectives. All but `agree`, which uses the collectives of the communicator, send
//! messages along a tree, whose depth grows logarithmically with the number of ranks.

use std::fmt::Display;

use super::{Comm, CommError, Disagreement, Message, Tag};

/// Returns the parent and the children of this rank in the binary tree with root `root`.
fn tree_neighbors<C: Comm>(comm: &C, root: usize) -> (Option<usize>, impl Iterator<Item = usize>) {
    let (size, position) = (comm.size(), (comm.rank() + comm.size() - root) % comm.size());
    let rank = move |position: usize| (position + root) % size;
    let parent = (position > 0).then(|| rank((position - 1) / 2));
    (parent, [2 * position + 1, 2 * position + 2].into_iter().filter(move |&child| child < size).map(rank))
}

pub(crate) fn broadcast<C: Comm>(comm: &C, root: usize, message: Message) -> Result<Message, CommError> {
    check(comm, root)?;
    let (parent, children) = tree_neighbors(comm, root);
    let message = match parent {
        Some(parent) => comm.receive(parent, Tag::COLLECTIVE)?,
        None => message,
    };
    for child in children {
        comm.send(child, Tag::COLLECTIVE, message.clone())?;
    }
    Ok(message)
}

/// Gathers along the tree: each rank forwards its own message and those of its subtree, labeled with their ranks.
pub(crate) fn gather<C: Comm>(comm: &C, root: usize, message: Message) -> Result<Option<Vec<Message>>, CommError> {
    check(comm, root)?;
    let (parent, children) = tree_neighbors(comm, root);
    let mut labeled = vec![(comm.rank() as u64, message)];
    for child in children {
        labeled.extend(unpack(&comm.receive(child, Tag::COLLECTIVE)?, child)?);
    }
    if let Some(parent) = parent {
        comm.send(parent, Tag::COLLECTIVE, pack(labeled))?;
        return Ok(None);
    }
    labeled.sort_unstable_by_key(|&(rank, _)| rank);
    Ok(Some(labeled.into_iter().map(|(_, message)| message).collect()))
}

pub(crate) fn gather_all<C: Comm>(comm: &C, message: Message) -> Result<Vec<Message>, CommError> {
    let all = gather(comm, 0, message)?;
    let joined = broadcast(comm, 0, all.map_or_else(Message::new, Message::join))?;
    let parts = joined.split().ok_or(CommError::Malformed { from: 0, found: joined.len() })?;
    Ok(parts.into_iter().map(Message::of).collect())
}

pub(crate) fn barrier<C: Comm>(comm: &C) -> Result<(), CommError> {
    gather(comm, 0, Message::new())?;
    broadcast(comm, 0, Message::new()).map(drop)
}

/// Reduces on rank 0 and broadcasts the result, so that all ranks get the same values. First every second rank takes the
/// values of its successor, then every fourth rank those of the rank two further, and so on: the same order on every
/// communicator, while no rank receives more than one message per level.
pub(super) fn reduce<C: Comm>(
    comm: &C,
    values: &mut [f64],
    mut combine: impl FnMut(&mut f64, f64),
) -> Result<(), CommError> {
    let expected = size_of_val(values);
    let values_of = |message: &Message, from: usize| match message.values::<f64>() {
        Some(found) if message.len() == expected => Ok(found.to_vec()),
        _ => Err(CommError::Size { from, found: message.len(), expected }),
    };
    let (rank, size) = (comm.rank(), comm.size());
    let mut reduced = values.to_vec();
    let distances = std::iter::successors(Some(1_usize), |distance| distance.checked_mul(2));
    for distance in distances.take_while(|&distance| distance < size) {
        if !rank.is_multiple_of(2 * distance) {
            comm.send(rank - distance, Tag::COLLECTIVE, Message::of(&reduced))?;
            break;
        }
        let from = rank + distance;
        if from < size {
            let message = comm.receive(from, Tag::COLLECTIVE)?;
            reduced.iter_mut().zip(values_of(&message, from)?).for_each(|(reduced, value)| combine(reduced, value));
        }
    }
    values.copy_from_slice(&values_of(&comm.broadcast(0, Message::of(&reduced))?, 0)?);
    Ok(())
}

pub(super) fn agree<C: Comm, T, E: Display>(comm: &C, outcome: Result<T, E>) -> Result<T, Disagreement<E>> {
    // The prefix distinguishes an empty error message from success.
    let own = match &outcome {
        Ok(_) => Message::new(),
        Err(error) => Message::text(&format!("!{error}")),
    };
    let all = comm.gather_all(own)?;
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

/// Joins labeled messages into one; the labels are its last part.
fn pack(labeled: Vec<(u64, Message)>) -> Message {
    let (labels, mut messages): (Vec<u64>, Vec<Message>) = labeled.into_iter().unzip();
    messages.push(Message::of(&labels));
    Message::join(messages)
}

fn unpack(packed: &Message, from: usize) -> Result<Vec<(u64, Message)>, CommError> {
    let invalid = || CommError::Malformed { from, found: packed.len() };
    let mut messages = packed.split().ok_or_else(invalid)?;
    let labels =
        messages.pop().and_then(|labels| bytemuck::try_cast_slice::<_, u64>(labels).ok()).ok_or_else(invalid)?;
    Ok(labels.iter().copied().zip(messages.into_iter().map(Message::of)).collect())
}
