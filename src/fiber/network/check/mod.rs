//! Properties of a network: statistics, parts that carry no load, and zero modes.

mod clean;
mod components;
mod report;
mod rigidity;

pub use clean::{Cleaned, Removed, clean};
pub use components::Component;
pub use report::{NetworkReport, SummaryStatistics, examine};
pub use rigidity::{MobileNode, Rigidity, RigidityError, rigidity, zero_modes};

#[cfg(test)]
mod tests {
    use super::*;
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
        let removed = Removed { short_fibers: 0, dangling_fibers: 3, unsupported_fibers: 3, nodes: 7 };
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
}
