//! One fiber type on the command line: `fraction=0.7,law=exponential,youngs-modulus=1e8,...`.

use std::str::FromStr;

use biotissue::fiber::law::{BUCKLING, FiberMaterial, formula_parameters};
use biotissue::fiber::network::file::sidecar::NamedLaw;

use crate::failure::Failure;
use crate::law::checked;
use crate::number::real;

/// A fraction of the fibers and their material, not yet checked.
#[derive(Clone, Debug)]
pub struct FiberTypeArgument {
    fraction: f64,
    law: NamedLaw,
}

/// The keys, in the order in which the error for an unknown key lists them.
fn keys() -> Vec<&'static str> {
    let parameters = formula_parameters().into_iter().map(|parameter| parameter.option);
    let buckling = BUCKLING.iter().map(|parameter| parameter.option);
    let keys = ["fraction", "law", "radius"].into_iter().chain(parameters).chain(["table"]).chain(buckling);
    keys.chain(["density"]).collect()
}

impl FromStr for FiberTypeArgument {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (mut fraction, mut radius) = (None, None);
        let mut law = NamedLaw::default();
        let parameters: Vec<_> = formula_parameters().into_iter().chain(&BUCKLING).collect();
        let mut known: Vec<&str> = Vec::new();
        for entry in text.split(',').map(str::trim).filter(|entry| !entry.is_empty()) {
            let (key, value) = entry.split_once('=').ok_or_else(|| format!("`{entry}` is not KEY=VALUE"))?;
            let (key, value) = (key.trim(), value.trim());
            if known.contains(&key) {
                return Err(format!("`{key}` is given twice"));
            }
            known.push(key);
            let number = || real(value).map_err(|error| format!("{key}: {error}"));
            match key {
                "fraction" => fraction = Some(number()?),
                "law" => law.name = value.into(),
                "radius" => radius = Some(number()?),
                "table" => law.file = Some(value.into()),
                "density" => law.density = Some(number()?),
                _ => match parameters.iter().find(|parameter| parameter.option == key) {
                    Some(parameter) => law.set(parameter, number()?),
                    None => return Err(format!("there is no key `{key}`; the known keys are {}", keys().join(", "))),
                },
            }
        }
        let missing = |key: &str| format!("there is no `{key}=`");
        law.radius = radius.ok_or_else(|| missing("radius"))?;
        if law.name.is_empty() {
            return Err(missing("law"));
        }
        Ok(Self { fraction: fraction.ok_or_else(|| missing("fraction"))?, law })
    }
}

impl FiberTypeArgument {
    /// Returns the fraction of all fibers and the material, with its parameters checked.
    pub fn material(&self) -> Result<(f64, FiberMaterial), Failure> {
        let material = checked(&self.law, &|parameter| format!("`{parameter}=` of --fiber"), "`law=`")?;
        Ok((self.fraction, material))
    }
}
