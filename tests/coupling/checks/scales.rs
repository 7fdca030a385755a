//! Checks of scales, each of which has its own ranks.

use std::time::Duration;

use biotissue::coupling::{Channel, Coupling, EvenPartition, Plan, ScaleError, Scales, Share, UnitId};
use biotissue::las::{Comm, Message};

use super::{Outcome, first};

/// Returns a plan for six ranks.
fn plan() -> Plan {
    Plan::default()
        .with("organ", Share::Count(2))
        .with("tissue", Share::Ranks(vec![5, 1]))
        .with("cells", Share::Ratio(1.0))
}

pub fn each_rank_belongs_to_one_scale_and_finds_the_others<C: Comm>(comm: &C) -> Outcome {
    let Some(comm) = first(comm, 6)? else { return Ok(()) };
    let scales = Scales::new(&comm, &plan())?;
    let own = scales.own();
    assert_eq!(scales.ranks(own)[scales.comm().rank()], comm.rank());
    assert_eq!(scales.rank_in(own, comm.rank()), Some(scales.comm().rank()));
    assert_eq!(scales.find("cells"), Some(2));
    assert_eq!(scales.find("atoms"), None);
    assert_eq!(scales.to_string(), "organ on 2 ranks, tissue on 2 ranks, cells on 2 ranks");
    let expected = [("organ", 0), ("tissue", 1), ("organ", 1), ("cells", 0), ("cells", 1), ("tissue", 0)];
    assert_eq!((scales.name(own), scales.comm().rank()), expected[comm.rank()]);
    Ok(())
}

pub fn each_scale_runs_its_own_main<C: Comm>(comm: &C) -> Outcome {
    fn sum<C: Comm>(scales: &Scales<C>) -> Result<f64, ScaleError> {
        let mut sum = [1.0];
        scales.comm().sum(&mut sum)?;
        Ok(sum[0])
    }
    let Some(comm) = first(comm, 6)? else { return Ok(()) };
    let scales = Scales::new(&comm, &plan())?;
    let cells = |scales: &Scales<C>| -> Result<f64, ScaleError> { Ok(10.0 * sum(scales)?) };
    let found = scales.run(&[("cells", &cells), ("organ", &sum::<C>), ("tissue", &sum::<C>)]);
    let expected = if scales.name(scales.own()) == "cells" { 20.0 } else { 2.0 };
    assert_eq!(found, Ok(expected));
    let found = scales.run(&[("organ", &sum::<C>), ("cells", &sum::<C>)]).map_err(|error| error.to_string());
    match scales.name(scales.own()) {
        "tissue" => assert_eq!(found, Err("scale tissue has no main function".to_owned())),
        _ => assert_eq!(found, Ok(2.0)),
    }
    Ok(())
}

pub fn a_broadcast_reaches_all_ranks_of_another_scale<C: Comm>(comm: &C) -> Outcome {
    let Some(comm) = first(comm, 6)? else { return Ok(()) };
    let scales = Scales::new(&comm, &plan())?;
    for step in 0..3_u64 {
        match scales.own() {
            0 => {
                scales.broadcast(1, Message::of(&[step]))?;
                scales.broadcast(2, Message::of(&[10 * step]))?;
            }
            own => assert_eq!(scales.receive(0)?.values(), Some(&[[0, 1, 10][own] * step][..])),
        }
    }
    Ok(())
}

pub fn a_plan_for_another_number_of_ranks_is_rejected_on_all_ranks<C: Comm>(comm: &C) -> Outcome {
    let size = comm.size();
    let plan = Plan::default().with("macro", Share::Count(1)).with("micro", Share::Count(size));
    let refused = Scales::new(comm, &plan).map(drop).map_err(|error| error.to_string());
    let sum = format!("macro 1 + micro {size} = {} ranks, but {size} were started", size + 1);
    assert_eq!(refused, Err(sum));
    Ok(())
}

/// A scale that never sends is named in the error, if there is a time-out.
pub fn a_time_out_names_the_scale_that_does_not_send<C: Comm>(comm: &C) -> Outcome {
    let Some(comm) = first(comm, 2)? else { return Ok(()) };
    let plan = Plan::default().with("asks", Share::Count(1)).with("sleeps", Share::Count(1));
    let scales = Scales::with_time_out(&comm, &plan, Some(Duration::from_millis(200)))?;
    let units: &[UnitId] = if scales.own() == 0 { &[7] } else { &[] };
    let coupling = Coupling::new(&scales, "asks", "sleeps", units, &[], &EvenPartition)?;
    let back = coupling.inverse();
    let mut channel = Channel::<f64>::new(&back)?;
    if scales.own() == 0 {
        let error = channel.receive(&back, &mut [0.0]).expect_err("no rank sends");
        assert_eq!(error.to_string(), "coupling sleeps to asks: no message from rank 1 within 0.2 s");
        let error = scales.receive(1).expect_err("no rank sends");
        assert_eq!(error.to_string(), "scale sleeps sent no message to scale asks within 0.2 s");
        assert_eq!(scales.broadcast(2, Message::new()), Err(ScaleError::Number { number: 2, scales: 2 }));
    }
    Ok(comm.barrier()?)
}
