//! Positions of the cells of a dogbone along its length.

use super::DogboneShape;

/// Returns the smallest number of cells of at most this size, at least 1; an excess of up to 1e-9 cells is ignored.
pub(super) fn cells(length: f64, size: f64) -> usize {
    ((length / size - 1e-9).ceil() as usize).max(1)
}

/// The numbers of cells along x in one half of the dogbone, and their grading in the fillets.
pub(super) struct AxialGrading {
    pub grip: usize,
    fillet: usize,
    half_gauge: usize,
    grading: Grading,
}

impl AxialGrading {
    /// Chooses cells whose size is proportional to the local width and equal to `element_size` (m) in the grips.
    pub fn new(shape: &DogboneShape, element_size: f64) -> Self {
        let grading = Grading::new(shape);
        Self {
            grip: cells(shape.grip_length, element_size),
            fillet: cells(grading.total() * shape.grip_width, element_size),
            half_gauge: cells(0.5 * shape.gauge_length(), element_size * shape.gauge_width / shape.grip_width),
            grading,
        }
    }

    /// Returns the number of cells along the whole length.
    pub fn cells(&self) -> usize {
        let half = self.grip.saturating_add(self.fillet).saturating_add(self.half_gauge);
        half.saturating_mul(2)
    }

    /// Returns the position along x and the width of each plane of nodes across the dogbone, m.
    pub fn columns(&self, shape: &DogboneShape) -> Vec<(f64, f64)> {
        let middle = 0.5 * shape.length;
        let gauge_end = 0.5 * shape.gauge_length();
        let fillet_end = middle - shape.grip_length;
        let fraction = |step: usize, count: usize| step as f64 / count as f64;
        // The distances from the middle, ascending, each with the width there.
        let mut half = Vec::with_capacity(self.cells() / 2 + 1);
        half.extend((0..=self.half_gauge).map(|n| (gauge_end * fraction(n, self.half_gauge), shape.gauge_width)));
        half.extend((1..self.fillet).map(|n| {
            let beyond = self.grading.at(fraction(n, self.fillet));
            (gauge_end + beyond, shape.width(beyond))
        }));
        half.extend(
            (0..self.grip).map(|n| (fillet_end + shape.grip_length * fraction(n, self.grip), shape.grip_width)),
        );
        half.push((middle, shape.grip_width));
        let left = half.iter().rev().map(|&(x, width)| (middle - x, width));
        left.chain(half.iter().skip(1).map(|&(x, width)| (middle + x, width))).collect()
    }
}

/// The tabulated integral of 1/width along a fillet. Equal increments of the integral define cells whose length is
/// proportional to the width.
struct Grading {
    step: f64,
    /// The integral up to each multiple of `step`.
    integral: Vec<f64>,
}

impl Grading {
    const STEPS: usize = 512;

    fn new(shape: &DogboneShape) -> Self {
        let step = shape.fillet_length() / Self::STEPS as f64;
        let density = |k: usize| 1.0 / shape.width(step * k as f64);
        let mut sum = 0.0;
        let mut integral = vec![0.0];
        integral.extend((1..=Self::STEPS).map(|k| {
            sum += 0.5 * step * (density(k - 1) + density(k));
            sum
        }));
        Self { step, integral }
    }

    fn total(&self) -> f64 {
        self.integral.last().copied().unwrap_or(0.0)
    }

    /// Returns the distance from the end of the gauge, m, at which the integral reaches this fraction of its total.
    fn at(&self, fraction: f64) -> f64 {
        let target = fraction * self.total();
        let k = self.integral.partition_point(|&sum| sum <= target).clamp(1, Self::STEPS);
        let (below, above) = (self.integral[k - 1], self.integral[k]);
        self.step * ((k - 1) as f64 + (target - below) / (above - below))
    }
}
