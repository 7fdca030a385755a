//! Messages and collective operations.

use std::time::Duration;

use biotissue::las::{Comm, CommError, Disagreement, Message, SendRequest, Tag};

use super::{Outcome, first};

const TAG: Tag = Tag::of(3);

/// Returns the ranks after and before this one in a ring.
fn neighbors<C: Comm>(comm: &C) -> (usize, usize) {
    ((comm.rank() + 1) % comm.size(), (comm.rank() + comm.size() - 1) % comm.size())
}

pub fn messages_of_a_tag_arrive_in_order_independently_of_other_tags<C: Comm>(comm: &C) -> Outcome {
    let (next, last) = neighbors(comm);
    let mut sendings = Vec::new();
    for k in 0..10_u64 {
        sendings.push(comm.start_send(next, TAG, Message::of(&[k]))?);
        sendings.push(comm.start_send(next, Tag::of(4), Message::of(&[100 + k]))?);
    }
    for k in 0..10_u64 {
        assert_eq!(comm.receive(last, Tag::of(4))?.values(), Some(&[100 + k][..]));
    }
    for k in 0..10_u64 {
        assert_eq!(comm.receive(last, TAG)?.values(), Some(&[k][..]));
    }
    assert!(!comm.probe(last, TAG)?);
    for sending in sendings {
        sending.wait()?;
    }
    Ok(())
}

pub fn messages_of_any_length_arrive_complete<C: Comm>(comm: &C) -> Outcome {
    let (next, last) = neighbors(comm);
    let bytes = |rank: usize, len: usize| (0..len).map(|k| (rank + 3 * k) as u8).collect::<Vec<u8>>();
    for len in [0, 1, 7, 8, 9, 65_537, 3_000_001] {
        let sending = comm.start_send(next, TAG, Message::of(&bytes(comm.rank(), len)))?;
        let found = comm.receive(last, TAG)?;
        assert!(found.bytes() == bytes(last, len), "{len} bytes");
        sending.wait()?;
    }
    Ok(())
}

pub fn collective_operations_give_the_same_result_on_all_ranks<C: Comm>(comm: &C) -> Outcome {
    let (rank, size) = (comm.rank(), comm.size());
    // Rank 0 has an empty message, and the lengths are not multiples of eight bytes.
    for unit in [1, 10_001] {
        let of_rank = |rank: usize| Message::of(&vec![rank as u8; unit * rank]);
        let of_all: Vec<Message> = (0..size).map(of_rank).collect();
        for root in 0..size {
            assert!(comm.broadcast(root, of_rank(rank))? == of_rank(root), "root {root}");
            assert!(comm.gather(root, of_rank(rank))? == (rank == root).then(|| of_all.clone()), "root {root}");
        }
        assert!(comm.gather_all(of_rank(rank))? == of_all);
    }
    let mut values = [rank as f64, 1.0, -(rank as f64)];
    comm.sum(&mut values[..2])?;
    comm.max(&mut values[2..])?;
    assert_eq!(values, [(size * (size - 1) / 2) as f64, size as f64, 0.0]);
    let mut residual = [if rank + 1 == size / 2 { f64::NAN } else { rank as f64 }];
    comm.max(&mut residual)?;
    assert_eq!(residual[0].is_nan(), size >= 2, "NaN on one rank is NaN in the maximum");
    comm.barrier()?;
    Ok(())
}

pub fn groups_do_not_receive_messages_of_each_other<C: Comm>(comm: &C) -> Outcome {
    let color = if comm.rank() == 2 { None } else { Some(comm.rank() % 2) };
    let group = comm.split(color, 0)?;
    assert_eq!(group.is_some(), color.is_some());
    if let Some(group) = group {
        let mut ranks = [comm.rank() as f64, 1.0];
        group.sum(&mut ranks)?;
        assert_eq!(ranks[1], group.size() as f64);
        let all = group.gather_all(Message::of(&[comm.rank() as u64]))?;
        let all: Vec<u64> = all.iter().flat_map(|message| message.values::<u64>().unwrap().to_vec()).collect();
        assert!(all.is_sorted() && all.iter().all(|rank| Some((rank % 2) as usize) == color));
        assert_eq!(all[group.rank()], comm.rank() as u64);
        group.duplicate(None)?.barrier()?;
    }
    let backward = comm.split(Some(3), comm.size() - comm.rank())?;
    assert_eq!(backward.map(|group| group.rank()), Some(comm.size() - 1 - comm.rank()));
    comm.barrier()?;
    Ok(())
}

pub fn all_ranks_agree_on_the_failure_of_one<C: Comm>(comm: &C) -> Outcome {
    let own = if comm.rank() == comm.size() / 2 { Err("no convergence") } else { Ok(comm.rank()) };
    match comm.agree(own) {
        Err(Disagreement::Own(reason)) => assert_eq!((comm.rank(), reason), (comm.size() / 2, "no convergence")),
        Err(Disagreement::Failed { rank, reason }) => {
            assert_eq!((rank, reason.as_str()), (comm.size() / 2, "no convergence"));
        }
        other => panic!("{other:?}"),
    }
    assert_eq!(comm.agree(Ok::<_, String>(comm.rank())).ok(), Some(comm.rank()));
    Ok(())
}

/// Sums of numbers of different magnitudes depend on the order of the additions: pairs of ranks first, then pairs of pairs.
pub fn sums_are_along_a_fixed_tree<C: Comm>(comm: &C) -> Outcome {
    let value = |rank: usize, k: usize| 10.0_f64.powi((7 * rank + 5 * k) as i32 % 31 - 15) / 3.0;
    let mut values: Vec<f64> = (0..100).map(|k| value(comm.rank(), k)).collect();
    comm.sum(&mut values)?;
    for (k, sum) in values.into_iter().enumerate() {
        let mut expected: Vec<f64> = (0..comm.size()).map(|rank| value(rank, k)).collect();
        while expected.len() > 1 {
            expected = expected.chunks(2).map(|pair| pair.iter().copied().reduce(|a, b| a + b).unwrap()).collect();
        }
        assert_eq!(sum.to_bits(), expected[0].to_bits(), "entry {k}");
    }
    Ok(())
}

pub fn a_time_out_of_receive_names_the_sender<C: Comm>(comm: &C) -> Outcome {
    let waited = Duration::from_millis(50);
    let (from, _) = neighbors(comm);
    let error = comm.duplicate(Some(waited))?.receive(from, TAG).map(drop);
    assert_eq!(error, Err(CommError::TimeOut { from, waited }));
    comm.barrier()?;
    Ok(())
}

/// All ranks but one call `gather`, one of them without a time-out.
pub fn a_time_out_of_gather_names_the_missing_rank<C: Comm>(comm: &C) -> Outcome {
    let waited = Duration::from_millis(50);
    let Some(comm) = first(comm, 3)? else { return Ok(()) };
    let timed = comm.duplicate((comm.rank() != 2).then_some(waited))?;
    if comm.rank() == 0 {
        assert_eq!(timed.gather(0, Message::new()), Err(CommError::TimeOut { from: 1, waited }));
    } else if comm.rank() == 2 {
        assert_eq!(timed.gather(0, Message::new()), Ok(None));
    }
    comm.barrier()?;
    Ok(())
}

/// A message whose receive was given up does not arrive on a later communicator.
pub fn messages_of_abandoned_receives_do_not_arrive_elsewhere<C: Comm>(comm: &C) -> Outcome {
    // A message to this rank itself may wait for its receive.
    if comm.size() < 2 {
        return Ok(());
    }
    let (from, to) = neighbors(comm);
    for round in 0..3_u64 {
        let former = comm.duplicate(None)?;
        drop(former.start_receive(from, TAG, 8, Message::new())?);
        comm.barrier()?;
        former.send(to, TAG, Message::of(&[u64::MAX]))?;
        drop(former);
        comm.barrier()?;
        let next = comm.duplicate(None)?;
        let sending = next.start_send(to, TAG, Message::of(&[round]))?;
        assert_eq!(next.receive(from, TAG)?.values(), Some(&[round][..]));
        sending.wait()?;
        comm.barrier()?;
    }
    Ok(())
}

pub fn ranks_that_do_not_exist_are_errors<C: Comm>(comm: &C) -> Outcome {
    let (rank, size) = (comm.size(), comm.size());
    assert_eq!(comm.send(rank, TAG, Message::new()), Err(CommError::Rank { rank, size }));
    assert_eq!(comm.broadcast(rank, Message::new()), Err(CommError::Rank { rank, size }));
    Ok(())
}
