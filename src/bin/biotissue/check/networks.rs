//! The networks, in the plan.

use biotissue::app::run::NetworkSize;

/// With more networks than this, one line describes all of them.
const MOST_NETWORKS: usize = 8;

/// Returns a line for each network, or one for all if they are many.
pub fn network_lines(networks: &[NetworkSize]) -> Vec<String> {
    if networks.len() <= MOST_NETWORKS {
        let line = |NetworkSize { name, unknowns, rves }: &NetworkSize| {
            format!("  {name:<24} {unknowns:>6} unknowns, {rves:>6} RVEs")
        };
        return networks.iter().map(line).collect();
    }
    let unknowns = range(networks.iter().map(|network| network.unknowns));
    let rves = range(networks.iter().map(|network| network.rves));
    vec![format!("networks   {}, each with {unknowns} unknowns and {rves} RVEs; --json lists them", networks.len())]
}

/// Describes the range of numbers, such as `3 to 5`, or `3` if all are the same.
fn range(numbers: impl Iterator<Item = usize> + Clone) -> String {
    let (min, max) = (numbers.clone().min().unwrap_or(0), numbers.max().unwrap_or(0));
    if min == max { min.to_string() } else { format!("{min} to {max}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn many_networks_take_one_line() {
        let networks: Vec<NetworkSize> =
            (0..9).map(|k| NetworkSize { name: format!("{k}.txt"), unknowns: 300 + k, rves: 7 }).collect();
        let few = network_lines(&networks[..8]);
        assert_eq!((few.len(), &*few[1]), (8, "  1.txt                       301 unknowns,      7 RVEs"));
        let all = "networks   9, each with 300 to 308 unknowns and 7 RVEs; --json lists them";
        assert_eq!(network_lines(&networks), [all]);
        assert!(network_lines(&[]).is_empty());
    }
}
