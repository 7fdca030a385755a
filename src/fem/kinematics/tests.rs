use nalgebra::Rotation3;

use super::*;

/// Four nodes: one plain, one with a frame, two on a rigid surface.
fn sample() -> (Kinematics, Vec<[f64; 3]>) {
    let positions = vec![[0.0, 0.0, 0.0], [0.2, -0.1, 0.4], [1.0, 0.3, -0.2], [0.9, -0.5, 0.6]];
    let frame = Rotation3::from_scaled_axis(Vector3::new(0.3, -0.7, 0.2)).into_inner();
    let rigid = RigidSurface::new(0, [0.8, 0.1, 0.1], vec![2, 3], &positions);
    (Kinematics::new(4, vec![(1, frame)], vec![rigid]), positions)
}

const MOTION: RigidMotion = RigidMotion { displacement: [0.3, -0.2, 0.1], rotation: [0.4, 1.1, -0.6] };

/// A state of the nodes that is a function of the 12 unknowns.
fn displacements(kinematics: &Kinematics, unknowns: &[f64; 12]) -> (Vec<[f64; 3]>, Vec<RigidMotion>) {
    let mut nodal = vec![[0.0; 3]; 4];
    nodal[0].copy_from_slice(&unknowns[..3]);
    nodal[1].copy_from_slice(&unknowns[3..6]);
    kinematics.rotate_from_frames(&mut nodal);
    let mut increments = [0.0; 6];
    increments.copy_from_slice(&unknowns[6..]);
    let mut motions = vec![MOTION];
    kinematics.advance(1.0, &[increments], &mut motions, &mut nodal);
    (nodal, motions)
}

/// Nonlinear forces with a potential, and their stiffness, row-major: `f_k = k_k u_k + c (w . u)^3 w_k`.
fn forces(u: &[[f64; 3]]) -> (Vec<[f64; 3]>, Vec<f64>) {
    let weight = |k: usize| (1.0 + 0.7 * k as f64).sin();
    let along: f64 = u.as_flattened().iter().enumerate().map(|(k, u)| weight(k) * u).sum();
    let mut forces = u.to_vec();
    let entry = |k: usize, u: f64| (1.0 + 0.1 * k as f64) * u + along.powi(3) * weight(k);
    forces.as_flattened_mut().iter_mut().enumerate().for_each(|(k, f)| *f = entry(k, *f));
    let stiffness = (0..144).map(|n| {
        let (i, j) = (n / 12, n % 12);
        let diagonal = if i == j { 1.0 + 0.1 * i as f64 } else { 0.0 };
        diagonal + 3.0 * along * along * weight(i) * weight(j)
    });
    (forces, stiffness.collect())
}

/// The residual in the order of the rows: node 0, node 1 along its frame, the rigid surface.
fn residual(kinematics: &Kinematics, unknowns: &[f64; 12]) -> [f64; 12] {
    let (u, motions) = displacements(kinematics, unknowns);
    let (mut forces, _) = forces(&u);
    let rigid = kinematics.rigid_forces(&motions, &forces);
    kinematics.rotate_to_frames(&mut forces);
    let parts = [&forces[0][..], &forces[1], &rigid[0]].concat();
    std::array::from_fn(|k| parts[k])
}

#[test]
fn the_condensed_stiffness_is_the_slope_of_the_condensed_forces() {
    let (kinematics, _) = sample();
    let nodes = [0, 1, 2, 3];
    assert_eq!(kinematics.rows(&nodes), [Rows::Node(0), Rows::Node(1), Rows::RigidSurface(0)]);
    let at: [f64; 12] = std::array::from_fn(|k| 0.1 * (k as f64).cos());
    let (u, motions) = displacements(&kinematics, &at);
    let (f, stiffness) = forces(&u);
    let mut condensed = kinematics.condense(&nodes, &stiffness, &kinematics.derivatives(&motions));
    let geometric = kinematics.geometric_stiffness(&motions, &f)[0];
    for (i, j) in (0..36).map(|n| (n / 6, n % 6)) {
        condensed[12 * (6 + i) + 6 + j] += geometric[6 * i + j];
    }
    let h = 1e-5;
    for column in 0..12 {
        let moved = |by: f64| {
            let mut unknowns = at;
            unknowns[column] += by;
            residual(&kinematics, &unknowns)
        };
        let (up, down) = (moved(h), moved(-h));
        for row in 0..12 {
            let slope = (up[row] - down[row]) / (2.0 * h);
            let entry = condensed[12 * row + column];
            assert!((slope - entry).abs() < 1e-8, "({row}, {column}): {entry}, slope {slope}");
            assert!((entry - condensed[12 * column + row]).abs() < 1e-12, "the stiffness is symmetric");
        }
    }
}

#[test]
fn rigid_surfaces_keep_distances_and_report_moments() {
    let (kinematics, positions) = sample();
    let rigid = &kinematics.rigid_surfaces()[0];
    let mut u = vec![[0.0; 3]; 4];
    rigid.place(&MOTION, &mut u);
    let at = |node: usize| Vector3::from(positions[node]) + Vector3::from(u[node]);
    let (before, after) = (Vector3::from(positions[3]) - Vector3::from(positions[2]), at(3) - at(2));
    assert!((before.norm() - after.norm()).abs() < 1e-15);
    let forces = [[9.0; 3], [9.0; 3], [1.0, 2.0, -1.0], [-0.5, 0.3, 0.2]];
    let reference = Vector3::from(rigid.reference) + Vector3::from(MOTION.displacement);
    let moment = |node: usize| (at(node) - reference).cross(&Vector3::from(forces[node]));
    assert!((Vector3::from(rigid.moment(&MOTION, &forces)) - moment(2) - moment(3)).norm() < 1e-14);
}
