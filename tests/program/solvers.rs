//! Runs with the linear solvers of the body.

use biotissue::app::results::log::{self, Event};

use crate::line;
use crate::variants::{loads, logged_steps, run_every_way};

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
        assert_eq!(newton.fallbacks, 0);
        // No system is solved further than Newton's method needs.
        assert!(newton.linear.iter().any(|solve| solve.residual > 1e-4), "{:?}", newton.linear);
    }
    let material = "{ model = \"neo-hookean\", shear_modulus = 1000.0, poisson_ratio = 0.3 }";
    std::fs::write(folder.join("direct.toml"), case(material, "solver = \"direct\"")).unwrap();
    line(folder, "run direct.toml --out direct").done();
    let (found, exact) = (loads(folder, "formula"), loads(folder, "direct"));
    let scale =
        exact.rows[2].surfaces.iter().flat_map(|surface| surface.force).fold(0.0, |most: f64, f| most.max(f.abs()));
    for (found, exact) in found.rows.iter().zip(&exact.rows) {
        for (found, exact) in found.surfaces.iter().zip(&exact.surfaces) {
            let close = |i: usize| (found.force[i] - exact.force[i]).abs() < 1e-9 * scale;
            assert!((0..3).all(close), "{:?} {:?}", found.force, exact.force);
        }
    }
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
    assert!(plan("fixed").contains("\nsolver     cg with the preconditioner multigrid\n"), "{}", plan("fixed"));
    line(folder, "run small.toml --out small").done();
    let events = log::read(&folder.join("small/log.jsonl")).unwrap();
    let Some(Event::Start(start)) = events.first() else { panic!("{events:?}") };
    assert!(start.solver.starts_with("direct: estimated "), "{}", start.solver);
}
