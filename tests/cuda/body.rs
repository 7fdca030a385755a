//! A body with networks at its points, with and without a device.

use std::path::{Path, PathBuf};

use biotissue::app::results::log::{self, Event, RveLog};
use biotissue::app::results::{LOADS_FILE, LOG_FILE};
use biotissue::fiber::network::{file, generate::delaunay};

use crate::emulation::is_emulated;
use crate::networks::near;

/// What a run wrote.
pub struct Results {
    loads: Vec<Vec<f64>>,
    /// Of each load step.
    pub rves: Vec<RveLog>,
}

/// Writes a case, and its networks; returns its path. `extra` ends it.
pub fn write(folder: &Path, name: &str, device: &str, extra: &str) -> PathBuf {
    let (points, cells, steps) = if is_emulated() { (20, [3, 3, 2], 2) } else { (40, [4, 4, 4], 3) };
    for seed in 1..=3 {
        file::write(&folder.join(format!("network_{seed}.txt")), &delaunay(points, seed).unwrap()).unwrap();
    }
    let text = format!(
        r#"
        [mesh]
        generate = {{ shape = "box", cells = {cells:?}, size = [1.0, 1.0, 1.0] }}
        [[region]]
        name = "*"
        [region.material]
        model = "fiber-rve"
        networks = ["network_*.txt"]
        fiber_volume_fraction = 0.003
        law = {{ name = "exponential", youngs_modulus = 1.0e8, radius = 5.0e-8, nonlinearity = 1.2 }}
        matrix = {{ model = "neo-hookean", shear_modulus = 1000.0, poisson_ratio = 0.3 }}
        [[boundary]]
        surface = "x0"
        displacement = {{ x = 0.0, y = 0.0, z = 0.0 }}
        [[boundary]]
        surface = "x1"
        displacement = {{ x = 0.2, y = 0.05, z = 0.0 }}
        [steps]
        count = {steps}
        [newton]
        tolerance = 1e-12
        [micro]
        device = "{device}"
        lanes = "off"
        {extra}
        "#
    );
    let file = folder.join(name);
    std::fs::write(&file, text).unwrap();
    file
}

impl Results {
    /// Reads the results of a run.
    pub fn read(out: &Path) -> Self {
        let loads = std::fs::read_to_string(out.join(LOADS_FILE)).unwrap();
        let numbers = |line: &str| line.split(',').filter_map(|text| text.parse().ok()).collect();
        let rve = |event| if let Event::Step(step) = event { step.rve } else { None };
        Self {
            loads: loads.lines().skip(1).map(numbers).collect(),
            rves: log::read(&out.join(LOG_FILE)).unwrap().into_iter().filter_map(rve).collect(),
        }
    }

    /// Checks that a run has the reactions of one without a device, and needed as many iterations.
    pub fn assert_same(&self, expected: &Self, what: &str) {
        assert_eq!((self.loads.len(), self.rves.len()), (expected.loads.len(), expected.rves.len()), "{what}");
        for (found, expected) in self.loads.iter().zip(&expected.loads) {
            near(found, expected, what);
        }
        for (found, expected) in self.rves.iter().zip(&expected.rves) {
            let counts = |of: &RveLog| (of.solves, of.iterations_total, of.verified, of.replaced);
            assert_eq!(counts(found), counts(expected), "{what}");
        }
    }

    /// The share of solutions that were made on a device.
    pub fn share_of_device(&self) -> f64 {
        let sum = |count: fn(&RveLog) -> u64| self.rves.iter().map(count).sum::<u64>() as f64;
        sum(|of| of.in_batches) / sum(|of| of.solves)
    }
}
