//! The networks, in the plan.

use std::fmt::Display;

use biotissue::app::run::NetworkSize;

/// With more networks than this, one line describes all of them.
const MOST_NETWORKS: usize = 8;

/// Returns a line for each network, or one for all if they are many.
pub fn network_lines(networks: &[NetworkSize]) -> Vec<String> {
    if networks.len() <= MOST_NETWORKS {
        let line = |NetworkSize { name, unknowns, rves, raw_edge }: &NetworkSize| {
            let edge = raw_edge.map_or_else(String::new, |edge| format!(", {}", raw_of_edge(&edge.to_string())));
            format!("  {name:<24} {unknowns:>6} unknowns, {rves:>6} RVEs{edge}")
        };
        return networks.iter().map(line).collect();
    }
    let unknowns = range(networks.iter().map(|network| network.unknowns)).unwrap_or_default();
    let rves = range(networks.iter().map(|network| network.rves)).unwrap_or_default();
    let mut lines = vec![format!(
        "networks   {}, each with {unknowns} unknowns and {rves} RVEs; --json lists them",
        networks.len()
    )];
    let edges = networks.iter().filter_map(|network| network.raw_edge);
    if let Some(edges) = range(edges) {
        lines.push(format!("           {}", raw_of_edge(&edges)));
    }
    lines
}

/// Says that stresses are raw, and the edge of the cube by whose square they have to be divided.
fn raw_of_edge(edge: &str) -> String {
    format!("raw scale (edge of the cube in the file: {edge})")
}

/// Describes the range of numbers, such as `3 to 5`, or `3` if all are the same; `None` without numbers.
fn range<T: Copy + PartialOrd + Display>(numbers: impl Iterator<Item = T>) -> Option<String> {
    let widened =
        |[min, max]: [T; 2], next: T| [if next < min { next } else { min }, if next > max { next } else { max }];
    let [min, max] = numbers.map(|number| [number; 2]).reduce(|range, [next, _]| widened(range, next))?;
    Some(if min == max { min.to_string() } else { format!("{min} to {max}") })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn many_networks_take_one_line() {
        let network = |k: usize| NetworkSize { name: format!("{k}.txt"), unknowns: 300 + k, rves: 7, raw_edge: None };
        let mut networks: Vec<NetworkSize> = (0..9).map(network).collect();
        let few = network_lines(&networks[..8]);
        assert_eq!((few.len(), &*few[1]), (8, "  1.txt                       301 unknowns,      7 RVEs"));
        let all = "networks   9, each with 300 to 308 unknowns and 7 RVEs; --json lists them";
        assert_eq!(network_lines(&networks), [all]);
        assert!(network_lines(&[]).is_empty());

        networks[1].raw_edge = Some(2.5);
        let few = network_lines(&networks[..8]);
        assert_eq!(&few[1][30..], "301 unknowns,      7 RVEs, raw scale (edge of the cube in the file: 2.5)");
        networks[5].raw_edge = Some(1.0);
        let edges = "           raw scale (edge of the cube in the file: 1 to 2.5)";
        assert_eq!(network_lines(&networks), [all, edges]);
    }
}
