//! Tests that all planners pass.

use super::*;
use crate::coupling::balance::Moves;
use crate::las::conformance::Random;

/// Calls a test with each planner and its name.
fn with_all(test: impl Fn(&str, &dyn Planner)) {
    test("greedy", &Greedy);
    test("longest first", &LongestFirst::default());
    test("longest first without staying", &LongestFirst { stay: 0.0 });
    test("diffusive", &Diffusive::default());
    #[cfg(feature = "metis")]
    test("metis", &Metis::default());
}

/// Returns `count` units of weight 1, and heavier ones such that the sum is `sum`.
fn units(count: usize, sum: usize) -> Vec<f64> {
    (0..count).map(|k| (sum / count + usize::from(k < sum % count)) as f64).collect()
}

/// Tobin 2018, table 4.2.
fn published() -> Loads {
    let counts = [64, 64, 64, 63, 63, 63, 63, 63];
    let sums = [64, 64, 64, 63, 63, 64, 227, 221];
    let weights: Vec<Vec<f64>> = counts.into_iter().zip(sums).map(|(count, sum)| units(count, sum)).collect();
    Loads::new(&weights).unwrap()
}

/// Returns random loads: most units cost about 1, some cost up to ten times as much.
fn random_loads(seed: u64, ranks: usize, units: usize) -> Loads {
    let mut random = Random::new(seed);
    let mut weight = || 1.0 + random.signed() * 0.5 + if random.below(30) == 0 { random.below(10) as f64 } else { 0.0 };
    let weights: Vec<Vec<f64>> =
        (0..ranks).map(|rank| (0..(units + 3 * (rank % 5))).map(|_| weight()).collect()).collect();
    Loads::new(&weights).unwrap()
}

/// Checks that the plan is valid, conserves every unit, and does not raise the largest load; returns max/mean.
fn check(name: &str, planner: &dyn Planner, loads: &Loads) -> f64 {
    let plan = planner.plan(loads).unwrap();
    assert_eq!(plan, planner.plan(loads).unwrap(), "{name}: the same again");
    let after = loads.after(&plan).unwrap_or_else(|error| panic!("{name}: {error}"));
    let sorted = |loads: &Loads| {
        let mut weights = loads.weights().to_vec();
        weights.sort_unstable_by(f64::total_cmp);
        weights
    };
    assert_eq!(sorted(&after), sorted(loads), "{name}");
    let (before, after) = (loads.max_over_mean(), after.max_over_mean());
    assert!(after < before || plan.is_empty(), "{name}: {before} to {after}");
    after
}

#[test]
fn the_published_coupling_is_balanced() {
    let loads = published();
    assert!((loads.max_over_mean() - 2.19).abs() < 0.005);
    with_all(|name, planner| {
        let after = check(name, planner, &loads);
        assert!(after < 1.05, "{name}: {after}");
    });
}

/// The plan moves units in the direction of the published one, table 4.3: from each rank to earlier ones only.
#[test]
fn greedy_moves_units_along_the_sequence_as_published() {
    let loads = published();
    let plan = Greedy.plan(&loads).unwrap();
    for rank in 0..8 {
        assert!(plan.of(rank).iter().all(|(to, _)| to < rank), "{plan}");
    }
    assert!(plan.of(0).is_empty() && plan.of(1).iter().next().is_some_and(|(to, units)| to == 0 && units[0] == 0));
    let mut targets = loads.rank_of_units();
    let mut at = 0;
    for (rank, units) in loads.counts().into_iter().enumerate() {
        for (to, moved) in plan.of(rank).iter() {
            moved.iter().for_each(|&unit| targets[at + unit as usize] = to as u32);
        }
        at += units;
    }
    assert!(targets.is_sorted(), "the ranks have intervals of the sequence: {targets:?}");
}

#[test]
fn greedy_reaches_the_least_largest_load_of_all_intervals() {
    for seed in 0..300 {
        let mut random = Random::new(seed);
        let (ranks, units) = (1 + random.below(4), random.below(9));
        let weights: Vec<f64> = (0..units).map(|_| random.below(9) as f64).collect();
        let mut all = vec![Vec::new(); ranks];
        // Some rank has all units, so that any other distribution is an improvement.
        all[random.below(ranks)] = weights.clone();
        let loads = Loads::new(&all).unwrap();
        let after = loads.after(&Greedy.plan(&loads).unwrap()).unwrap();
        let largest = after.sums().into_iter().fold(0.0, f64::max);
        assert!(
            (largest - least_largest(&weights, ranks)).abs() < 1e-3,
            "seed {seed}: {weights:?} on {ranks}: {after:?}"
        );
    }
}

/// Returns the least largest load of all divisions into intervals, by trying them all.
fn least_largest(weights: &[f64], ranks: usize) -> f64 {
    if ranks == 1 {
        return weights.iter().sum();
    }
    let rest = |first: usize| least_largest(&weights[first..], ranks - 1).max(weights[..first].iter().sum());
    (0..=weights.len()).map(rest).fold(f64::INFINITY, f64::min)
}

#[test]
fn random_loads_are_balanced() {
    for seed in 0..20 {
        for (ranks, units) in [(2, 3), (7, 10), (16, 50)] {
            let loads = random_loads(seed, ranks, units);
            let heaviest = loads.weights().iter().copied().fold(0.0, f64::max) * ranks as f64 / loads.total();
            with_all(|name, planner| {
                let after = check(name, planner, &loads);
                assert!(after <= (1.02 + 0.6 * heaviest).min(loads.max_over_mean()), "{name} {seed} {ranks}: {after}");
            });
        }
    }
}

#[test]
fn degenerate_loads_need_no_plan() {
    for weights in [vec![], vec![vec![]], vec![vec![], vec![]], vec![vec![0.0, 0.0], vec![]], vec![vec![5.0], vec![]]] {
        let loads = Loads::new(&weights).unwrap();
        with_all(|name, planner| assert!(planner.plan(&loads).unwrap().is_empty(), "{name}: {weights:?}"));
    }
    let one = Loads::new(&[vec![1.0, 1.0], vec![], vec![0.0]]).unwrap();
    with_all(|name, planner| assert_eq!(check(name, planner, &one), 1.5, "{name}"));
}

/// The heaviest unit sets a bound that no plan can cross.
#[test]
fn a_dominant_unit_is_left_alone() {
    let loads = Loads::new(&[vec![10.0, 1.0, 1.0], vec![1.0, 1.0], vec![1.0, 1.0]]).unwrap();
    with_all(|name, planner| {
        let after = loads.after(&planner.plan(&loads).unwrap()).unwrap();
        assert_eq!(after.sums().into_iter().fold(0.0, f64::max), 10.0, "{name}");
    });
}

#[test]
fn diffusive_moves_the_least_and_longest_first_prefers_the_present_rank() {
    let loads = random_loads(7, 32, 40);
    let moved = |planner: &dyn Planner| planner.plan(&loads).unwrap().len();
    let (diffusive, stay, textbook) =
        (moved(&Diffusive::default()), moved(&LongestFirst::default()), moved(&LongestFirst { stay: 0.0 }));
    assert!(diffusive < stay && 2 * stay < textbook, "{diffusive}, {stay}, {textbook}");
    assert!(diffusive * 4 < loads.units(), "{diffusive} of {}", loads.units());
    // Only overloaded ranks send.
    let plan = Diffusive::default().plan(&loads).unwrap();
    let mean = loads.total() / 32.0;
    for (rank, sum) in loads.sums().into_iter().enumerate() {
        assert!(sum > mean || plan.of(rank).is_empty(), "rank {rank}");
    }
    let equal = Loads::new(&[vec![1.0; 4], vec![1.0; 4], vec![2.0, 2.0]]).unwrap();
    with_all(|name, planner| assert!(planner.plan(&equal).unwrap().is_empty(), "{name}"));
}

/// Graham's bound for longest processing time first.
#[test]
fn longest_first_is_within_a_third_of_the_optimum() {
    let weights = vec![vec![7.0, 7.0, 6.0, 6.0, 5.0, 4.0, 4.0, 5.0, 4.0], vec![], vec![], vec![]];
    let loads = Loads::new(&weights).unwrap();
    let after = loads.after(&LongestFirst { stay: 0.0 }.plan(&loads).unwrap()).unwrap();
    // The classical worst case: 15 instead of 12.
    assert_eq!(after.sums().into_iter().fold(0.0, f64::max), 15.0);
}

#[test]
fn functions_are_planners() {
    let loads = Loads::new(&[vec![1.0, 1.0], vec![]]).unwrap();
    let first_unit_to_the_last_rank = |loads: &Loads| {
        let mut plan = MigrationPlan::new(loads.ranks());
        plan.set(0, Moves::default().with(&[0], loads.ranks() - 1));
        Ok(plan)
    };
    assert_eq!(first_unit_to_the_last_rank.plan(&loads).unwrap().to_string(), "0:{(0):1}");
    let wrong = |_: &Loads| Ok(MigrationPlan::new(7));
    let planned = crate::coupling::thread::run(2, |comm| plan(&comm, &wrong, &[1.0], &[]).map(drop));
    assert!(planned.is_err_and(|failed| failed.reason.contains("for 7 ranks")));
}

/// Plans for as many ranks as the largest machines have; `--nocapture` shows the times.
#[test]
fn planning_scales_to_65536_ranks() {
    let loads = random_loads(3, 65_536, 20);
    let all: [(&str, &dyn Planner); 3] =
        [("greedy", &Greedy), ("longest first", &LongestFirst::default()), ("diffusive", &Diffusive::default())];
    for (name, planner) in all {
        let start = std::time::Instant::now();
        let plan = planner.plan(&loads).unwrap();
        let seconds = start.elapsed().as_secs_f64();
        let after = loads.after(&plan).unwrap().max_over_mean();
        println!(
            "{name}: {seconds:.2} s, {} of {} units, {:.3} to {after:.3}",
            plan.len(),
            loads.units(),
            loads.max_over_mean()
        );
        assert!(after < loads.max_over_mean() && seconds < 30.0, "{name}");
    }
}
