//! Hashes of the mesh, the networks and the fields of a run.

use crate::app::case::{FiberRve, Formula, NetworkAssignment, RegionMaterial, RveScale, formula_entries};
use crate::checksum::Fnv;
use crate::fem::element::CellType;
use crate::fem::mesh::{Cells, Mesh};
use crate::fiber::law::{FiberLaw, FiberMaterial, Law};
use crate::fiber::network::Network;
use crate::tissue::materials::{Formulas, Region};

/// Returns the hash of all formulas that are not the same at all points, of networks chosen by fields, and of fiber volume
/// fractions that vary; `None` without any. The materials must be those of the whole body.
pub fn hash_of_fields<'a>(regions: impl IntoIterator<Item = &'a Region>) -> Option<u64> {
    let mut hash = None;
    for region in regions {
        if let RegionMaterial::FiberRve(rve) = &region.material {
            hash_network_fields(&region.name, rve, &mut hash);
        }
        let Some(formulas) = region.material.formula() else { continue };
        let is_custom = formulas.distinct().iter().any(|formula| matches!(**formula, Formula::Custom(_)));
        if !is_custom && matches!(formulas, Formulas::Uniform(_)) {
            continue;
        }
        let hash = hash.get_or_insert_with(Fnv::new);
        hash.add_str(&region.name);
        for (key, value) in formulas.distinct().iter().flat_map(|formula| formula_entries(formula)) {
            hash.add_str(key);
            hash.add_str(&value);
        }
        if let Formulas::Points(points) = formulas {
            points.of_point().iter().for_each(|&formula| hash.add_u64(formula.into()));
        }
    }
    hash.map(|hash| hash.finish())
}

fn hash_network_fields(region: &str, rve: &FiberRve, hash: &mut Option<Fnv>) {
    if let NetworkAssignment::Field(networks) = &rve.assignment {
        let hash = hash.get_or_insert_with(Fnv::new);
        hash.add_str(region);
        hash.add_str("networks");
        networks.of_point().iter().for_each(|&network| hash.add_u64(network.into()));
    }
    if let RveScale::Fractions(fractions) = &rve.scale {
        let hash = hash.get_or_insert_with(Fnv::new);
        hash.add_str(region);
        hash.add_str("fiber_volume_fraction");
        // NaN, outside of the region, may have any bits.
        fractions.of_point().iter().for_each(|&fraction| hash.add_f64(if fraction.is_nan() { 0.0 } else { fraction }));
    }
}

/// Returns the hash of nodes, elements, regions and surfaces of a mesh.
pub fn hash_of_mesh(mesh: &Mesh) -> u64 {
    let mut hash = Fnv::new();
    hash.add_positions(mesh.nodes());
    hash_cells(mesh.elements(), &mut hash);
    mesh.region_of().iter().for_each(|&region| hash.add_u64(region.into()));
    hash.add_u64(mesh.regions().len() as u64);
    mesh.regions().iter().for_each(|region| hash.add_str(region));
    for surface in mesh.surfaces() {
        hash.add_str(&surface.name);
        hash_cells(&surface.faces, &mut hash);
    }
    hash.finish()
}

fn hash_cells<T: CellType>(cells: &Cells<T>, hash: &mut Fnv) {
    for block in cells.blocks() {
        hash.add_u64(block.cell_type().nodes() as u64);
        hash.add_u64(block.len() as u64);
        block.nodes().iter().for_each(|&node| hash.add_u64(node.into()));
    }
}

pub(super) fn hash_network(network: &Network, hash: &mut Fnv) {
    hash.add_positions(network.nodes());
    hash.add_indices(network.fibers());
    network.material_of().iter().for_each(|&reaction| hash.add_u64(reaction.into()));
    hash.add_u64(network.materials().len() as u64);
    for FiberMaterial { law, radius, .. } in network.materials() {
        hash_law(law, hash);
        hash.add_f64(*radius);
    }
}

/// The laws that the first version knew. Their hash begins with their position in this list, followed by three
/// parameters; that of all later laws, with their name.
const NUMBERED: [&str; 3] = ["linear", "exponential", "exponential-stretch"];

fn hash_law(law: &Law, hash: &mut Fnv) {
    let mut values = |values: &[f64]| values.iter().for_each(|&value| hash.add_f64(value));
    if let Some((formula, parameters)) = law.formula()
        && let Some(number) = NUMBERED.iter().position(|&name| name == formula.name())
    {
        values(&[number as f64]);
        values(&parameters);
        return values(&[0.0; 3][parameters.len().min(3)..]);
    }
    match law {
        Law::Table(table) => {
            values(&[3.0, table.points().len() as f64]);
            values(table.points().as_flattened());
        }
        Law::Buckling { law, compression, buckling_strain } => {
            values(&[4.0, *compression, *buckling_strain]);
            hash_law(law, hash);
        }
        law => {
            values(&[5.0]);
            hash.add_str(law.name());
            for (name, value) in law.parameters() {
                hash.add_str(name);
                hash.add_f64(value);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fiber::law::Table;

    #[derive(Debug)]
    struct Hooke(f64);

    impl FiberLaw for Hooke {
        fn name(&self) -> &str {
            "hooke"
        }

        fn parameters(&self) -> Vec<(&'static str, f64)> {
            vec![("youngs_modulus", self.0)]
        }

        fn stress(&self, stretch: f64) -> (f64, f64) {
            (self.0 * (stretch - 1.0), self.0)
        }
    }

    #[test]
    fn every_parameter_of_every_law_changes_the_hash() {
        let table = |stress: f64| Law::table(Table::new(vec![[0.9, -1.0], [1.0, 0.0], [1.1, stress]]).unwrap());
        let linear = |youngs_modulus: f64| Law::Linear { youngs_modulus };
        let exponential = |nonlinearity: f64| Law::Exponential { youngs_modulus: 1.0, nonlinearity };
        let laws = [
            linear(1.0),
            linear(2.0),
            exponential(1.0),
            exponential(2.0),
            Law::ExponentialStretch { youngs_modulus: 1.0, nonlinearity: 1.0, transition: 1.1 },
            Law::ExponentialStretch { youngs_modulus: 1.0, nonlinearity: 1.0, transition: 1.2 },
            table(1.0),
            table(2.0),
            linear(1.0).with_buckling(0.1, 0.01),
            linear(1.0).with_buckling(0.2, 0.01),
            linear(1.0).with_buckling(0.1, 0.02),
            exponential(1.0).with_buckling(0.1, 0.01),
            table(1.0).with_buckling(0.1, 0.01),
            Law::custom(Hooke(1.0)),
            Law::custom(Hooke(2.0)),
        ];
        let sum = |law: &Law| {
            let mut hash = Fnv::new();
            hash_law(law, &mut hash);
            hash.finish()
        };
        for (k, law) in laws.iter().enumerate() {
            assert_eq!(sum(law), sum(&law.clone()));
            for other in &laws[..k] {
                assert_ne!(sum(law), sum(other), "{law:?} {other:?}");
                assert_ne!(law, other);
            }
        }
        assert_eq!(sum(&laws[13]), sum(&Law::custom(Hooke(1.0))));
    }
}
