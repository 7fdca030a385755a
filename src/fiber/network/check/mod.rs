//! Properties of a network: statistics, parts that carry no load, doubled fibers, and zero modes.

mod clean;
mod components;
mod merge;
mod report;
mod rigidity;

pub use clean::{Cleaned, Removed, clean};
pub use components::Component;
pub use report::{NetworkReport, SummaryStatistics, examine};
pub use rigidity::{MobileNode, Rigidity, RigidityError, rigidity, zero_modes};

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fiber::law::{FiberLaw as _, FiberMaterial, Law};
    use crate::fiber::network::{Network, NetworkError};

    /// Returns a network of the corners of the unit cube connected to node 8, a dangling chain 8-9-10 with a branch
    /// 9-11, a component 12-13-14 without a boundary node, and an isolated node 15.
    fn untidy() -> Network {
        let corner = |c: u32| [0, 1, 2].map(|k| f64::from(c >> k & 1) - 0.5);
        let mut nodes: Vec<[f64; 3]> = (0..8).map(corner).collect();
        nodes.extend([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.2, 0.0, 0.0], [0.1, 0.1, 0.0]]);
        nodes.extend([[0.3, 0.3, 0.3], [0.3, 0.2, 0.3], [0.3, 0.3, 0.2], [-0.3, 0.0, 0.0]]);
        let mut fibers: Vec<[u32; 2]> = (0..8).map(|c| [c, 8]).collect();
        fibers.extend([[8, 9], [9, 10], [9, 11], [12, 13], [13, 14], [14, 12], [0, 1]]);
        Network::new("untidy", nodes, fibers).unwrap()
    }

    #[test]
    fn the_report_contains_the_statistics_of_the_network() {
        let report = examine(&untidy());
        assert_eq!((report.nodes, report.fibers, report.boundary_nodes, report.free_dofs), (16, 15, 8, 24));
        assert_eq!((report.boundary_fibers, report.maxwell_count), (1, 14 - 24));
        assert_eq!(
            report.components,
            [
                Component { first_node: 0, nodes: 12, fibers: 12, supported: true },
                Component { first_node: 12, nodes: 3, fibers: 3, supported: false },
                Component { first_node: 15, nodes: 1, fibers: 0, supported: false },
            ]
        );
        assert_eq!(report.unsupported().count(), 2);
        assert_eq!(report.dangling_nodes, [10, 11]);
        let coordination = report.coordination.unwrap();
        // The interior nodes have 0, 1, 1, 2, 2, 2, 3 and 9 fibers.
        assert_eq!((coordination.min, coordination.mean, coordination.max), (0.0, 2.5, 9.0));
        assert!((coordination.deviation - (104.0 / 8.0 - 2.5f64 * 2.5).sqrt()).abs() < 1e-14);
        assert_eq!(report.coordination_counts, [1, 2, 3, 1, 0, 0, 0, 0, 0, 1]);
        let trace = |t: [[f64; 3]; 3]| t[0][0] + t[1][1] + t[2][2];
        assert!((trace(report.orientation) - 1.0).abs() < 1e-12);
        assert!((trace(report.orientation_by_length) - 1.0).abs() < 1e-12);
        // Eight diagonals and three fibers along x.
        let xx = (8.0 / 3.0 + 3.0) / 15.0;
        assert!((report.orientation[0][0] - xx).abs() < 1e-12, "{}", report.orientation[0][0]);
        assert!((report.principal_direction[0] - 1.0).abs() < 1e-12, "{:?}", report.principal_direction);
        assert!((report.order - (1.5 * xx - 0.5)).abs() < 1e-12);
        let (diagonal, lengths) = (0.75f64.sqrt(), report.total_length);
        let xx = (8.0 * diagonal / 3.0 + 1.2) / lengths;
        assert!((report.order_by_length - (1.5 * xx - 0.5)).abs() < 1e-12, "{}", report.order_by_length);
        assert!((report.length.min - 0.1).abs() < 1e-15 && (report.length.max - 1.0).abs() < 1e-15);
    }

    #[test]
    fn cleaning_removes_the_parts_that_carry_no_load() {
        let cleaned = clean(&untidy(), None).unwrap();
        let removed =
            Removed { short_fibers: 0, dangling_fibers: 3, unsupported_fibers: 3, merged_fibers: 0, nodes: 7 };
        assert_eq!(cleaned.removed, removed);
        assert_eq!(cleaned.kept_nodes, (0..9).collect::<Vec<_>>());
        assert_eq!(cleaned.kept_fibers, [0, 1, 2, 3, 4, 5, 6, 7, 14]);
        assert!(clean(&cleaned.network, None).unwrap().removed.is_nothing());
        let report = examine(&cleaned.network);
        assert_eq!((report.unsupported().count(), report.dangling_nodes.len()), (0, 0));
    }

    /// Two fibers between the same nodes support them no better than one: the chain still dangles. The diagonal and its
    /// duplicate are kept.
    #[test]
    fn doubled_fibers_are_counted_and_dangle_like_single_ones() {
        let untidy = untidy();
        let mut fibers = untidy.fibers().to_vec();
        fibers.extend([[9, 10], [10, 9], [8, 0]]);
        let network = Network::new("doubled", untidy.nodes().to_vec(), fibers).unwrap();
        let report = examine(&network);
        assert_eq!((report.fibers, report.doubled_fibers, report.maxwell_count), (18, 3, 17 - 24));
        assert_eq!(report.dangling_nodes, [10, 11]);
        let cleaned = clean(&network, None).unwrap();
        assert_eq!((cleaned.removed.dangling_fibers, cleaned.removed.unsupported_fibers), (5, 3));
        assert_eq!(cleaned.kept_fibers, [0, 1, 2, 3, 4, 5, 6, 7, 14, 17]);
        assert_eq!(examine(&cleaned.network).doubled_fibers, 1);
        // A network without laws cannot hold the sum of two areas.
        assert_eq!((cleaned.removed.merged_fibers, cleaned.kept_doubled_fibers), (0, 1));
    }

    #[test]
    fn short_fibers_are_removed_and_the_bounding_box_is_kept() {
        // All diagonals have length 0.87; only the fiber along the edge from corner 0 to corner 1 is kept.
        let cleaned = clean(&untidy(), Some(0.9)).unwrap();
        assert_eq!(cleaned.removed.short_fibers, 14);
        assert_eq!(cleaned.kept_fibers, [14]);
        assert_eq!(cleaned.kept_nodes, [0, 1, 2, 4], "corners 2 and 4 are kept for the faces y = 1/2 and z = 1/2");
        assert_eq!(clean(&untidy(), Some(1.1)).unwrap_err(), NetworkError::NoFibers);
    }

    /// Returns the corners of the cube connected to its center, with four fibers to corner 0, three of one law, and two
    /// of different laws to corner 7.
    fn doubled() -> Network {
        let untidy = untidy();
        let nodes = untidy.nodes()[..9].to_vec();
        let mut fibers: Vec<[u32; 2]> = (0..8).map(|corner| [corner, 8]).collect();
        fibers.extend([[8, 0], [0, 8], [8, 0], [7, 8]]);
        let curved = Law::Exponential { youngs_modulus: 2e8, nonlinearity: 1.2 };
        let materials = [
            (Law::Linear { youngs_modulus: 1e8 }, 3e-8, 1000.0),
            (Law::Linear { youngs_modulus: 1e8 }, 4e-8, 1500.0),
            (curved.with_buckling(0.1, 0.01), 5e-8, 1000.0),
        ];
        let materials = materials.map(|(law, radius, density)| FiberMaterial { law, radius, density: Some(density) });
        let material_of = vec![0, 0, 0, 0, 0, 0, 0, 2, 1, 2, 0, 0];
        Network::new("doubled", nodes, fibers).unwrap().with_materials(materials.into(), material_of).unwrap()
    }

    /// Returns the sum of force and stiffness, in N per unit of stretch, of the fibers that join a node to node 8.
    fn force(network: &Network, node: u32, stretch: f64) -> [f64; 2] {
        let of_node = network.fibers().iter().zip(network.material_of()).filter(|(ends, _)| ends.contains(&node));
        of_node.fold([0.0; 2], |[force, slope], (_, &of)| {
            let material = &network.materials()[usize::from(of)];
            let (stress, stiffness) = material.law.stress(stretch);
            [force + material.area() * stress, slope + material.area() * stiffness]
        })
    }

    #[test]
    fn doubled_fibers_of_one_law_are_merged_and_keep_their_response() {
        let network = doubled();
        let cleaned = clean(&network, None).unwrap();
        assert_eq!(cleaned.removed, Removed { merged_fibers: 2, ..Removed::default() });
        assert_eq!(cleaned.kept_fibers, [0, 1, 2, 3, 4, 5, 6, 7, 9, 11]);
        assert_eq!((cleaned.kept_doubled_fibers, examine(&cleaned.network).doubled_fibers), (2, 2));
        assert_eq!(cleaned.network.material_of(), [3, 0, 0, 0, 0, 0, 0, 2, 2, 0]);
        let merged = &cleaned.network.materials()[3];
        assert_eq!((&merged.law, cleaned.network.materials().len()), (&network.materials()[0].law, 4));
        assert!((merged.radius / 1e-8 - 34.0f64.sqrt()).abs() < 1e-14, "{}", merged.radius);
        // The mass is conserved.
        let density = (9.0 * 1000.0 + 16.0 * 1500.0 + 9.0 * 1000.0) / 34.0;
        assert!((merged.density.unwrap() - density).abs() < 1e-11 * density, "{:?}", merged.density);
        for node in 0..8 {
            for stretch in [0.8, 0.99, 1.0, 1.3, 1.7] {
                let (before, after) = (force(&network, node, stretch), force(&cleaned.network, node, stretch));
                for k in 0..2 {
                    let same = (before[k] - after[k]).abs() <= 4.0 * f64::EPSILON * before[k].abs();
                    assert!(same, "node {node}, stretch {stretch}: {before:?} {after:?}");
                }
            }
        }
        // Sums of different numbers of fibers have materials of their own.
        let one = doubled().of_one_material(network.materials()[0].clone());
        let cleaned = clean(&one, None).unwrap();
        assert_eq!((cleaned.removed.merged_fibers, cleaned.kept_doubled_fibers), (4, 0));
        assert_eq!(cleaned.network.material_of(), [1, 0, 0, 0, 0, 0, 0, 2]);
        assert!(clean(&cleaned.network, None).unwrap().removed.is_nothing());
    }
}
