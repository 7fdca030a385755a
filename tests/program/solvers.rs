//! Runs with the linear solvers of the body.

use std::path::Path;

use biotissue::app::results::LoadRow;
use biotissue::app::results::log::{self, Event, LinearLog, NewtonLog};
use biotissue::fem::element::ElementType;
use biotissue::fem::mesh::gmsh;

use crate::hollow_box::hollow_box;
use crate::variants::{CONSTANTS, loads, logged_steps, run_every_way};
use crate::{constraints, line};

/// A cube on rollers, stretched and sheared in three steps of adapted increments.
fn case(material: &str, newton: &str) -> String {
    format!(
        r#"
        [mesh]
        generate = {{ shape = "box", cells = [7, 7, 7], size = [1.0, 1.0, 1.0] }}
        [[region]]
        name = "*"
        material = {material}
        [[boundary]]
        surface = "x0"
        symmetry = true
        [[boundary]]
        surface = "y0"
        symmetry = true
        [[boundary]]
        surface = "x1"
        displacement = {{ x = 0.3, z = 0.05 }}
        [steps]
        count = 3
        adaptive = {{ target_iterations = 3, largest = 0.5 }}
        [newton]
        tolerance = 1e-11
        {newton}
        "#
    )
}

const MULTIGRID: &str = "solver = { method = \"cg\", preconditioner = \"multigrid\" }";

#[test]
fn multigrid_gives_the_same_bits_however_the_case_runs_and_the_loads_of_the_direct_solver() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    run_every_way(folder, 3, |material| case(material, MULTIGRID));
    for step in logged_steps(folder, "formula") {
        let newton = &step.newton;
        assert!(newton.factorizations.cholesky == 0 && newton.factorizations.kept > 0, "{newton:?}");
        assert!(newton.linear_iterations > 0 && newton.linear.len() == newton.iterations, "{newton:?}");
        let solves = newton.linear.iter().chain(&newton.linear_starts);
        assert_eq!(newton.linear_iterations, solves.map(|solve| solve.iterations).sum::<usize>(), "{newton:?}");
        assert!(newton.linear_starts.len() >= step.increments, "{newton:?}");
        assert_eq!(newton.fallbacks, 0);
        // No system is solved further than Newton's method needs.
        assert!(newton.linear.iter().any(|solve| solve.residual > 1e-4), "{:?}", newton.linear);
    }
    let material = "{ model = \"neo-hookean\", shear_modulus = 1000.0, poisson_ratio = 0.3 }";
    std::fs::write(folder.join("direct.toml"), case(material, "solver = \"direct\"")).unwrap();
    line(folder, "run direct.toml --out direct").done();
    assert_same_loads(folder, "formula", "direct");
}

/// A check finds what the run would find before its first step.
#[cfg(feature = "dense")]
#[test]
fn a_check_refuses_a_solver_that_the_backend_does_not_have() {
    let folder = tempfile::tempdir().unwrap();
    let material = "{ model = \"neo-hookean\", shear_modulus = 1000.0, poisson_ratio = 0.3 }";
    std::fs::write(folder.path().join("case.toml"), case(material, MULTIGRID)).unwrap();
    for command in ["check", "run"] {
        let outcome = line(folder.path(), &format!("{command} case.toml --backend dense"));
        let message = outcome.failed(2);
        assert!(message.contains("the backend `dense` has no incomplete factorization or multigrid"), "{message}");
    }
    line(folder.path(), "check case.toml").done();
}

/// Checks that forces, moments and pressures agree to 1e-9 of the largest force, moment and pressure of the run.
fn assert_same_loads(folder: &Path, found: &str, exact: &str) {
    let (found, exact) = (loads(folder, found), loads(folder, exact));
    assert_eq!((found.rows.len(), &found.names), (exact.rows.len(), &exact.names));
    let kinds: [fn(&LoadRow) -> Vec<f64>; 3] = [
        |row| row.surfaces.iter().flat_map(|surface| surface.force).collect(),
        |row| row.rigid.iter().flat_map(|rigid| rigid.moment).collect(),
        |row| row.pressures.clone(),
    ];
    for kind in kinds {
        let largest = exact.rows.iter().flat_map(kind).fold(0.0, |most: f64, value| most.max(value.abs()));
        for (found, exact) in found.rows.iter().zip(&exact.rows) {
            let (found, exact) = (kind(found), kind(exact));
            let close = found.iter().zip(&exact).all(|(found, exact)| (found - exact).abs() <= 1e-9 * largest);
            assert!(close, "{found:?} {exact:?}");
        }
    }
}

/// Solves a case, whose last table is `[newton]`, by a Krylov method with multigrid and by the direct solver, which have to
/// find the same loads.
fn compare_with_direct(folder: &Path, case: &str, krylov: &str) {
    let solvers = [("multigrid", MULTIGRID.replace("cg", krylov)), ("direct", "solver = \"direct\"".into())];
    for (name, solver) in &solvers {
        std::fs::write(folder.join(format!("{name}.toml")), format!("{case}tolerance = 1e-11\n{solver}\n")).unwrap();
        line(folder, &format!("run {name}.toml --out {name}")).done();
    }
    assert_same_loads(folder, "multigrid", "direct");
    for step in logged_steps(folder, "multigrid") {
        let newton = &step.newton;
        let factorizations = newton.factorizations;
        let by_iterations = factorizations.approximate + factorizations.kept > 0 && newton.linear_iterations > 0;
        assert!(by_iterations && newton.fallbacks == 0, "{case}: {newton:?}");
        assert_eq!(factorizations.lu + factorizations.ldlt + factorizations.cholesky, 0);
        // Without multigrid there would be hundreds.
        assert!(newton.linear.iter().all(|solve| solve.iterations <= 100), "{case}: {newton:?}");
    }
}

#[test]
fn gmres_with_multigrid_solves_unsymmetric_systems() {
    let folder = tempfile::tempdir().unwrap();
    for (f_bar, pressure) in [(true, 0.0), (false, 100.0), (true, 100.0)] {
        let case = format!(
            r#"
            [mesh]
            generate = {{ shape = "box", cells = [6, 6, 6], size = [1.0, 1.0, 1.0] }}
            [[region]]
            name = "*"
            material = {{ model = "neo-hookean", shear_modulus = 1000.0, poisson_ratio = 0.45 }}
            f_bar = {f_bar}
            [[boundary]]
            surface = "x0"
            displacement = {{ x = 0.0, y = 0.0, z = 0.0 }}
            [[boundary]]
            surface = "x1"
            displacement = {{ x = 0.2, z = 0.05 }}
            [[boundary]]
            surface = "y1"
            pressure = {pressure}
            [steps]
            count = 2
            [newton]
            "#
        );
        compare_with_direct(folder.path(), &case, "gmres");
        let factorizations = logged_steps(folder.path(), "direct")[0].newton.factorizations;
        assert!(factorizations.lu > 0, "the matrix is unsymmetric: {factorizations:?}");
    }
}

#[test]
fn multigrid_solves_with_rigid_surfaces_and_inclined_planes() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let material = format!("{{ {CONSTANTS} }}");
    let generate = "generate = { shape = \"box\", cells = [10, 6, 6], size = [1.0, 0.5, 0.5] }";
    let twisted = crate::loads::twisted(&material, generate).replace("count = 4", "count = 2");
    crate::loads::write_inclined_box(folder, [9, 6, 6]);
    for (text, krylov) in [(twisted, "gmres"), (crate::loads::inclined(&material), "cg")] {
        compare_with_direct(folder, &(text + "[newton]\n"), krylov);
    }
}

/// Multipliers border the matrix with the gradients of the volumes.
#[test]
fn multigrid_solves_with_constrained_volumes() {
    let folder = tempfile::tempdir().unwrap();
    gmsh::write(&folder.path().join("hollow.msh"), &hollow_box(ElementType::Hex27)).unwrap();
    for method in ["", "method = \"penalty\""] {
        let case = constraints::formula(method, "").replace(", y = 0.8", "");
        compare_with_direct(folder.path(), &case, "gmres");
    }
}

#[test]
fn runs_with_multigrid_have_the_same_bits_on_any_number_of_threads() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    // The nodes fill more than one chunk of the smoother.
    let text = case(&format!("{{ {CONSTANTS} }}"), MULTIGRID).replace("[7, 7, 7]", "[16, 16, 16]");
    let text =
        text.replace("count = 3", "count = 1").replace("largest = 0.5", "largest = 1.0").replace("1e-11", "1e-8");
    std::fs::write(folder.join("case.toml"), text + "[output]\npoints = true\n").unwrap();
    let [one, two, five] = [1, 2, 5].map(|threads| {
        let out = format!("threads-{threads}");
        let run = line(folder, &format!("run case.toml --threads {threads} --out {out} --progress 0.01"));
        run.done();
        let newton = &logged_steps(folder, &out)[0].newton;
        assert!(newton.linear_iterations > 10, "{newton:?}");
        check_progress(&run.stderr, newton);
        let read = |name: &str| std::fs::read(folder.join(&out).join(name)).unwrap();
        ["loads.csv", "fields-00001.vtu", "points-00001.vtu"].map(read)
    });
    assert!(one == two && one == five, "loads, fields and points");
}

/// Checks that a line within the step names the residual and the linear solution of the iteration before, as the log does.
fn check_progress(stderr: &str, newton: &NewtonLog) {
    let of_iteration = |(k, solve): (usize, &LinearLog)| {
        format!(
            "step 1/1 to t = 1.0000: iteration {}, residual {:.1e}, linear solver {} iterations to {:.0e}, ",
            k + 2,
            newton.relative[k + 1],
            solve.iterations,
            solve.residual
        )
    };
    let lines: Vec<String> = newton.linear.iter().enumerate().map(of_iteration).collect();
    assert!(stderr.lines().any(|line| lines.iter().any(|start| line.starts_with(start))), "{lines:?}: {stderr}");
}

/// A flat body of nearly flat elements, whose matrix is unsymmetric.
#[test]
fn a_direct_solver_replaces_iterations_that_fail_and_the_run_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let text = format!(
        r#"
        [mesh]
        generate = {{ shape = "box", cells = [9, 9, 9], size = [1.0, 1.0, 0.01] }}
        [[region]]
        name = "*"
        material = {{ {CONSTANTS} }}
        f_bar = true
        [[boundary]]
        surface = "x0"
        displacement = {{ x = 0.0, y = 0.0, z = 0.0 }}
        [[boundary]]
        surface = "x1"
        displacement = {{ x = -0.1, y = 0.0, z = 0.0 }}
        [steps]
        count = 1
        [newton]
        "#
    );
    std::fs::write(folder.join("auto.toml"), &text).unwrap();
    std::fs::write(folder.join("direct.toml"), format!("{text}solver = \"direct\"\n")).unwrap();
    let run = line(folder, "run auto.toml --out auto");
    run.done();
    assert!(run.stderr.contains("linear solver: GMRES with multigrid: estimated "), "{}", run.stderr);
    let [step] = &logged_steps(folder, "auto")[..] else { panic!("one step") };
    let newton = &step.newton;
    assert!(newton.fallbacks == 1 && newton.factorizations.lu > 0, "{newton:?}");
    let said = format!(
        "step 1/1 t = 1.0000: {} iterations, {} of the linear solver (which failed once; a direct solver replaced it), residual ",
        newton.iterations, newton.linear_iterations
    );
    assert!(run.stderr.contains(&said), "{said}: {}", run.stderr);
    line(folder, "run direct.toml --out direct").done();
    assert_same_loads(folder, "auto", "direct");
    // Without the choice by size, a failed iteration is an error.
    let gmres = "solver = { method = \"gmres\", preconditioner = \"multigrid\", max_iterations = 20 }\n";
    std::fs::write(folder.join("gmres.toml"), format!("{text}{gmres}").replace("count = 1", "count = 1\nmax_cuts = 0"))
        .unwrap();
    let failed = line(folder, "run gmres.toml --out gmres");
    assert!(failed.failed(3).contains("GMRES left a relative residual of "), "{}", failed.stderr);
}

#[test]
fn the_solver_is_chosen_by_size_and_named() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let material = "{ model = \"neo-hookean\", shear_modulus = 1000.0, poisson_ratio = 0.3 }";
    std::fs::write(folder.join("small.toml"), case(material, "")).unwrap();
    std::fs::write(folder.join("large.toml"), case(material, "").replace("[7, 7, 7]", "[26, 26, 26]")).unwrap();
    std::fs::write(folder.join("fixed.toml"), case(material, MULTIGRID)).unwrap();
    let plan = |name: &str| line(folder, &format!("check {name}.toml")).done().to_owned();
    assert!(plan("small").contains("\nsolver     direct: estimated "), "{}", plan("small"));
    assert!(plan("large").contains("\nsolver     conjugate gradients with multigrid: estimated "), "{}", plan("large"));
    // A direct solver may replace only the chosen one.
    let replaced = |name: &str| plan(name).contains(" MB more if a direct solver replaces the iterative one\n");
    assert_eq!(["small", "large", "fixed"].map(replaced), [false, true, false]);
    assert!(plan("fixed").contains("\nsolver     cg with the preconditioner multigrid\n"), "{}", plan("fixed"));
    line(folder, "run small.toml --out small").done();
    let events = log::read(&folder.join("small/log.jsonl")).unwrap();
    let Some(Event::Start(start)) = events.first() else { panic!("{events:?}") };
    assert!(start.solver.starts_with("direct: estimated "), "{}", start.solver);
}
