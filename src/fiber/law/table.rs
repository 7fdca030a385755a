//! A law from a table of measured points.

use super::FiberLaw;
use thiserror::Error;

/// Nominal stress over stretch from a table: monotone C1 cubics between the points, tangent lines beyond the ends.
///
/// The slopes at the points are those of Fritsch and Butland (SIAM J. Sci. Stat. Comput. 5 (1984) 300), in the weighted
/// form of PCHIP: at an inner point the weighted harmonic mean of the two adjacent secants, at an end that of a
/// parabola through three points, bounded such that the curve stays monotone (Fritsch and Carlson, SIAM J. Numer. Anal.
/// 17 (1980) 238). The energy is the exact integral of the cubics. Every cubic is expanded about the one of its two
/// points that is nearer to rest, so that small strains keep full precision.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    points: Vec<[f64; 2]>,
    /// One more piece than points; piece `k` ends at point `k`.
    pieces: Vec<Piece>,
    youngs_modulus: f64,
}

/// `s = s_0 + t (s_1 + t (s_2 + t s_3))` with `t = lambda - at`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Piece {
    at: f64,
    stress: [f64; 4],
    /// Energy at `at`.
    energy: f64,
}

/// The reason why points do not define a law. Points are counted from 0.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum TableError {
    /// The table has fewer than two points. Holds their number.
    #[error("the table has {0} points")]
    TooFew(usize),
    /// A stretch or a stress is NaN or infinite.
    #[error("a value of the point ({stretch}, {stress}) is not finite")]
    NotFinite {
        /// The point.
        point: usize,
        /// Its stretch.
        stretch: f64,
        /// Its stress.
        stress: f64,
    },
    /// A stretch is not positive.
    #[error("the stretch is {stretch}")]
    Stretch {
        /// The point.
        point: usize,
        /// Its stretch.
        stretch: f64,
    },
    /// The stretches are not strictly increasing.
    #[error("the stretch {stretch} follows {before}")]
    Order {
        /// The second of the two points.
        point: usize,
        /// The stretch before it.
        before: f64,
        /// Its stretch.
        stretch: f64,
    },
    /// The stress decreases with the stretch.
    #[error("the stress falls from {before} to {stress}")]
    Falls {
        /// The second of the two points.
        point: usize,
        /// The stress before it.
        before: f64,
        /// Its stress.
        stress: f64,
    },
    /// No point has stretch 1.
    #[error("no point has the stretch 1")]
    NoRest,
    /// The stress at stretch 1 is not 0.
    #[error("the stress at stretch 1 is {stress}")]
    RestStress {
        /// The point at stretch 1.
        point: usize,
        /// Its stress.
        stress: f64,
    },
    /// The slope at stretch 1 is not positive. Holds the point at stretch 1.
    #[error("the curve has no slope at stretch 1")]
    NoStiffness(usize),
}

impl TableError {
    /// The point that causes the error, from 0.
    pub fn point(&self) -> Option<usize> {
        match *self {
            Self::TooFew(_) | Self::NoRest => None,
            Self::NotFinite { point, .. }
            | Self::Stretch { point, .. }
            | Self::Order { point, .. }
            | Self::Falls { point, .. }
            | Self::RestStress { point, .. }
            | Self::NoStiffness(point) => Some(point),
        }
    }

    /// The requirement that the table violates, and advice on how to correct the table.
    pub fn advice(&self) -> [&'static str; 2] {
        match self {
            Self::TooFew(_) => ["at least two points: stretch, nominal stress in Pa", "add points"],
            Self::NotFinite { .. } => ["two finite numbers", "correct or remove the point"],
            Self::Stretch { .. } => {
                ["a stretch above 0 (1 is undeformed)", "give lengths over the reference length, not strains"]
            }
            Self::Order { .. } => {
                ["stretches that rise from point to point", "sort the points and keep one for each stretch"]
            }
            Self::Falls { .. } => [
                "stresses that never fall as the stretch rises",
                "smooth the measurement, or end the table before the fiber fails",
            ],
            Self::NoRest => [
                "a point at stretch 1 with stress 0",
                "add the point (1, 0); stretches are lengths over the reference length",
            ],
            Self::RestStress { .. } => [
                "stress 0 at stretch 1: an undeformed fiber carries no force",
                "shift the curve so that it passes through (1, 0)",
            ],
            Self::NoStiffness(_) => [
                "a positive slope at stretch 1: Young's modulus",
                "give the points next to it stresses other than 0; where the table starts or ends at 1, add one beyond",
            ],
        }
    }
}

impl Table {
    /// Makes the law through `points`: stretch and nominal stress in Pa, with stretches strictly increasing and
    /// stresses nondecreasing, one point at `[1.0, 0.0]` and a positive slope there.
    ///
    /// # Errors
    /// Returns [`TableError`] if the points violate one of these conditions.
    pub fn new(points: Vec<[f64; 2]>) -> Result<Self, TableError> {
        let rest = check(&points)?;
        let slopes = slopes(&points);
        let youngs_modulus = slopes[rest];
        if youngs_modulus.is_nan() || youngs_modulus <= 0.0 {
            return Err(TableError::NoStiffness(rest));
        }
        Ok(Self { pieces: pieces(&points, &slopes, rest), points, youngs_modulus })
    }

    /// The points: stretch and nominal stress in Pa.
    pub fn points(&self) -> &[[f64; 2]] {
        &self.points
    }

    #[inline(always)]
    fn piece(&self, stretch: f64) -> (&Piece, f64) {
        let number = self.points.partition_point(|point| point[0] <= stretch);
        let piece = &self.pieces[number];
        (piece, stretch - piece.at)
    }
}

/// Checks the points and returns the index of the point at rest.
fn check(points: &[[f64; 2]]) -> Result<usize, TableError> {
    if points.len() < 2 {
        return Err(TableError::TooFew(points.len()));
    }
    for (point, &[stretch, stress]) in points.iter().enumerate() {
        if !(stretch.is_finite() && stress.is_finite()) {
            return Err(TableError::NotFinite { point, stretch, stress });
        }
        if stretch <= 0.0 {
            return Err(TableError::Stretch { point, stretch });
        }
    }
    for (point, pair) in (1..).zip(points.windows(2)) {
        let ([before, stress_before], [stretch, stress]) = (pair[0], pair[1]);
        if stretch <= before {
            return Err(TableError::Order { point, before, stretch });
        }
        if stress < stress_before {
            return Err(TableError::Falls { point, before: stress_before, stress });
        }
    }
    let rest = points.iter().position(|point| point[0] == 1.0).ok_or(TableError::NoRest)?;
    let stress = points[rest][1];
    if stress == 0.0 { Ok(rest) } else { Err(TableError::RestStress { point: rest, stress }) }
}

/// The slopes of the curve at the points.
fn slopes(points: &[[f64; 2]]) -> Vec<f64> {
    let width: Vec<f64> = points.windows(2).map(|pair| pair[1][0] - pair[0][0]).collect();
    let secant: Vec<f64> = points.windows(2).zip(&width).map(|(pair, h)| (pair[1][1] - pair[0][1]) / h).collect();
    let last = secant.len() - 1;
    if last == 0 {
        return vec![secant[0]; 2];
    }
    let mut slopes = vec![end_slope([width[0], width[1]], [secant[0], secant[1]])];
    for k in 1..=last {
        let (left, right) = (2.0 * width[k] + width[k - 1], width[k] + 2.0 * width[k - 1]);
        // The slope is 0 if a secant is 0.
        slopes.push((left + right) / (left / secant[k - 1] + right / secant[k]));
    }
    slopes.push(end_slope([width[last], width[last - 1]], [secant[last], secant[last - 1]]));
    slopes
}

/// The slope at an end, from the widths and secants of the two intervals adjacent to it.
fn end_slope(width: [f64; 2], secant: [f64; 2]) -> f64 {
    let parabola = ((2.0 * width[0] + width[1]) * secant[0] - width[0] * secant[1]) / (width[0] + width[1]);
    parabola.clamp(0.0, 3.0 * secant[0])
}

/// Returns tangent line, cubics and tangent line, with their energies accumulated from rest outward.
fn pieces(points: &[[f64; 2]], slopes: &[f64], rest: usize) -> Vec<Piece> {
    let line = |k: usize| Piece { at: points[k][0], stress: [points[k][1], slopes[k], 0.0, 0.0], energy: 0.0 };
    // The cubic between points `k` and `far`, expanded about point `k`.
    let cubic = |k: usize, far: usize| {
        let (h, rise) = (points[far][0] - points[k][0], points[far][1] - points[k][1]);
        let secant = rise / h;
        let second = (3.0 * secant - 2.0 * slopes[k] - slopes[far]) / h;
        let third = (slopes[k] + slopes[far] - 2.0 * secant) / (h * h);
        Piece { stress: [points[k][1], slopes[k], second, third], ..line(k) }
    };
    let last = points.len() - 1;
    let mut pieces = vec![Piece::default(); points.len() + 1];
    let mut energy = 0.0;
    for k in rest..=last {
        pieces[k + 1] = Piece { energy, ..if k < last { cubic(k, k + 1) } else { line(k) } };
        energy = if k < last { pieces[k + 1].energy(points[k + 1][0] - points[k][0]) } else { energy };
    }
    energy = 0.0;
    for k in (0..=rest).rev() {
        pieces[k] = Piece { energy, ..if k > 0 { cubic(k, k - 1) } else { line(k) } };
        energy = if k > 0 { pieces[k].energy(points[k - 1][0] - points[k][0]) } else { energy };
    }
    pieces
}

impl Piece {
    #[inline(always)]
    fn stress(&self, t: f64) -> (f64, f64) {
        let [a, b, c, d] = self.stress;
        (a + t * (b + t * (c + t * d)), b + t * (2.0 * c + 3.0 * t * d))
    }

    #[inline(always)]
    fn energy(&self, t: f64) -> f64 {
        let [a, b, c, d] = self.stress;
        self.energy + t * (a + t * (b / 2.0 + t * (c / 3.0 + t * d / 4.0)))
    }
}

impl FiberLaw for Table {
    fn name(&self) -> &str {
        "table"
    }

    /// Stretches and stresses, alternating.
    fn parameters(&self) -> Vec<(&'static str, f64)> {
        self.points.iter().flat_map(|&[stretch, stress]| [("stretch", stretch), ("stress", stress)]).collect()
    }

    fn youngs_modulus(&self) -> f64 {
        self.youngs_modulus
    }

    fn stress(&self, stretch: f64) -> (f64, f64) {
        let (piece, t) = self.piece(stretch);
        piece.stress(t)
    }

    fn energy(&self, stretch: f64) -> f64 {
        let (piece, t) = self.piece(stretch);
        piece.energy(t)
    }
}
