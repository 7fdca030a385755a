//! Units of couplings: their distribution over the ranks, and the calls that are rejected.

use biotissue::coupling::{
    Channel, Coupling, CouplingError, Distribution, EvenPartition, Plan, Role, ScaleError, Scales, Share, UnitId,
    WeightedPartition,
};
use biotissue::las::{Backend, Comm, Payload, Scalar, Value, VectorOps};

use super::{Outcome, first};

biotissue::payload! {
    /// The value of a unit in these tests.
    pub struct Load {
        pub unit: u64,
        pub value: f64,
    }
}

biotissue::payload! {
    /// The same fields in another order.
    struct Other {
        value: f64,
        unit: u64,
    }
}

/// Creates the scales `a` and `b`.
fn scales<C: Comm>(comm: &C, producers: usize, consumers: usize) -> Result<Scales<C>, ScaleError> {
    Scales::new(comm, &Plan::default().with("a", Share::Count(producers)).with("b", Share::Count(consumers)))
}

/// Compares with table 4.2 of W. R. Tobin, *The Adaptive Multiscale Simulation Infrastructure* (RPI 2018).
pub fn distributions_are_those_published<C: Comm>(comm: &C) -> Outcome {
    let Some(comm) = first(comm, 12)? else { return Ok(()) };
    let scales = scales(&comm, 4, 8)?;
    let counts = [125, 122, 128, 132];
    let units: Vec<UnitId> = match scales.own() {
        0 => (0..counts[scales.comm().rank()]).map(|k| 1000 * comm.rank() as u64 + k).collect(),
        _ => Vec::new(),
    };
    let table = Coupling::new(&scales, "a", "b", &units, &[], &EvenPartition)?.table()?;
    let expected: [Vec<usize>; 4] = [
        vec![64, 61, 0, 0, 0, 0, 0, 0],
        vec![0, 3, 64, 55, 0, 0, 0, 0],
        vec![0, 0, 0, 8, 63, 57, 0, 0],
        vec![0, 0, 0, 0, 0, 6, 63, 63],
    ];
    assert_eq!(table, expected);
    Ok(())
}

pub fn different_layouts_are_rejected_on_both_sides<C: Comm>(comm: &C) -> Outcome {
    if comm.size() < 2 {
        return Ok(());
    }
    let producers = comm.size() / 2;
    let scales = scales(comm, producers, comm.size() - producers)?;
    let coupling = Coupling::new(&scales, "a", "b", &[], &[], &EvenPartition)?;
    let layouts = match coupling.role() {
        Role::Producer => Channel::<Load>::new(&coupling).map(drop),
        Role::Consumer => Channel::<Other>::new(&coupling).map(drop),
    };
    let message = layouts.expect_err("the layouts differ").to_string();
    let (load, other) = ("{ unit: u64, value: f64 } (16 bytes)", "{ value: f64, unit: u64 } (16 bytes)");
    let expected = match coupling.role() {
        Role::Producer => format!("a and b exchange different data: here {load}, there {other}"),
        Role::Consumer => format!("a and b exchange different data: here {other}, there {load}"),
    };
    assert_eq!(message, expected);
    Ok(())
}

/// Each channel of a coupling is a stream of its own, also for the inverse and for units that are added.
pub fn channels_are_separate_streams<C: Comm>(comm: &C) -> Outcome {
    let Some(comm) = first(comm, 2)? else { return Ok(()) };
    let scales = scales(&comm, 1, 1)?;
    let units: &[UnitId] = if comm.rank() == 0 { &[1, 2] } else { &[] };
    let mut coupling = Coupling::new(&scales, "a", "b", units, &[], &EvenPartition)?;
    let mut first = Channel::<f64>::new(&coupling)?;
    let mut second = Channel::<f64>::new(&coupling.inverse())?;
    let mut third = Channel::<i64>::new(&coupling)?;
    match coupling.role() {
        Role::Producer => {
            first.send(&coupling, &[1.0, 2.0])?;
            third.send(&coupling, &[100, 200])?;
            let pending = second.start(&coupling, &[10.0, 20.0])?;
            second.finish(&coupling, pending)?;
            let new = coupling.add(&[3], &[], &EvenPartition)?;
            second.send(&new, &[30.0])?;
            first.send(&new, &[3.0])?;
        }
        Role::Consumer => {
            let (mut values, mut numbers) = ([0.0; 2], [0; 2]);
            let pending = second.start_receive(&coupling)?;
            third.receive(&coupling, &mut numbers)?;
            assert_eq!(numbers, [100, 200]);
            first.receive(&coupling, &mut values)?;
            assert_eq!(values, [1.0, 2.0]);
            second.finish_receive(&coupling, pending, &mut values)?;
            assert_eq!(values, [10.0, 20.0]);
            let new = coupling.reconcile_added()?;
            first.receive(&new, &mut values[..1])?;
            second.receive(&new, &mut values[1..])?;
            assert_eq!(values, [3.0, 30.0]);
        }
    }
    Ok(())
}

pub fn invalid_calls_are_errors<C: Comm>(comm: &C) -> Outcome {
    let Some(comm) = first(comm, 2)? else { return Ok(()) };
    let scales = scales(&comm, 1, 1)?;
    let units: &[UnitId] = if comm.rank() == 0 { &[1, 2] } else { &[] };
    let absent = Coupling::new(&scales, "a", "c", units, &[], &EvenPartition).map(drop);
    assert_eq!(absent, Err(CouplingError::Scale("c".into())));
    let itself = Coupling::new(&scales, "a", "a", units, &[], &EvenPartition).map(drop);
    assert_eq!(itself, Err(CouplingError::Itself("a".into())));
    if comm.rank() == 1 {
        let not_its_own = Coupling::new(&scales, "a", "b", &[1], &[], &EvenPartition).map(drop);
        assert!(matches!(not_its_own, Err(CouplingError::Role(..))), "{not_its_own:?}");
    } else {
        let too_many = Coupling::new(&scales, "a", "b", units, &[1.0; 3], &EvenPartition).map(drop);
        assert_eq!(too_many, Err(CouplingError::Weights { found: 3, units: 2 }));
    }
    let mut coupling = Coupling::new(&scales, "a", "b", units, &[], &EvenPartition)?;
    let mut channel = Channel::<f64>::new(&coupling)?;
    match coupling.role() {
        Role::Producer => {
            assert!(matches!(channel.send(&coupling, &[1.0]), Err(CouplingError::Values { found: 1, units: 2 })));
            assert!(matches!(coupling.reconcile_removed(), Err(CouplingError::Role(..))));
            assert!(matches!(coupling.remove(&[5]), Err(CouplingError::Unit(5, _))));
            assert!(matches!(coupling.add(&[2], &[], &EvenPartition), Err(CouplingError::Unit(2, _))));
            assert!(matches!(coupling.add(&[5, 5], &[], &EvenPartition), Err(CouplingError::Unit(5, _))));
        }
        Role::Consumer => {
            assert!(matches!(channel.send(&coupling, &[1.0, 2.0]), Err(CouplingError::Role(..))));
            assert!(matches!(coupling.add(&[9], &[], &EvenPartition), Err(CouplingError::Role(..))));
        }
    }
    Ok(())
}

pub fn units_that_are_added_one_by_one_are_distributed_evenly<C: Comm>(comm: &C) -> Outcome {
    let Some(comm) = first(comm, 5)? else { return Ok(()) };
    let scales = scales(&comm, 2, 3)?;
    let mut coupling = Coupling::new(&scales, "a", "b", &[], &[], &EvenPartition)?;
    for unit in 0..9 {
        match coupling.role() {
            Role::Producer => {
                let own: &[UnitId] = if unit as usize % 2 == comm.rank() { &[unit] } else { &[] };
                coupling.add(own, &[], &EvenPartition)?;
            }
            Role::Consumer => drop(coupling.reconcile_added()?),
        }
    }
    let table = coupling.table()?;
    assert!((0..3).all(|rank| table[0][rank] + table[1][rank] == 3), "{table:?}");
    Ok(())
}

pub fn three_scales_are_coupled_in_a_ring<C: Comm>(comm: &C) -> Outcome {
    let Some(comm) = first(comm, 7)? else { return Ok(()) };
    let plan = Plan::default().with("x", Share::Count(2)).with("y", Share::Count(3)).with("z", Share::Count(2));
    let scales = Scales::new(&comm, &plan)?;
    let own = scales.name(scales.own());
    for (from, to) in [("x", "y"), ("y", "z"), ("z", "x"), ("y", "x")] {
        if own != from && own != to {
            continue;
        }
        let units: Vec<UnitId> =
            if own == from { (0..5).map(|k| 10 * comm.rank() as u64 + k).collect() } else { Vec::new() };
        let coupling = Coupling::new(&scales, from, to, &units, &[], &WeightedPartition)?;
        let mut channel = Channel::<u64>::new(&coupling)?;
        match coupling.role() {
            Role::Producer => {
                let underway = channel.start(&coupling, &units)?;
                channel.finish(&coupling, underway)?;
            }
            Role::Consumer => {
                let mut found = vec![u64::MAX; coupling.units().len()];
                channel.receive(&coupling, &mut found)?;
                assert_eq!(found, coupling.units());
            }
        }
    }
    Ok(())
}

/// Two exchanges are pending at once, with some messages too long to be sent before they are received.
pub fn several_exchanges_are_pending_at_once<C: Comm>(comm: &C) -> Outcome {
    if comm.size() < 2 {
        return Ok(());
    }
    let producers = comm.size() / 2;
    let scales = scales(comm, producers, comm.size() - producers)?;
    let first = 100_000 * comm.rank() as u64;
    let units: Vec<UnitId> = if scales.own() == 0 { (first..first + 30_000).collect() } else { Vec::new() };
    let coupling = Coupling::new(&scales, "a", "b", &units, &[], &EvenPartition)?;
    let mut channel = Channel::<[u64; 2]>::new(&coupling)?;
    let values = |round: u64| coupling.units().iter().map(|&unit| [round, unit]).collect::<Vec<_>>();
    match coupling.role() {
        Role::Producer => {
            let underway = [channel.start(&coupling, &values(0))?, channel.start(&coupling, &values(1))?];
            underway.into_iter().try_for_each(|underway| channel.finish(&coupling, underway))?;
            assert!(matches!(channel.start_receive(&coupling), Err(CouplingError::Role(..))));
        }
        Role::Consumer => {
            let arriving = [channel.start_receive(&coupling)?, channel.start_receive(&coupling)?];
            for (round, arriving) in (0..).zip(arriving) {
                let mut found = vec![[u64::MAX; 2]; coupling.units().len()];
                channel.finish_receive(&coupling, arriving, &mut found)?;
                assert!(found == values(round), "round {round}");
            }
        }
    }
    Ok(())
}

/// A receive that was started for the former units is rejected, because it would not fill an array for all current
/// units.
pub fn receives_started_before_a_change_are_rejected<C: Comm>(comm: &C) -> Outcome {
    if comm.size() < 2 {
        return Ok(());
    }
    let producers = comm.size() / 2;
    let scales = scales(comm, producers, comm.size() - producers)?;
    let units = |round: u64| -> Vec<UnitId> {
        let first = 1000 * comm.rank() as u64 + 100 * round;
        if scales.own() == 0 { (first..first + 10).collect() } else { Vec::new() }
    };
    // New units are assigned to other ranks than the former ones.
    let first_and_last = |distribution: &Distribution, rank: usize, consumers: usize| {
        let to = if distribution.held.iter().all(|&held| held == 0) { 0 } else { consumers - 1 };
        vec![to; distribution.counts[rank]]
    };
    let mut coupling = Coupling::new(&scales, "a", "b", &units(0), &[], &first_and_last)?;
    let mut channel = Channel::<u64>::new(&coupling)?;
    if coupling.role() == Role::Producer {
        channel.send(&coupling, coupling.units())?;
        coupling.add(&units(1), &[], &first_and_last)?;
        return Ok(());
    }
    let had = coupling.units().len();
    let arriving = channel.start_receive(&coupling)?;
    coupling.reconcile_added()?;
    let mut found = vec![u64::MAX; coupling.units().len()];
    let refused = channel.finish_receive(&coupling, arriving, &mut found);
    if found.len() == had {
        assert!(refused.is_ok() && found == coupling.units(), "no unit was added to this rank: {refused:?}");
    } else {
        assert!(matches!(refused, Err(CouplingError::Changed { .. })), "{refused:?}");
    }
    Ok(())
}

/// Sends the local values of a backend's vector to a vector on the other scale and back, in all lanes.
#[allow(dead_code, reason = "builds without a backend do not call it")]
pub fn local_values_are_sent_from_vector_to_vector<B: Backend<Scalar: Payload>, C: Comm>(
    comm: &C,
    context: &B::Context,
) -> Outcome {
    if comm.size() < 2 {
        return Ok(());
    }
    let producers = comm.size() / 2;
    let scales = scales(comm, producers, comm.size() - producers)?;
    let first = 100 * comm.rank() as u64;
    let units: Vec<UnitId> = if scales.own() == 0 { (first..first + 20).collect() } else { Vec::new() };
    let coupling = Coupling::new(&scales, "a", "b", &units, &[], &EvenPartition)?;
    let back = coupling.inverse();
    let mut channel = Channel::<B::Scalar>::new(&coupling)?;
    let value = |unit: UnitId| B::Scalar::from_lanes(|lane| Scalar::of((unit + 10_000 * lane as u64) as f64));
    let values: Vec<B::Scalar> = coupling.units().iter().map(|&unit| value(unit)).collect();
    let mut vector = B::vector(context, values.len())?;
    match coupling.role() {
        Role::Producer => {
            vector.with_local_mut(|local| local.copy_from_slice(&values))?;
            vector.with_local(|local| channel.send(&coupling, local))??;
            vector.zero()?;
            vector.with_local_mut(|local| channel.receive(&back, local))??;
        }
        Role::Consumer => {
            vector.with_local_mut(|local| channel.receive(&coupling, local))??;
            vector.with_local(|local| channel.send(&back, local))??;
        }
    }
    assert!(vector.with_local(|local| local == values)?, "rank {}", comm.rank());
    Ok(())
}
