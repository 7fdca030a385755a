//! The part of a sidecar that gives the type of every fiber.

use std::fmt::Write as _;
use std::path::Path;

use serde::Deserialize;
use toml::Spanned;

use super::sidecar::line_of;
use crate::fiber::law::FiberMaterial;
use crate::fiber::network::Network;
use crate::input::InputError;

/// Fibers of several types.
#[derive(Clone, Debug, PartialEq)]
pub struct FiberTypes {
    /// The materials.
    pub materials: Vec<FiberMaterial>,
    /// Index into `materials` for every fiber of the network file.
    pub material_of: Vec<u16>,
}

impl FiberTypes {
    /// Returns the fiber types of a network; `None` if it has at most one material.
    pub fn of(network: &Network) -> Option<Self> {
        let (materials, material_of) = (network.materials(), network.material_of());
        (materials.len() > 1).then(|| Self { materials: materials.to_vec(), material_of: material_of.to_vec() })
    }

    /// Checks the list against the numbers of fibers and materials.
    pub(super) fn read(
        file: &Path,
        bytes: &[u8],
        materials: Vec<FiberMaterial>,
        list: Spanned<Fibers>,
        fibers: usize,
    ) -> Result<Self, InputError> {
        let line = line_of(bytes, list.span().start);
        let types = list.into_inner().types;
        if types.len() != fibers {
            let (what, expected) =
                (format!("{} fiber types in the list", types.len()), format!("{fibers}, one for each fiber"));
            return Err(InputError::at_line(file, line, what, expected, "give the .toml file of this network"));
        }
        let mut material_of = Vec::with_capacity(types.len());
        for number in &types {
            match u16::try_from(*number.get_ref()) {
                Ok(small) if usize::from(small) < materials.len() => material_of.push(small),
                _ => {
                    let (line, last) = (line_of(bytes, number.span().start), materials.len() - 1);
                    let what = format!("there is no fiber type {}", number.get_ref());
                    let (expected, cure) =
                        (format!("types 0 to {last}"), "correct the number, or add a [[fiber_type]]");
                    return Err(InputError::at_line(file, line, what, expected, cure));
                }
            }
        }
        Ok(Self { materials, material_of })
    }

    /// Appends the table `[fibers]` with the list of types to the text of the file.
    pub(super) fn list(&self, text: &mut String) {
        text.push_str("\n[fibers]\ntypes = [\n");
        for row in self.material_of.chunks(40) {
            let row: Vec<String> = row.iter().map(u16::to_string).collect();
            // Writing to a string cannot fail.
            let _ = writeln!(text, "    {},", row.join(", "));
        }
        text.push_str("]\n");
    }
}

/// The table `[fibers]`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Fibers {
    pub(super) types: Vec<Spanned<i64>>,
}

#[cfg(test)]
mod tests {
    use super::super::sidecar::{Sidecar, read_beside};
    use super::*;
    use crate::fiber::law::{Law, Table};

    #[test]
    fn fiber_types_read_back_the_same() {
        let folder = tempfile::tempdir().unwrap();
        let network = folder.path().join("net.txt");
        let laws = [
            Law::Linear { youngs_modulus: 1e8 },
            Law::table(Table::new(vec![[0.9, -1e6 / 3.0], [1.0, 0.0], [1.2, 2e6]]).unwrap()),
            Law::Exponential { youngs_modulus: 1e7, nonlinearity: 1.2 }.with_buckling(0.1, 0.02),
        ];
        let materials: Vec<FiberMaterial> = laws.map(|law| FiberMaterial { law, radius: 5e-8, density: None }).into();
        let material_of: Vec<u16> = (0..150).map(|k| k % 3).collect();
        let types = FiberTypes { materials, material_of };
        let sidecar = Sidecar { fiber_types: Some(types), length_unit: Some("m".into()), ..Sidecar::default() };
        sidecar.write_beside(&network).unwrap();
        assert_eq!(read_beside(&network, 150).unwrap(), Some(sidecar.clone()));
        let error = read_beside(&network, 151).unwrap_err().to_string();
        assert!(error.contains("150 fiber types in the list\n  expected: 151, one for each fiber"), "{error}");
    }
}
