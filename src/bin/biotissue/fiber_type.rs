//! One fiber type on the command line: `fraction=0.7,law=exponential,youngs-modulus=1e8,...`.

use std::str::FromStr;

use biotissue::fiber::law::FiberMaterial;
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

const KEYS: &str = "fraction, law, radius, youngs-modulus, nonlinearity, transition, table, compression, \
                    buckling-strain, density";

impl FromStr for FiberTypeArgument {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (mut fraction, mut radius) = (None, None);
        let mut law = NamedLaw::default();
        let mut known: Vec<&str> = Vec::new();
        for entry in text.split(',').map(str::trim).filter(|entry| !entry.is_empty()) {
            let (key, value) = entry.split_once('=').ok_or_else(|| format!("`{entry}` is not KEY=VALUE"))?;
            let (key, value) = (key.trim(), value.trim());
            if known.contains(&key) {
                return Err(format!("`{key}` stands there twice"));
            }
            known.push(key);
            let number = || real(value).map(Some).map_err(|error| format!("{key}: {error}"));
            match key {
                "fraction" => fraction = number()?,
                "law" => law.name = value.into(),
                "radius" => radius = number()?,
                "youngs-modulus" => law.youngs_modulus = number()?,
                "nonlinearity" => law.nonlinearity = number()?,
                "transition" => law.transition = number()?,
                "table" => law.file = Some(value.into()),
                "compression" => law.compression = number()?,
                "buckling-strain" => law.buckling_strain = number()?,
                "density" => law.density = number()?,
                _ => return Err(format!("there is no key `{key}`; known are {KEYS}")),
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
