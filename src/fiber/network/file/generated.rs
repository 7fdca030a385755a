//! The part of a sidecar that holds the parameters of the generator.

use serde::{Deserialize, Serialize};

use crate::fiber::network::generate::{Alignment, GenerateError, Kind, Recipe};

/// The parameters of the generator. An absent parameter was not requested.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Generated {
    /// `delaunay` or `voronoi`.
    pub kind: String,
    /// Points in the cube: the interior nodes of a Delaunay network, the cells of a Voronoi network.
    pub points: usize,
    /// The seed of the random numbers.
    pub seed: u64,
    /// The preferred direction of the fibers, as given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub align: Option<[f64; 3]>,
    /// The requested second-order parameter.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub strength: Option<f64>,
    /// Nodes joined by a fiber shorter than this fraction of the mean spacing were merged.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub merge: Option<f64>,
    /// The minimum distance between two points over the mean spacing, if it is not the default of [`Recipe::new`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub min_distance: Option<f64>,
    /// Fibers shorter than this fraction of the cube's edge were removed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shorter_than: Option<f64>,
    /// The program and its version.
    pub program: String,
}

impl Generated {
    /// Parameters for this version of the program, without optional ones.
    #[must_use]
    pub fn new(kind: &str, points: usize, seed: u64) -> Self {
        let program = concat!("biotissue ", env!("CARGO_PKG_VERSION")).into();
        Self {
            kind: kind.into(),
            points,
            seed,
            align: None,
            strength: None,
            merge: None,
            min_distance: None,
            shorter_than: None,
            program,
        }
    }

    /// Parameters for this version of the program, from a recipe.
    #[must_use]
    pub fn by(recipe: &Recipe, points: usize) -> Self {
        let plain = Recipe::new(recipe.kind, recipe.seed);
        Self {
            align: recipe.alignment.map(|alignment| alignment.direction()),
            strength: recipe.alignment.map(|alignment| alignment.strength()),
            merge: (recipe.merge > 0.0).then_some(recipe.merge),
            min_distance: (recipe.apart != plain.apart).then_some(recipe.apart),
            shorter_than: recipe.shorter_than,
            ..Self::new(recipe.kind.name(), points, recipe.seed)
        }
    }

    /// Returns the recipe; `None` if the kind is unknown. It gives the same network for the same number of points.
    ///
    /// # Errors
    /// Returns [`GenerateError`] if the direction or the strength is out of range.
    pub fn recipe(&self) -> Result<Option<Recipe>, GenerateError> {
        let Some(kind) = Kind::ALL.into_iter().find(|kind| kind.name() == self.kind) else { return Ok(None) };
        let alignment = self.align.map(|align| Alignment::new(align, self.strength.unwrap_or(0.0))).transpose()?;
        let (merge, shorter_than) = (self.merge.unwrap_or(0.0), self.shorter_than);
        let plain = Recipe::new(kind, self.seed);
        let apart = self.min_distance.unwrap_or(plain.apart);
        Ok(Some(Recipe { apart, merge, alignment, shorter_than, ..plain }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_makes_the_network_again() {
        let alignment = Some(Alignment::new([1.0, 0.1, -0.2], 0.3).unwrap());
        let plain = Recipe::new(Kind::Delaunay, 7);
        let special = Recipe { alignment, shorter_than: Some(0.02), ..Recipe::new(Kind::Voronoi, 3) };
        let near = Recipe { apart: 0.05, ..plain };
        for recipe in [plain, special, Recipe { merge: 0.0, ..special }, near, Recipe { apart: 0.0, ..plain }] {
            let text = toml::to_string(&Generated::by(&recipe, 20)).unwrap();
            let read: Generated = toml::from_str(&text).unwrap();
            let again = read.recipe().unwrap().unwrap();
            assert_eq!(again, recipe);
            assert_eq!(again.of_points(read.points).unwrap(), recipe.of_points(20).unwrap());
        }
        assert_eq!(Generated::new("gel", 1, 1).recipe().unwrap(), None);
        assert!(Generated { align: Some([0.0; 3]), ..Generated::new("voronoi", 1, 1) }.recipe().is_err());
    }
}
