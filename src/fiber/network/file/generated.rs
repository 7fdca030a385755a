//! The table `[generated]` of a sidecar: the parameters of the generator.

use serde::{Deserialize, Serialize};

use crate::fiber::network::generate::{Alignment, GenerateError, GeneratorParams, Kind};

/// The parameters of the generator; `None` stands for a parameter that was not requested.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Generated {
    /// `delaunay` or `voronoi`.
    pub kind: String,
    /// Number of points in the cube: the interior nodes of a Delaunay network, the cells of a Voronoi network.
    pub points: usize,
    /// The seed of the random numbers.
    pub seed: u64,
    /// The preferred direction of the fibers, as given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub align: Option<[f64; 3]>,
    /// The requested order parameter.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub strength: Option<f64>,
    /// Nodes joined by a fiber shorter than this fraction of the mean spacing of the points were merged.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub merge: Option<f64>,
    /// The minimum distance between two points as a fraction of the mean spacing, if it is not the default of
    /// [`GeneratorParams::new`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub min_distance: Option<f64>,
    /// Fibers shorter than this fraction of the cube's edge were removed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub shorter_than: Option<f64>,
    /// The program and its version.
    pub program: String,
}

impl Generated {
    /// Creates parameters for this version of the program, without optional ones.
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

    /// Creates parameters for this version of the program from those of the generator and the number of points.
    pub fn by(params: &GeneratorParams, points: usize) -> Self {
        let plain = GeneratorParams::new(params.kind, params.seed);
        Self {
            align: params.alignment.map(|alignment| alignment.direction()),
            strength: params.alignment.map(|alignment| alignment.strength()),
            merge: (params.merge_length > 0.0).then_some(params.merge_length),
            min_distance: (params.min_distance != plain.min_distance).then_some(params.min_distance),
            shorter_than: params.min_length,
            ..Self::new(params.kind.name(), points, params.seed)
        }
    }

    /// Returns the parameters of the generator; `None` if the kind is unknown. They give the same network for the same
    /// number of points.
    ///
    /// # Errors
    /// Returns [`GenerateError`] if the direction or the strength is out of range.
    pub fn params(&self) -> Result<Option<GeneratorParams>, GenerateError> {
        let Some(kind) = Kind::ALL.into_iter().find(|kind| kind.name() == self.kind) else { return Ok(None) };
        let alignment = self.align.map(|align| Alignment::new(align, self.strength.unwrap_or(0.0))).transpose()?;
        let (merge_length, min_length) = (self.merge.unwrap_or(0.0), self.shorter_than);
        let plain = GeneratorParams::new(kind, self.seed);
        let min_distance = self.min_distance.unwrap_or(plain.min_distance);
        Ok(Some(GeneratorParams { min_distance, merge_length, alignment, min_length, ..plain }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn written_parameters_are_read_back_and_generate_the_same_network() {
        let alignment = Some(Alignment::new([1.0, 0.1, -0.2], 0.3).unwrap());
        let plain = GeneratorParams::new(Kind::Delaunay, 7);
        let special = GeneratorParams { alignment, min_length: Some(0.02), ..GeneratorParams::new(Kind::Voronoi, 3) };
        let near = GeneratorParams { min_distance: 0.05, ..plain };
        for params in [
            plain,
            special,
            GeneratorParams { merge_length: 0.0, ..special },
            near,
            GeneratorParams { min_distance: 0.0, ..plain },
        ] {
            let text = toml::to_string(&Generated::by(&params, 20)).unwrap();
            let read: Generated = toml::from_str(&text).unwrap();
            let again = read.params().unwrap().unwrap();
            assert_eq!(again, params);
            assert_eq!(again.of_points(read.points).unwrap(), params.of_points(20).unwrap());
        }
        assert_eq!(Generated::new("gel", 1, 1).params().unwrap(), None);
        assert!(Generated { align: Some([0.0; 3]), ..Generated::new("voronoi", 1, 1) }.params().is_err());
    }
}
