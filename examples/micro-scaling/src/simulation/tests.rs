use std::collections::HashMap;

use biotissue::coupling::balance::{
    self, Cost, CostHistory, Diffusive, Greedy, Iterations, Predictor, Quantity, Trigger, TriggerParams, UnitLoads,
    Weights, migrate,
};
use biotissue::coupling::{Comm, Message, bytemuck, thread};
use biotissue::las::conformance::Random;

use super::totals::Part;
use super::*;
use crate::machine::MacroSolver;
use crate::recording::Recording;
use crate::replicas::{Layout, UNPERTURBED};

const STATE_BYTES: u64 = 100;

/// A case whose messages and macro scale take no time.
fn case(recording: &Recording, units: usize, ranks: usize) -> Case<'_> {
    let replicas = Replicas { recording, units, layout: Layout::Refine, perturbation: UNPERTURBED, factor: 1.0 };
    Case {
        replicas,
        ranks,
        threads: 1,
        macro_ranks: 1,
        sweeps: recording.sweeps(),
        machine: Machine { latency: 0.0, bandwidth: f64::INFINITY, core: 0.0 },
        macro_model: MacroModel { seconds: 0.0, ..MacroModel::of(MacroSolver::Direct) },
        state_bytes: STATE_BYTES,
        local: LocalSeconds::default(),
    }
}

/// Costs that drift through the RVEs, with random outliers; steps of three sweeps.
fn drifting(units: usize, sweeps: usize) -> Recording {
    let mut random = Random::new(5);
    let mut seconds = |unit: usize, sweep: usize| {
        let place = unit as f64 / units as f64 - sweep as f64 / sweeps as f64;
        let outlier = if random.below(40) == 0 { 3.0 } else { 1.0 };
        1e-2 * outlier * (2.0 + (6.0 * place).cos() + 0.1 * random.signed())
    };
    let all: Vec<Vec<f64>> = (0..sweeps).map(|sweep| (0..units).map(|unit| seconds(unit, sweep)).collect()).collect();
    Recording::of_seconds(&all, 3)
}

#[test]
fn sweeps_take_the_time_of_the_slowest_rank() {
    let recording = Recording::of_seconds(&[vec![1.0, 2.0, 3.0, 6.0], vec![4.0, 1.0, 1.0, 2.0]], 2);
    let case = case(&recording, 4, 2);
    let nothing = simulate(&case, Scheme::Nothing).unwrap();
    // Ranks 3 and 9, then 5 and 3.
    let expected = Totals { sweeps: 2, longest: 14.0, least: 6.0, mean: 10.0, bound: 10.0, ..Totals::default() };
    assert_eq!(nothing, expected);
    assert_eq!((nothing.idle_any(), nothing.idle_mean(), nothing.iteration()), (8.0 / 14.0, 4.0 / 14.0, 7.0));
    assert_eq!(nothing.largest_loss(), Part::Imbalance);
    // 6 and 3 + 2 + 1, then 4 and 2 + 1 + 1.
    let oracle = simulate(&case, Scheme::Oracle).unwrap();
    assert_eq!((oracle.longest, oracle.bound), (10.0, 10.0));
    // The largest RVE is the bound if each has a rank of its own.
    let one_each = simulate(&Case { ranks: 4, ..case }, Scheme::Nothing).unwrap();
    assert_eq!((one_each.longest, one_each.mean, one_each.bound), (10.0, 5.0, 10.0));
    assert_eq!(one_each.largest_loss(), Part::LargestRve);
}

#[test]
fn pools_of_threads_take_their_longest_rves_first() {
    let recording = Recording::of_seconds(&[vec![1.0, 2.0, 3.0, 6.0], vec![1.0, 2.0, 3.0, 6.0]], 2);
    let case = Case { threads: 2, ..case(&recording, 4, 1) };
    // In the first sweep in their order: 1 + 3 and 2 + 6. Then 6 and 3 + 2 + 1.
    let nothing = simulate(&case, Scheme::Nothing).unwrap();
    assert_eq!((nothing.longest, nothing.mean, nothing.bound), (14.0, 12.0, 12.0));
}

#[test]
fn the_text_balances_at_the_end_of_steps_by_iterations() {
    let seconds = vec![vec![6.0, 2.0, 2.0, 2.0]; 4];
    let recording = Recording::of_seconds(&seconds, 2);
    let mut sweeps = Vec::new();
    let totals = simulate_with(&case(&recording, 4, 2), Scheme::Text, |busy| sweeps.push(busy.to_vec())).unwrap();
    assert_eq!(sweeps, [vec![8.0, 4.0], vec![8.0, 4.0], vec![6.0, 6.0], vec![6.0, 6.0]]);
    assert_eq!((totals.plans, totals.migrations, totals.moved), (1, 1, 1));
}

#[test]
fn messages_and_the_macro_scale_add_to_an_iteration() {
    let recording = Recording::of_seconds(&vec![vec![6.0, 2.0, 2.0, 2.0]; 3], 1);
    let machine = Machine { latency: 1.0, bandwidth: 824.0, core: 0.0 };
    let macro_model = MacroModel { seconds: 5.0, elements: 4.0, ..MacroModel::of(MacroSolver::Direct) };
    let case = Case { machine, macro_model, ..case(&recording, 4, 2) };
    let nothing = simulate(&case, Scheme::Nothing).unwrap();
    // A command in a tree of two ranks, two messages to and two from the micro ranks, and the values of four RVEs.
    assert_eq!((nothing.exchange, nothing.solution, nothing.balancing()), (3.0 * 9.0, 3.0 * 5.0, 0.0));
    assert_eq!(nothing.iteration(), 8.0 + 9.0 + 5.0);
    let sum: f64 = nothing.parts().iter().map(|(_, seconds)| seconds).sum();
    assert!((sum - nothing.iteration()).abs() < 1e-12);
    // Two plans, one of which moves one RVE of 100 bytes. Each plan gathers 4 * 16 + 2 * 32 bytes and 2 * 8 of lengths.
    let text = simulate(&case, Scheme::Text).unwrap();
    assert!((text.planning - 2.0 * (2.0 + (128.0 + 16.0) / 824.0)).abs() < 1e-12, "{}", text.planning);
    // Outcomes and targets: lengths of 16 bytes each and one target; two messages on either rank; the macro rank.
    let expected = 2.0 + 2.0 + (32.0 + 8.0) / 824.0 + 2.0 + 100.0 / 824.0 + 2.0;
    assert!((text.synchronizing - expected).abs() < 1e-12, "{} {expected}", text.synchronizing);
}

#[test]
fn an_rve_that_does_not_exist_costs_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("costs.csv");
    let rows = "1,1,0,a,1,2\n1,1,1,a,1,2\n1,2,0,a,1,2\n2,1,0,a,1,2\n2,1,1,a,1,3\n2,1,2,b,1,4\n";
    std::fs::write(&file, format!("step,iteration,rve,network,iterations,seconds\n{rows}")).unwrap();
    let recording = Recording::read(&file).unwrap();
    for scheme in [Scheme::Nothing, Scheme::Text, Scheme::Default, Scheme::Oracle] {
        let totals = simulate(&case(&recording, 3, 1), scheme).unwrap();
        assert_eq!((totals.longest, totals.bound), (15.0, 15.0), "{scheme:?}");
    }
}

/// The seconds of all ranks in all sweeps, by ranks that are threads and exchange real messages.
fn on_threads(case: &Case, scheme: Scheme) -> Vec<Vec<f64>> {
    let of_rank = |comm: thread::ThreadComm| -> Result<Vec<Vec<f64>>, balance::BalanceError> {
        let mut units: Vec<u64> =
            Placement::even(case.replicas.units, case.ranks).of(comm.rank()).iter().map(|&unit| unit.into()).collect();
        let mut histories = vec![CostHistory::default(); units.len()];
        let mut predictor = Predictor::new(Quantity::Seconds, case.replicas.recording.networks() + 1);
        let (mut trigger, mut is_due) = (Trigger::new(TriggerParams::default()), false);
        let mut sweeps: Vec<Vec<f64>> = Vec::new();
        let mut elsewhere = HashMap::new();
        for sweep in 0..case.sweeps {
            let starts_step = sweep > 0 && case.replicas.recording.starts_step(sweep);
            let weight = |history: &CostHistory| match scheme {
                Scheme::Text => Iterations.weight(history),
                _ => predictor.weight(history),
            };
            let own: Vec<f64> = histories.iter().map(weight).collect();
            let bytes = vec![STATE_BYTES; own.len()];
            let planned = match scheme {
                Scheme::Text if starts_step => Some(balance::plan(&comm, &Greedy, &own, &bytes)?),
                Scheme::Default if is_due => {
                    let partners = vec![0; own.len()];
                    let own = UnitLoads { weights: &own, bytes: &bytes, partners: &partners };
                    Some(balance::plan_units(&comm, &Diffusive::default(), own)?)
                }
                _ => None,
            };
            if let Some((loads, plan)) = planned {
                let accepted = match scheme {
                    Scheme::Text => Some(trigger.estimate(&loads, &plan)?).filter(|_| !plan.is_empty()),
                    _ => trigger.accept(&loads, &plan, 0.0)?,
                };
                let all = comm.gather_all(Message::of(&units))?;
                for (rank, units) in all.iter().enumerate() {
                    let units = units.values::<u64>().unwrap();
                    for (to, moved) in plan.of(rank).iter() {
                        let other = if accepted.is_some() { rank } else { to };
                        elsewhere.extend(moved.iter().map(|&at| (units[at as usize], other)));
                    }
                }
                if let Some(estimate) = accepted {
                    let pack =
                        |at: usize| Message::join(vec![Message::of(&[histories[at]]), Message::of(&[units[at]])]);
                    let (migration, arrived) = migrate(&comm, plan.of(comm.rank()), &units, pack)?;
                    let unpack = |message: &Message| -> (CostHistory, u64) {
                        let parts = message.split().unwrap();
                        (bytemuck::pod_read_unaligned(parts[0]), bytemuck::pod_read_unaligned(parts[1]))
                    };
                    let (arrived, names): (Vec<CostHistory>, Vec<u64>) = arrived.iter().map(unpack).unzip();
                    histories = migration.apply(histories, arrived)?;
                    units = migration.apply(units, names)?;
                    histories.iter_mut().for_each(CostHistory::restart);
                    trigger.migrated(&loads, &plan, &estimate, 0.0);
                }
            }
            let costs: Vec<Cost> = (units.iter())
                .map(|&unit| {
                    let sample = case.replicas.sample(unit as usize, sweep).unwrap();
                    Cost { iterations: sample.iterations.into(), seconds: sample.seconds, ..Cost::default() }
                })
                .collect();
            let busy: f64 = costs.iter().map(|cost| cost.seconds).sum();
            balance::record(&comm, &mut predictor, &mut histories, &costs)?;
            let all = comm.gather_all(Message::of(&[busy]))?;
            let all: Vec<f64> = all.iter().map(|message| message.values::<f64>().unwrap()[0]).collect();
            let mut others = vec![0.0; comm.size()];
            for (unit, cost) in units.iter().zip(&costs) {
                others[elsewhere.get(unit).copied().unwrap_or(comm.rank())] += cost.seconds;
            }
            elsewhere.clear();
            comm.sum(&mut others)?;
            trigger.compare(all.iter().copied().fold(0.0, f64::max), others.into_iter().fold(0.0, f64::max));
            let (mut sum, slowest) = ([busy], all.iter().copied().fold(0.0, f64::max));
            comm.sum(&mut sum)?;
            is_due = trigger.observe(slowest, sum[0] / comm.size() as f64);
            sweeps.push(all);
        }
        Ok(sweeps)
    };
    thread::run(case.ranks, of_rank).unwrap().swap_remove(0)
}

/// Costs of which some are large in one sweep only.
fn random(units: usize, sweeps: usize) -> Recording {
    let mut random = Random::new(9);
    let mut seconds = || if random.below(10) == 0 { 5e-2 } else { 1e-2 };
    let all: Vec<Vec<f64>> = (0..sweeps).map(|_| (0..units).map(|_| seconds()).collect()).collect();
    Recording::of_seconds(&all, 3)
}

#[test]
fn simulated_ranks_decide_as_real_ones() {
    let (drifting, random) = (drifting(60, 24), random(60, 48));
    // Where sweeps are short, or costs do not persist, some plans do not pay.
    for (recording, units, ranks, factor) in
        [(&drifting, 60, 6, 1.0), (&drifting, 45, 4, 0.012), (&drifting, 130, 8, 0.012), (&random, 60, 6, 2.0)]
    {
        let mut case = case(recording, units, ranks);
        case.replicas.factor = factor;
        for scheme in [Scheme::Nothing, Scheme::Text, Scheme::Default] {
            let mut sweeps = Vec::new();
            let totals = simulate_with(&case, scheme, |busy| sweeps.push(busy.to_vec())).unwrap();
            assert_eq!(sweeps, on_threads(&case, scheme), "{scheme:?}, {units} on {ranks}");
            assert!(scheme == Scheme::Nothing || totals.migrations >= 2, "{scheme:?}: {totals:?}");
            let declines = scheme == Scheme::Default && factor != 1.0;
            assert!(!declines || totals.migrations < totals.plans, "{totals:?}");
        }
    }
}

#[test]
fn balancing_helps_and_the_oracle_is_near_the_bound() {
    let recording = drifting(600, 24);
    let case = case(&recording, 600, 16);
    let longest = |scheme| simulate(&case, scheme).unwrap().longest;
    let [nothing, default, oracle] = [Scheme::Nothing, Scheme::Default, Scheme::Oracle].map(longest);
    let bound = simulate(&case, Scheme::Nothing).unwrap().bound;
    assert!(default < 0.8 * nothing && oracle < default && bound <= oracle, "{nothing} {default} {oracle} {bound}");
    assert!(oracle < 1.02 * bound, "{oracle} {bound}");
}
