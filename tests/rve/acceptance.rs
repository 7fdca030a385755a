//! Stress, residual history, energy, orientation and modulus of a published RVE, a real collagen network.
//!
//! MuMFiM's implicit single-RVE program printed the numbers for its network `Network_2_7` (336 nodes, 635 fibers) with
//! the linear law, radius 5e-5 m, E = 1e8 Pa and no scaling. The stress of that program is the sum of `sym(x (x) T)`
//! over the boundary nodes, that is, `J sigma`; its tangent is a forward difference of this stress over the Almansi
//! strain.
use crate::support;
use crate::support::Bench;
use biotissue::backends::{dense::Dense, sparse::Sparse};
use biotissue::fiber::homogenize::Tangent;
use biotissue::fiber::orientation::{Weighting, tensor};
use biotissue::las::RealBackend;
use biotissue::tensor::cauchy;
use nalgebra::{Matrix3, SMatrix};

type Voigt = SMatrix<f64, 6, 6>;

const PAIRS: [(usize, usize); 6] = [(0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1)];

#[rustfmt::skip]
fn gradient() -> Matrix3<f64> {
    Matrix3::new(
        0.999819, -0.000293362, 0.000371752,
        0.000360323, 1.01319, 0.000355325,
        -0.000570166, 0.000635382, 0.999488,
    )
}

/// Returns the spatial modulus of the Truesdell rate, `J c_ijkl = F_jJ F_lL A_iJkL - delta_ik tau_jl`, in Voigt form.
fn truesdell(a: &Tangent, f: &Matrix3<f64>, tau: &Matrix3<f64>) -> Voigt {
    Voigt::from_fn(|m, n| {
        let ((i, j), (k, l)) = (PAIRS[m], PAIRS[n]);
        let mut sum = 0.0;
        for p in 0..3 {
            for q in 0..3 {
                sum += f[(j, p)] * f[(l, q)] * a[(3 * i + p, 3 * k + q)];
            }
        }
        sum - if i == k { tau[(j, l)] } else { 0.0 }
    })
}

/// Returns the co-rotational modulus for engineering shear strains.
fn corotational(c: &Voigt, tau: &Matrix3<f64>) -> Voigt {
    let delta = |a: usize, b: usize| if a == b { 1.0 } else { 0.0 };
    Voigt::from_fn(|m, n| {
        let ((i, j), (k, l)) = (PAIRS[m], PAIRS[n]);
        let spin = delta(i, k) * tau[(j, l)]
            + delta(i, l) * tau[(j, k)]
            + delta(j, k) * tau[(i, l)]
            + delta(j, l) * tau[(i, k)];
        c[(m, n)] + 0.5 * spin
    })
}

fn assert_published_rve<B: RealBackend<Context = ()>>() -> Option<(Matrix3<f64>, Tangent)> {
    let network = support::published("Network_2_7.txt")?;
    assert_eq!((network.nodes().len(), network.fibers().len(), network.boundary().len()), (336, 635, 261));
    assert!((network.total_length() - 170.214_164).abs() < 1e-6);

    let mut bench = Bench::<B>::new(&network, None);
    let mut rve = bench.at_rest();
    let f = gradient();
    let report = bench.solve(&mut rve, &f).unwrap();

    let recorded = [0.139_065_657, 0.029_442_537, 0.001_772_417_58, 3.707_37e-05, 8.9902e-09];
    let digits = [1e-9, 1e-9, 1e-11, 1e-10, 1e-13];
    for ((found, expected), digit) in report.newton.residuals.iter().zip(recorded).zip(digits) {
        assert!((found - expected).abs() <= digit, "residual {found:.9e}, recorded {expected:.9e}");
    }
    assert!(report.iterations <= 5 && report.cuts == 0 && report.backtracks == 0, "{report:?}");

    let pk1 = bench.pk1();
    let j = f.determinant();
    assert!((j - 1.012_488_05).abs() < 1e-8);
    let tau = cauchy(&pk1, &f) * j;
    let stress =
        [0.0916817496424, 0.280578539846, 0.0501757881148, 0.0115405853803, -0.00295307761166, -0.00765667469906];
    for ((i, k), expected) in PAIRS.into_iter().zip(stress) {
        assert!((tau[(i, k)] - expected).abs() < 1e-9 * stress[1], "stress {i}{k}: {} {expected}", tau[(i, k)]);
    }
    assert!((bench.energy() - 0.00178990511062).abs() < 1e-9 * 0.00179, "energy {}", bench.energy());

    let stretches = &bench.workspace.states().stretches;
    let (least, most) = stretches.iter().fold((f64::MAX, 0.0_f64), |(a, b), &s| (a.min(s), b.max(s)));
    assert!((least - 0.982297).abs() < 1e-6 && (most - 1.034272).abs() < 1e-6, "stretch {least} to {most}");

    let tangent = bench.tangent(&rve);
    let spatial = truesdell(&tangent, &f, &tau);
    let upper: [&[f64]; 6] = [
        &[21.872301, 7.704046, 4.537934, 0.077756, -0.229315, 0.154836],
        &[22.257559, 4.496097, 0.433146, -0.134226, -0.622475],
        &[10.9808, 0.084773, -0.052383, 0.054272],
        &[5.879265, -0.158365, -0.207675],
        &[5.697022, 0.154498],
        &[8.648249],
    ];
    for (m, row) in upper.iter().enumerate() {
        for (n, &expected) in row.iter().enumerate() {
            let found = spatial[(m, m + n)];
            assert!((found - expected).abs() < 1.01e-6, "modulus {m}{}: {found} {expected}", m + n);
        }
    }
    let recorded: [[f64; 6]; 6] = [
        [22.0569, 7.7043, 4.53813, 0.0778326, -0.232064, 0.14743],
        [7.70433, 22.8198, 4.4963, 0.444899, -0.134152, -0.629876],
        [4.53809, 4.49629, 11.0817, 0.0964603, -0.0551993, 0.0543236],
        [0.0777798, 0.444687, 0.0963028, 6.04465, -0.162193, -0.209149],
        [-0.23229, -0.134229, -0.0553321, -0.162196, 5.76795, 0.160264],
        [0.147155, -0.63016, 0.0542795, -0.209154, 0.16027, 8.83438],
    ];
    let found = corotational(&spatial, &tau);
    for m in 0..6 {
        for n in 0..6 {
            assert!(
                (found[(m, n)] - recorded[m][n]).abs() < 1e-4 * 22.8198,
                "{m}{n}: {} {}",
                found[(m, n)],
                recorded[m][n]
            );
        }
    }
    Some((pk1, tangent))
}

#[test]
fn a_published_rve_is_reproduced_and_backends_agree() {
    let Some((p_sparse, a_sparse)) = assert_published_rve::<Sparse>() else { return };
    let (p_dense, a_dense) = assert_published_rve::<Dense>().unwrap();
    assert!((p_sparse - p_dense).norm() < 1e-10 * p_dense.norm());
    assert!((a_sparse - a_dense).norm() < 1e-10 * a_dense.norm());
}

#[test]
fn the_reference_orientation_is_the_published_one() {
    let Some(network) = support::published("Network_2_7.txt") else { return };
    let mut bench = Bench::<Sparse>::new(&network, None);
    let rve = bench.at_rest();
    bench.workspace.load_state(&bench.model, &rve);
    let omega = tensor(&bench.workspace.states().directions, bench.model.truss().lengths(), Weighting::Number);
    let recorded =
        Matrix3::new(0.363266, -0.001198, 0.002267, -0.001198, 0.350693, 0.002419, 0.002267, 0.002419, 0.286041);
    assert!((omega - recorded).amax() < 6e-7, "{omega}");
}

#[test]
fn a_large_network_converges_in_ten_iterations() {
    let Some(network) = support::published("del_4450seedL5_new_1.txt") else { return };
    let mut bench = Bench::<Sparse>::new(&network, None);
    assert_eq!(bench.model.unknowns(), 13_326);
    let mut rve = bench.at_rest();
    let f = Matrix3::new(1.1, 0.05, 0.0, 0.0, 0.95, 0.02, 0.0, 0.0, 1.0);
    let report = bench.solve(&mut rve, &f).unwrap();
    assert!(report.iterations <= 10 && report.cuts == 0, "{report:?}");
    assert!(report.newton.relative.last().unwrap() <= &1e-10);
}

#[test]
fn every_network_converges_at_rest_and_near_it() {
    let names = ["Network_2_7.txt", "del_4450seedL5_new_1.txt"];
    let of_files = names.into_iter().filter_map(support::published).chain([support::frozen()]).map(|n| (n, None));
    let of_example = support::dogbone_library().into_iter().map(|n| (n, Some(support::laws()[1].clone())));
    for (network, material) in of_files.chain(of_example) {
        let mut bench = Bench::<Sparse>::new(&network, material);
        let mut rve = bench.at_rest();
        let report = bench.solve(&mut rve, &Matrix3::identity()).unwrap();
        assert_eq!((report.iterations, report.newton.relative.as_slice()), (0, [0.0].as_slice()));
        let f = Matrix3::identity() + Matrix3::new(1.0, 0.5, 0.0, 0.3, -0.4, 0.2, 0.0, 0.1, 0.6) * 1e-9;
        let report = bench.solve(&mut rve, &f).unwrap();
        assert!(report.cuts == 0 && report.iterations <= 4, "{}: {report:?}", network.name());
    }
}
