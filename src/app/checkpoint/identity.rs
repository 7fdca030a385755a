//! The case, the mesh and the networks that a checkpoint belongs to.

use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::case_text::{Difference, differences, is_setting, text_of, without_optional};
use super::hashes::hash_network;
use crate::app::case::Case;
use crate::checksum::Fnv;
use crate::tissue::micro_scale::TissueMaterial;

/// The case, mesh and networks of a run, without the location of files, the title and the output settings.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Identity {
    /// Version of the program.
    program: String,
    /// The linear-algebra backend.
    backend: String,
    /// The case as text.
    case: String,
    /// Hash of the mesh.
    mesh: u64,
    /// Hash of the networks.
    networks: u64,
}

/// The reason why a run cannot resume from the state of another.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum Mismatch {
    /// The cases differ.
    #[error("the case differs in {section}: {} before, {} now", entry(before), entry(now))]
    Case {
        /// The table of the case, such as `[steps]`.
        section: String,
        /// The line in the checkpoint; empty if there was none.
        before: String,
        /// The line in the current case; empty if there is none.
        now: String,
    },
    /// The meshes differ.
    #[error("the mesh differs (nodes, elements, regions or surfaces)")]
    Mesh,
    /// The values of material parameters or axes, the choice of networks or the fiber volume fractions differ.
    #[error("the material fields differ (parameters, axes, networks or fiber volume fractions by element)")]
    Fields,
    /// The networks differ.
    #[error("the fiber networks differ (nodes, fibers or materials)")]
    Networks,
}

fn entry(line: &str) -> String {
    if line.is_empty() { "nothing".into() } else { format!("`{line}`") }
}

impl Identity {
    /// Returns the identity of a run on a mesh with this hash ([`hash_of_mesh`](super::hash_of_mesh)), whose materials have this hash
    /// ([`hash_of_fields`](super::hash_of_fields)).
    pub fn new(backend: &str, case: &Case, (mesh, fields): (u64, Option<u64>), field: &impl TissueMaterial) -> Self {
        let mut networks = Fnv::new();
        for model in field.library().models() {
            hash_network(model.network(), &mut networks);
        }
        Self {
            program: env!("CARGO_PKG_VERSION").into(),
            backend: backend.into(),
            case: text_of(case) + &fields_entry(fields),
            mesh,
            networks: networks.finish(),
        }
    }

    /// Checks whether run `now` can resume from a state of this run. Returns differences that may slightly change the
    /// results: another version, backend, or solver setting.
    ///
    /// # Errors
    /// Returns [`Mismatch`] if the case, the mesh or the networks differ otherwise.
    pub fn check(&self, now: &Self) -> Result<Vec<String>, Mismatch> {
        let mut remarks = Vec::new();
        for (what, before, now) in [("version", &self.program, &now.program), ("backend", &self.backend, &now.backend)]
        {
            if before != now {
                remarks.push(format!("{what} {before} before, {now} now"));
            }
        }
        let ((before, set_before), (after, set_now)) = (without_optional(&self.case), without_optional(&now.case));
        for (before, now) in set_before.into_iter().zip(set_now).filter(|(before, now)| before != now) {
            let entry = |line: Option<&str>| line.map_or("the default".into(), entry);
            remarks.push(format!("[micro] {} before, {} now", entry(before), entry(now)));
        }
        for Difference { section, before, now } in differences(&before, &after) {
            if is_setting(section, before, now) {
                remarks.push(format!("{section} {} before, {} now", entry(before), entry(now)));
            } else if section == FIELDS {
                return Err(Mismatch::Fields);
            } else {
                return Err(Mismatch::Case { section: section.into(), before: before.into(), now: now.into() });
            }
        }
        if self.mesh != now.mesh {
            return Err(Mismatch::Mesh);
        }
        if self.networks != now.networks {
            return Err(Mismatch::Networks);
        }
        Ok(remarks)
    }
}

/// Returns true if a run of case `now` can continue one of case `before`, as far as the cases show: if they differ in nothing
/// but settings.
pub(in crate::app) fn is_same_run(before: &Case, now: &Case) -> bool {
    let (before, now) = (text_of(before), text_of(now));
    let ((before, _), (now, _)) = (without_optional(&before), without_optional(&now));
    differences(&before, &now).iter().all(|of| is_setting(of.section, of.before, of.now))
}

/// The table below the case that holds the hash of the fields.
const FIELDS: &str = "[fields]";

/// Returns a table with the hash of the fields, or nothing without any. The hash is part of the text, so that cases
/// without fields have the same identity as in earlier versions.
fn fields_entry(hash: Option<u64>) -> String {
    hash.map_or_else(String::new, |hash| format!("{FIELDS}\nhash = {hash:016x}\n"))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Settings that have no line at their default leave the lines of the tables behind them where they are.
    #[test]
    fn a_setting_may_change_from_its_default_and_back() {
        let of = |micro: &str| Identity {
            program: "1".into(),
            backend: "sparse".into(),
            case: format!("[[region]]\nlanes = 3\n[micro]\npredictor = true\n{micro}[scales]\nmacro = 1\n[output]\n"),
            mesh: 0,
            networks: 0,
        };
        let [plain, off, device] = ["", "lanes = \"off\"\n", "device = \"cuda\"\nlanes = \"mixed\"\n"].map(of);
        assert_eq!(plain.check(&plain), Ok(vec![]));
        assert_eq!(plain.check(&off), Ok(vec!["[micro] the default before, `lanes = \"off\"` now".into()]));
        let message = |setting: &str| format!("[micro] {setting} before, the default now");
        let both = ["`device = \"cuda\"`", "`lanes = \"mixed\"`"].map(message).to_vec();
        assert_eq!(device.check(&plain), Ok(both));
        assert_eq!(off.check(&device).map(|remarks| remarks.len()), Ok(2));
        let other = Identity { case: off.case.replace("lanes = 3", "lanes = 4"), ..off.clone() };
        assert!(matches!(off.check(&other), Err(Mismatch::Case { section, .. }) if section == "[[region]]"));
    }
}
