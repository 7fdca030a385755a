//! Linear elements in nearly incompressible materials, which lock.

use std::sync::Arc;

use super::in_region;
use crate::app::case::{Case, Formula};
use crate::fem::element::ElementType;
use crate::fem::mesh::Mesh;

/// Poisson ratio above which linear elements lock.
const LARGEST_POISSON_RATIO: f64 = 0.45;

/// The greatest Poisson ratio of these formulas at rest; 0 without any.
pub(super) fn greatest_poisson_ratio(formulas: &[Arc<Formula>]) -> f64 {
    let ratios = formulas.iter().map(|formula| {
        let [mu, bulk] = formula.mean_moduli();
        (3.0 * bulk - 2.0 * mu) / (6.0 * bulk + 2.0 * mu)
    });
    ratios.fold(0.0, f64::max)
}

/// Finds linear elements in nearly incompressible materials, which lock, given the greatest Poisson ratio of each region.
pub(super) fn check_locking(case: &Case, mesh: &Mesh, poisson_ratios: &[f64]) -> Vec<String> {
    let (mut has_plain, mut has_wedges) = (vec![false; case.regions.len()], vec![false; case.regions.len()]);
    let mut in_patch = vec![false; mesh.elements().len()];
    mesh.patches().iter().flatten().for_each(|&element| in_patch[element as usize] = true);
    let of_mesh: Vec<Option<usize>> = mesh.regions().iter().map(|name| case.region_of(name)).collect();
    for ((element_type, _), (&region, in_patch)) in mesh.elements().typed().zip(mesh.region_of().iter().zip(in_patch)) {
        let Some(region) = of_mesh[region as usize] else { continue };
        match element_type {
            ElementType::Tet4 | ElementType::Hex8 => has_plain[region] |= !in_patch,
            ElementType::Wedge6 => has_wedges[region] = true,
            ElementType::Tet10 | ElementType::Hex20 | ElementType::Hex27 => {}
        }
    }
    // Wedges have no form of order 2.
    let or_quadratic = if mesh.elements().typed().any(|(element_type, _)| element_type == ElementType::Wedge6) {
        ""
    } else {
        ", or `order = 2` in [mesh]"
    };
    let mut warnings = Vec::new();
    for (number, &nu) in poisson_ratios.iter().enumerate().filter(|(_, nu)| **nu > LARGEST_POISSON_RATIO) {
        let nu = (nu * 1e4).round() / 1e4;
        if has_plain[number] {
            let cure = format!("set `f_bar = true` here{or_quadratic}");
            let message = format!("its linear elements lock at a Poisson ratio of {nu}: {cure}");
            warnings.push(in_region(case, number, &message));
        }
        if has_wedges[number] {
            let cure = "mesh it with tetrahedra or hexahedra, and set `f_bar = true` here, or, if the mesh then has no \
                        wedges, `order = 2` in [mesh]";
            let message = format!("its wedges lock at a Poisson ratio of {nu}, and have no `f_bar`: {cure}");
            warnings.push(in_region(case, number, &message));
        }
    }
    warnings
}
