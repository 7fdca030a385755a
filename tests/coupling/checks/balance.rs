//! Load balancing: the three phases, separately and together, and the calls that are rejected.

use biotissue::coupling::balance::{
    BalanceError, Diffusive, Greedy, Loads, LongestFirst, Migration, MigrationPlan, Moves, Origin, Planner, migrate,
    plan,
};
use biotissue::coupling::{
    Channel, Coupling, CouplingError, Distribution, EvenPartition, Plan, Role, Scales, Share, UnitId,
};
use biotissue::las::{Comm, Message};

use super::{Outcome, first};

/// Returns the scales `macro` and `micro`.
fn scales<C: Comm>(comm: &C, macros: usize, micros: usize) -> Result<Scales<C>, Box<dyn std::error::Error>> {
    let plan = Plan::default().with("macro", Share::Count(macros)).with("micro", Share::Count(micros));
    Ok(Scales::new(comm, &plan)?)
}

/// Sends the unit numbers from the producer to the consumer and back, and checks the values that arrive.
fn exchange<C: Comm>(coupling: &Coupling<C>, channel: &mut Channel<u64>) -> Result<(), CouplingError> {
    let inverse = coupling.inverse();
    let mut found = vec![u64::MAX; coupling.units().len()];
    match coupling.role() {
        Role::Producer => {
            channel.send(coupling, coupling.units())?;
            channel.receive(&inverse, &mut found)?;
        }
        Role::Consumer => {
            channel.receive(coupling, &mut found)?;
            channel.send(&inverse, coupling.units())?;
        }
    }
    assert_eq!(found, coupling.units());
    Ok(())
}

/// Checks that both sides compute the same table, and returns it.
fn same_table<C: Comm>(comm: &C, coupling: &Coupling<C>) -> Result<Vec<Vec<usize>>, Box<dyn std::error::Error>> {
    let table = coupling.table()?;
    let numbers: Vec<u64> = table.iter().flatten().map(|&count| count as u64).collect();
    let all = comm.gather_all(Message::of(&numbers))?;
    assert!(all.windows(2).all(|pair| pair[0] == pair[1]), "{table:?}");
    Ok(table)
}

/// Serializes a unit: the lengths differ, and some are zero.
fn packed(unit: UnitId) -> Message {
    Message::of(&vec![unit; (unit % 5) as usize])
}

/// Figures 4.1 to 4.3 and table 4.1 of W. R. Tobin, *The Adaptive Multiscale Simulation Infrastructure* (RPI 2018): the
/// ranks A to H of the micro scale are numbered from 0.
pub fn the_published_example_in_three_phases<C: Comm>(comm: &C) -> Outcome {
    let Some(comm) = first(comm, 12)? else { return Ok(()) };
    let scales = scales(&comm, 4, 8)?;
    let before = [5, 2, 5, 4, 4, 2, 10, 1];
    // The units of the four macro ranks in sequence fill the micro ranks.
    let in_sequence = |distribution: &Distribution, rank: usize, _: usize| {
        let to = before.iter().enumerate().flat_map(|(rank, &count)| std::iter::repeat_n(rank, count));
        to.skip(distribution.offset(rank)).take(distribution.counts[rank]).collect::<Vec<usize>>()
    };
    let counts = [9, 8, 8, 8];
    let units: Vec<UnitId> = match scales.own() {
        0 => (0..counts[comm.rank()]).map(|k| 100 * comm.rank() as u64 + k).collect(),
        _ => Vec::new(),
    };
    let mut coupling = Coupling::new(&scales, "macro", "micro", &units, &[], &in_sequence)?;
    let mut channel = Channel::<u64>::new(&coupling)?;
    exchange(&coupling, &mut channel)?;
    if coupling.role() == Role::Producer {
        coupling.reconcile_migrated()?;
        assert_eq!(coupling.units(), units, "the data of the macro scale keeps its order");
    } else {
        let published = |loads: &Loads| {
            let mut plan = MigrationPlan::new(loads.ranks());
            plan.set(0, Moves::default().with(&[4], 1));
            plan.set(2, Moves::default().with(&[3], 1));
            plan.set(6, Moves::default().with(&[2, 4], 5).with(&[3, 6, 7], 7));
            Ok(plan)
        };
        let (micro, before) = (scales.comm(), coupling.units().to_vec());
        let (loads, plan) = plan(micro, &published, &vec![1.0; before.len()], &[])?;
        assert_eq!(loads.after(&plan)?.sums(), [4.0, 4.0, 4.0, 4.0, 4.0, 4.0, 5.0, 4.0]);
        let (migration, arrived) =
            migrate(micro, plan.of(micro.rank()), &before, |index| Message::of(&[before[index]]))?;
        let origin = |rank, index| Origin { rank, index };
        let expected = match micro.rank() {
            1 => vec![origin(0, 4), origin(2, 3)],
            5 => vec![origin(6, 2), origin(6, 4)],
            7 => vec![origin(6, 3), origin(6, 6), origin(6, 7)],
            _ => Vec::new(),
        };
        assert_eq!(migration.arrived(), expected);
        let arrived = arrived.iter().map(|message| message.values::<u64>().unwrap_or_default()[0]).collect();
        let data = migration.apply(before, arrived)?;
        coupling.migrate(&migration)?;
        assert_eq!(coupling.units(), data);
    }
    exchange(&coupling, &mut channel)?;
    let table = same_table(&comm, &coupling)?;
    let counts = |micro: usize| table.iter().map(|row| row[micro]).sum::<usize>();
    assert_eq!((0..8).map(counts).collect::<Vec<_>>(), [4, 4, 4, 4, 4, 4, 5, 4]);
    Ok(())
}

/// The coupling of table 4.2 with its weights, balanced by each planner.
pub fn the_published_coupling_is_balanced<C: Comm>(comm: &C) -> Outcome {
    let Some(comm) = first(comm, 12)? else { return Ok(()) };
    let scales = scales(&comm, 4, 8)?;
    balance_published(&comm, &scales, &Greedy)?;
    balance_published(&comm, &scales, &LongestFirst::default())?;
    balance_published(&comm, &scales, &Diffusive::default())?;
    #[cfg(feature = "metis")]
    balance_published(&comm, &scales, &biotissue::coupling::balance::Metis::default())?;
    Ok(())
}

fn balance_published<C: Comm>(comm: &C, scales: &Scales<C>, planner: &impl Planner) -> Outcome {
    let counts = [125, 122, 128, 132];
    let units: Vec<UnitId> = match scales.own() {
        0 => (0..counts[comm.rank()]).map(|k| 1000 * comm.rank() as u64 + k).collect(),
        _ => Vec::new(),
    };
    let mut coupling = Coupling::new(scales, "macro", "micro", &units, &[], &EvenPartition)?;
    let mut channel = Channel::<u64>::new(&coupling)?;
    exchange(&coupling, &mut channel)?;
    if coupling.role() == Role::Producer {
        coupling.reconcile_migrated()?;
    } else {
        let (micro, before) = (scales.comm(), coupling.units().to_vec());
        let sum = [64, 64, 64, 63, 63, 64, 227, 221][micro.rank()];
        let count = before.len();
        let weights: Vec<f64> = (0..count).map(|k| (sum / count + usize::from(k < sum % count)) as f64).collect();
        let (loads, plan) = plan(micro, planner, &weights, &[])?;
        assert!((loads.max_over_mean() - 2.19).abs() < 0.005);
        let (migration, arrived) =
            migrate(micro, plan.of(micro.rank()), &before, |index| Message::of(&[weights[index]]))?;
        let arrived = arrived.iter().map(|message| message.values::<f64>().unwrap_or_default()[0]).collect();
        let weights = migration.apply(weights, arrived)?;
        coupling.migrate(&migration)?;
        let after = Loads::gather(micro, &weights, &[])?;
        assert_eq!(after, loads.after(&plan)?);
        assert!(after.max_over_mean() < 1.05 && after.total() == loads.total(), "{after:?}");
    }
    exchange(&coupling, &mut channel)?;
    let table = same_table(comm, &coupling)?;
    let rows: Vec<usize> = table.iter().map(|row| row.iter().sum()).collect();
    assert_eq!(rows, [125, 122, 128, 132]);
    Ok(())
}

/// Two couplings of the same units follow one migration: in the second one, the moved scale is the producer of some of
/// the units, in another order. The permutation of the first is handed to the user.
pub fn several_couplings_follow_one_migration<C: Comm>(comm: &C) -> Outcome {
    if comm.size() < 3 {
        return Ok(());
    }
    let macros = comm.size() / 3;
    let scales = scales(comm, macros, comm.size() - macros)?;
    let scale = scales.comm();
    let first = 100 * scale.rank() as u64;
    let units: Vec<UnitId> = if scales.own() == 0 { (first..first + 20).collect() } else { Vec::new() };
    let mut down = Coupling::new(&scales, "macro", "micro", &units, &[], &EvenPartition)?;
    let odd: Vec<UnitId> = match scales.own() {
        0 => Vec::new(),
        _ => down.units().iter().rev().copied().filter(|unit| unit % 2 == 1).collect(),
    };
    let mut up = Coupling::new(&scales, "micro", "macro", &odd, &[], &EvenPartition)?;
    let mut channels = [Channel::new(&down)?, Channel::new(&up)?];
    for round in 0..3_usize {
        if scales.own() == 0 {
            down.reconcile_migrated()?;
            up.reconcile_migrated()?;
        } else {
            let before = down.units().to_vec();
            let target = |unit: UnitId| (unit as usize * (round + 3)) % scale.size();
            let to = |moves: Moves, (index, &unit): (u32, &UnitId)| match target(unit) {
                to if to == scale.rank() => moves,
                to => moves.with(&[index], to),
            };
            let moves = (0..).zip(&before).fold(Moves::default(), to);
            let (migration, arrived) = migrate(scale, &moves, &before, |index| packed(before[index]))?;
            let former = up.units().to_vec();
            let origins = down.migrate(&migration)?;
            let stayed = migration.stayed().iter().map(|&index| Origin { rank: scale.rank(), index });
            assert!(origins.into_iter().eq(stayed.chain(migration.arrived().iter().copied())));
            let came = &down.units()[migration.stayed().len()..];
            assert!(came.iter().map(|&unit| packed(unit)).eq(arrived), "the data of the units arrived");
            let origins = up.migrate(&migration)?;
            assert!(down.units().iter().filter(|unit| *unit % 2 == 1).eq(up.units()), "the order of the data");
            for (origin, unit) in origins.iter().zip(up.units()) {
                assert!(origin.rank != scale.rank() || former[origin.index as usize] == *unit);
            }
        }
        exchange(&down, &mut channels[0])?;
        exchange(&up, &mut channels[1])?;
        let (ordered, before) = (down.units().to_vec(), up.units().to_vec());
        let order = down.take_permutation();
        assert!(order.iter().map(|&index| &ordered[index as usize]).eq(down.units()));
        assert!(down.take_permutation().is_sorted(), "it has been taken");
        let reversed: Vec<u32> = (0..before.len() as u32).rev().collect();
        up.reorder(&reversed)?;
        assert!(before.iter().rev().eq(up.units()));
        if !before.is_empty() {
            let twice = vec![0; before.len() + 1];
            assert!(matches!(up.reorder(&twice), Err(CouplingError::Permutation { .. })));
        }
        exchange(&down, &mut channels[0])?;
        exchange(&up, &mut channels[1])?;
    }
    Ok(())
}

pub fn invalid_moves_are_errors_on_all_ranks<C: Comm>(comm: &C) -> Outcome {
    let last = comm.size() - 1;
    let moves = if comm.rank() == last { Moves::default().with(&[3], 0) } else { Moves::default() };
    let announced = Migration::announce(comm, &moves, &[7, 8, 9]).map(drop);
    let migrated = migrate(comm, &moves, &[7, 8, 9], |_| Message::new()).map(drop);
    assert_eq!(announced, migrated);
    let text = "migration plan of rank";
    match migrated {
        Err(BalanceError::Plan { rank, .. }) => assert!(rank == last && comm.rank() == last),
        Err(BalanceError::Failed { rank, reason }) => assert!(rank == last && reason.starts_with(text), "{reason}"),
        other => panic!("{other:?}"),
    }
    // Nothing of it is left.
    let next = Moves::default().with(if comm.rank() < last { &[1] } else { &[] }, last);
    let migration = Migration::announce(comm, &next, &[7, 8, 9])?;
    assert_eq!(migration.stayed().len(), if comm.rank() < last { 2 } else { 3 });
    let origins: Vec<Origin> = (0..last).map(|rank| Origin { rank, index: 1 }).collect();
    assert_eq!(migration.arrived(), if comm.rank() == last { origins } else { Vec::new() });
    assert!(migration.apply(vec![0; 2], vec![0; migration.arrived().len()]).is_err());
    assert!(migration.apply(vec![0; 3], vec![0; migration.arrived().len() + 1]).is_err());
    Ok(())
}

/// A receive that was started before a migration is rejected, and so is a migration of other units.
pub fn receives_started_before_a_migration_are_rejected<C: Comm>(comm: &C) -> Outcome {
    if comm.size() < 3 {
        return Ok(());
    }
    let scales = scales(comm, 1, comm.size() - 1)?;
    let units: Vec<UnitId> = if scales.own() == 0 { (0..30).collect() } else { Vec::new() };
    let mut coupling = Coupling::new(&scales, "macro", "micro", &units, &[], &EvenPartition)?;
    let mut channel = Channel::<u64>::new(&coupling)?;
    if coupling.role() == Role::Producer {
        channel.send(&coupling, &units)?;
        coupling.reconcile_migrated()?;
        return Ok(());
    }
    let (micro, before) = (scales.comm(), coupling.units().to_vec());
    let moves = if micro.rank() == 0 { Moves::default().with(&[0], 1) } else { Moves::default() };
    let arriving = channel.start_receive(&coupling)?;
    let other = Migration::announce(micro, &moves, &[before[0], 77])?;
    assert!(matches!(coupling.migrate(&other), Err(CouplingError::Unit(..))));
    let migration = Migration::announce(micro, &moves, &before)?;
    coupling.migrate(&migration)?;
    let mut found = vec![u64::MAX; coupling.units().len()];
    let finished = channel.finish_receive(&coupling, arriving, &mut found);
    if micro.rank() < 2 {
        assert!(matches!(finished, Err(CouplingError::Changed { .. })), "{finished:?}");
    } else {
        assert!(finished.is_ok() && found == before);
    }
    Ok(())
}
