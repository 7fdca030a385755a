//! Tests of the requirements that every law must meet.

use super::*;

const E: f64 = 1.0e8;

/// `s = E ln(lambda)`, with only the method for one fiber.
#[derive(Clone, Debug)]
struct Hencky(f64);

impl FiberLaw for Hencky {
    fn name(&self) -> &str {
        "hencky"
    }

    fn parameters(&self) -> Vec<(&'static str, f64)> {
        vec![("youngs_modulus", self.0)]
    }

    fn stress(&self, stretch: f64) -> (f64, f64) {
        (self.0 * stretch.ln(), self.0 / stretch)
    }
}

fn curve() -> Table {
    let points =
        [[0.7, -2.1e7], [0.9, -8e6], [1.0, 0.0], [1.05, 6e6], [1.1, 2e7], [1.2, 6.2e7], [1.4, 6.2e7], [1.5, 7e7]];
    Table::new(points.to_vec()).unwrap()
}

#[test]
fn laws_have_the_names_and_parameters_of_the_table() {
    for formula in FormulaLaw::ALL {
        let law = formula.law(|parameter| Ok::<_, ()>(parameter.example())).unwrap();
        let parameters = formula.parameters();
        let expected: Vec<_> = parameters.iter().map(|parameter| (parameter.name, parameter.example())).collect();
        law.dispatch(&mut |law| assert_eq!((law.name(), law.parameters()), (formula.name(), expected.clone())));
        assert_eq!(law.formula(), Some((*formula, expected.iter().map(|&(_, value)| value).collect())));
        for parameter in parameters {
            let law = formula.law(|p| Ok::<_, ()>(if p == parameter { f64::NAN } else { p.example() })).unwrap();
            assert_eq!(law.check().unwrap_err().parameter, parameter.label);
        }
    }
}

/// All laws, plain and with buckling.
fn laws() -> Vec<Law> {
    let plain = [
        Law::Linear { youngs_modulus: E },
        Law::Exponential { youngs_modulus: E, nonlinearity: 1.2 },
        Law::Exponential { youngs_modulus: E, nonlinearity: 9.0 },
        Law::ExponentialStretch { youngs_modulus: E, nonlinearity: 1.2, transition: 1.1 },
        Law::ExponentialStretch { youngs_modulus: E, nonlinearity: 9.0, transition: 1.4 },
        Law::ExponentialStretch { youngs_modulus: E, nonlinearity: 9.0, transition: 1.0 },
        Law::table(curve()),
        Law::custom(Hencky(E)),
    ];
    let in_table = FormulaLaw::ALL.iter().map(|law| law.law(|parameter| Ok::<_, ()>(parameter.example())).unwrap());
    let plain: Vec<Law> = plain.into_iter().chain(in_table).collect();
    let yielding = plain
        .clone()
        .into_iter()
        .flat_map(|law| [(1e-3, 0.01), (0.0, 0.2), (1.0, 0.05)].map(|(r, w)| law.clone().with_buckling(r, w)));
    plain.iter().cloned().chain(yielding).collect()
}

/// The tested stretches: around rest, in compression, around every switch, and far from rest.
const STRETCHES: [f64; 15] =
    [0.3, 0.62, 0.75, 0.85, 0.945, 0.987, 0.9937, 0.999, 1.003, 1.031, 1.07, 1.15, 1.3, 1.43, 1.8];

#[test]
fn every_law_passes_the_check_for_authors() {
    for law in laws() {
        check(&law, 0.3..=1.8).unwrap_or_else(|error| panic!("{error}: {law:?}"));
    }
}

#[test]
fn the_slope_is_the_derivative_of_the_stress() {
    for law in laws() {
        for lambda in STRETCHES {
            let h = 1e-6;
            let difference = (law.stress(lambda + h).0 - law.stress(lambda - h).0) / (2.0 * h);
            let slope = law.stress(lambda).1;
            assert!(
                (difference - slope).abs() < 1e-7 * slope.abs().max(E),
                "{law:?} at {lambda}: {difference} {slope}"
            );
        }
    }
}

#[test]
fn the_stress_is_the_derivative_of_the_energy() {
    for law in laws() {
        for lambda in STRETCHES {
            let h = 1e-4;
            let w = |l: f64| law.energy(l);
            // Fourth order, so that the truncation stays below the tolerance.
            let difference =
                (8.0 * (w(lambda + h) - w(lambda - h)) - (w(lambda + 2.0 * h) - w(lambda - 2.0 * h))) / (12.0 * h);
            let s = law.stress(lambda).0;
            assert!((difference - s).abs() < 1e-7 * s.abs().max(0.01 * E), "{law:?} at {lambda}: {difference} {s}");
        }
    }
}

#[test]
fn every_law_is_at_rest_at_stretch_one() {
    for law in laws() {
        let (stress, slope) = law.stress(1.0);
        assert_eq!((stress, law.energy(1.0)), (0.0, 0.0), "{law:?}");
        assert!((slope / law.youngs_modulus() - 1.0).abs() < 1e-14, "{law:?}");
        assert_eq!(law.check(), Ok(()), "{law:?}");
    }
}

#[test]
fn value_and_slope_are_continuous_at_every_switch() {
    for law in laws() {
        let mut switches = vec![1.0, 0.99, 0.95, 0.8, 1.1, 1.4];
        switches.extend(curve().points().iter().map(|point| point[0]));
        for switch in switches {
            let (below, above) = (law.stress(switch * (1.0 - 1e-13)), law.stress(switch * (1.0 + 1e-13)));
            assert!((below.0 - above.0).abs() < 1e-9 * E, "{law:?} jumps at {switch}");
            assert!((below.1 - above.1).abs() < 1e-9 * above.1.abs().max(E), "the slope of {law:?} jumps at {switch}");
            let energies = law.energy(switch * (1.0 - 1e-13)) - law.energy(switch * (1.0 + 1e-13));
            assert!(energies.abs() < 1e-10 * E, "the energy of {law:?} jumps at {switch}");
        }
    }
}

#[test]
fn small_strains_lose_no_digits() {
    // s = E h + O(h^2) and W = E h^2 / 2 + O(h^3), on both sides, down to strains where a difference of large numbers
    // would be pure rounding error.
    for law in laws() {
        let e = law.youngs_modulus();
        for h in [2.0_f64.powi(-30), -2.0_f64.powi(-31), 2.0_f64.powi(-40), -2.0_f64.powi(-41)] {
            let bend = 1e3 * h.abs();
            let stress = law.stress(1.0 + h).0 / (e * h);
            assert!((stress - 1.0).abs() < bend, "{law:?} at {h:e}: {stress}");
            let energy = law.energy(1.0 + h) / (0.5 * e * h * h);
            // The adaptive quadrature of a custom law is as accurate as its stress.
            assert!((energy - 1.0).abs() < bend.max(1e-12), "{law:?} at {h:e}: {energy}");
        }
    }
}

#[test]
fn batches_agree_with_single_fibers_at_every_position() {
    let stretches: Vec<f64> = (0..131).map(|k| 0.4 + 0.01 * f64::from(k)).chain([1.0, f64::NAN]).collect();
    let n = stretches.len();
    for law in laws() {
        let (mut stress, mut slope, mut energy) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
        law.stresses(&stretches, &mut stress, &mut slope);
        law.energies(&stretches, &mut energy);
        for (k, &stretch) in stretches.iter().enumerate() {
            let (s, ds) = law.stress(stretch);
            for (batch, single) in [(stress[k], s), (slope[k], ds), (energy[k], law.energy(stretch))] {
                let same = (batch - single).abs() <= 2e-15 * single.abs() || batch.is_nan() && single.is_nan();
                assert!(same, "{law:?} at {stretch}: {batch} {single}");
            }
            // Bitwise the same result alone and in a batch.
            let (mut s, mut ds, mut w) = ([0.0], [0.0], [0.0]);
            law.stresses(&[stretch], &mut s, &mut ds);
            law.energies(&[stretch], &mut w);
            let bits = |values: [f64; 3]| values.map(f64::to_bits);
            assert_eq!(bits([s[0], ds[0], w[0]]), bits([stress[k], slope[k], energy[k]]), "{law:?} at {stretch}");
        }
        let volume: Vec<f64> = (0..n - 1).map(|k| 1.0 + f64::from(k as u16 % 7)).collect();
        let mut sum = 0.0;
        energy.iter().zip(&volume).for_each(|(w, v)| sum += w * v);
        assert_eq!(law.total_energy(&stretches[..n - 1], &volume), sum);
    }
}

#[test]
fn compression_leaves_the_requested_stiffness() {
    for law in laws().into_iter().filter(|law| matches!(law, Law::Buckling { .. })) {
        let Law::Buckling { law: inner, compression: r, buckling_strain: w } = &law else { unreachable!() };
        let e = law.youngs_modulus();
        assert!((law.stress(0.5).1 - r * e).abs() < 1e-12 * e, "{law:?}");
        assert!((law.stress(1.0 - w).0 + 0.5 * (1.0 + r) * w * e).abs() < 1e-12 * e, "{law:?}");
        assert!((law.stress(1.0 - 0.5 * w).1 - 0.5 * (1.0 + r) * e).abs() < 1e-12 * e, "half way");
        for stretch in [1.0, 1.001, 1.2, 1.7] {
            assert_eq!(law.stress(stretch), inner.stress(stretch));
            assert_eq!(law.energy(stretch), inner.energy(stretch));
        }
    }
}

#[test]
fn tables_pass_through_their_points_without_overshoot() {
    let table = curve();
    for &[stretch, stress] in table.points() {
        assert!((table.stress(stretch).0 - stress).abs() <= 1e-9 * stress.abs(), "{stretch}");
    }
    let mut before = f64::NEG_INFINITY;
    for k in 0..4000 {
        let (stress, slope) = table.stress(0.6 + f64::from(k) * 2.5e-4);
        assert!(stress >= before - 1e-7 && slope >= -1e-6, "falls at {k}");
        before = stress;
    }
    assert_eq!(table.stress(1.3).1, 0.0, "level between equal stresses");
    // Linear beyond the ends.
    assert_eq!(table.stress(1.7).1, table.stress(1.5).1);
    assert_eq!(table.stress(0.2).1, table.stress(0.7 - 1e-9).1);
    // A table of a straight line is that line.
    let line = Table::new([0.5, 0.8, 1.0, 1.3, 2.0].map(|l| [l, E * (l - 1.0)]).to_vec()).unwrap();
    for stretch in STRETCHES {
        assert!((line.stress(stretch).0 - E * (stretch - 1.0)).abs() < 1e-14 * E);
        assert!((line.energy(stretch) - 0.5 * E * (stretch - 1.0).powi(2)).abs() < 1e-14 * E);
    }
}

/// Values of `scipy.interpolate.PchipInterpolator` (SciPy 1.17) through the same points.
#[test]
fn tables_agree_with_scipy() {
    let table = curve();
    for [stretch, stress, slope, energy] in PCHIP {
        let (found, found_slope) = table.stress(stretch);
        assert!((found - stress).abs() < 1e-9 * E, "{stretch}: {found} {stress}");
        assert!((found_slope - slope).abs() < 1e-9 * E, "{stretch}: {found_slope} {slope}");
        assert!((table.energy(stretch) - energy).abs() < 1e-9 * E, "{stretch}: {energy}");
    }
}

/// Stretch, stress, slope, energy.
const PCHIP: [[f64; 4]; 11] = [
    [0.75, -1.810210755814e+07, 6.076308139535e+07, 2.401126866411e+06],
    [0.85, -1.155632267442e+07, 6.954215116279e+07, 9.108894633104e+05],
    [0.93, -5.823940803383e+06, 7.347906976744e+07, 2.139248837209e+05],
    [0.99, -9.539704016913e+05, 9.271966173362e+07, 4.815369978858e+03],
    [1.02, 2.012509090909e+06, 1.072581818182e+08, 1.982254545455e+04],
    [1.07, 1.055986086957e+07, 2.778573913043e+08, 2.973912411067e+05],
    [1.13, 3.390382608696e+07, 5.522086956522e+08, 1.543770197628e+06],
    [1.19, 6.111982608696e+07, 1.709217391304e+08, 4.508865849802e+06],
    [1.3, 6.200000000000e+07, 0.000000000000e+00, 1.132588932806e+07],
    [1.42, 6.249066666667e+07, 4.693333333333e+07, 1.876923155029e+07],
    [1.49, 6.891200000000e+07, 1.104000000000e+08, 2.334240932806e+07],
];

#[test]
fn invalid_parameters_are_reported() {
    let good = FiberMaterial { law: laws()[3].clone(), radius: 1e-7, density: None };
    assert_eq!(good.check(), Ok(()));
    let bad = FiberMaterial { radius: -1.0, ..good.clone() };
    assert_eq!(bad.check().unwrap_err().to_string(), "the radius of a fiber is -1; it must be positive and finite");
    let refused = |law: Law| FiberMaterial { law, ..good.clone() }.check().unwrap_err().parameter;
    let law = Law::ExponentialStretch { youngs_modulus: E, nonlinearity: 1.0, transition: 0.9 };
    assert_eq!(refused(law), "transition stretch");
    assert_eq!(refused(Law::Linear { youngs_modulus: f64::NAN }), "Young's modulus");
    assert_eq!(refused(good.law.clone().with_buckling(-0.1, 0.01)), "stiffness in compression");
    assert_eq!(refused(good.law.clone().with_buckling(0.1, 0.0)), "buckling strain");
    assert_eq!(refused(Law::custom(Hencky(-E))), "slope at stretch 1");
}

#[test]
fn custom_laws_are_distinguished_by_name_and_parameters() {
    assert_eq!(Law::custom(Hencky(E)), Law::custom(Hencky(E)));
    assert_ne!(Law::custom(Hencky(E)), Law::custom(Hencky(2.0 * E)));
    assert_ne!(Law::custom(Hencky(E)), Law::Linear { youngs_modulus: E });
}

/// Laws with one error each.
#[derive(Debug)]
struct InvalidLaw(fn(f64) -> (f64, f64), fn(f64) -> f64);

impl FiberLaw for InvalidLaw {
    fn name(&self) -> &str {
        "invalid"
    }

    fn parameters(&self) -> Vec<(&'static str, f64)> {
        Vec::new()
    }

    fn stress(&self, stretch: f64) -> (f64, f64) {
        self.0(stretch)
    }

    fn energy(&self, stretch: f64) -> f64 {
        self.1(stretch)
    }
}

#[test]
fn the_check_for_authors_finds_every_fault() {
    let square = |l: f64| 0.5 * (l - 1.0) * (l - 1.0);
    let error = |stress: fn(f64) -> (f64, f64), energy: fn(f64) -> f64| check(&InvalidLaw(stress, energy), 0.5..=1.5);
    assert_eq!(error(|l| (l - 1.0, 1.0), square), Ok(()));
    assert!(matches!(error(|l| (l, 1.0), square), Err(LawError::Rest(_))));
    assert!(matches!(error(|l| (1.0 - l, -1.0), square), Err(LawError::Modulus { .. })));
    assert!(matches!(error(|l| (l - 1.0, 1.0 + 1e-5 * (l - 1.0)), square), Err(LawError::Slope { .. })));
    assert!(matches!(error(|l| (l - 1.0, 1.0), |l| 1.0001 * 0.5 * (l - 1.0).powi(2)), Err(LawError::Energy { .. })));
    assert!(matches!(error(|l| (if l > 1.4 { f64::NAN } else { l - 1.0 }, 1.0), square), Err(LawError::NotFinite(_))));
    // A jump of the stress by 1e-6 of the modulus, and of the slope by a hundredth, between samples.
    let jump = error(|l| (l - 1.0 + if l > 1.234_567_8 { 1e-6 } else { 0.0 }, 1.0), square);
    assert!(matches!(jump, Err(LawError::Slope { stretch, .. }) if (stretch - 1.234_567_8).abs() < 1e-8), "{jump:?}");
    let at = 1.234_567_8;
    let kink =
        error(|l| if l > 1.234_567_8 { (l - 1.0 + 0.01 * (l - 1.234_567_8), 1.01) } else { (l - 1.0, 1.0) }, square);
    assert!(matches!(kink, Err(LawError::SlopeJump { stretch, .. }) if (stretch - at).abs() < 1e-8), "{kink:?}");
}
