//! Color maps that stay ordered in grayscale and for color-blind readers.

/// Control points of the color map viridis (Smith and van der Walt, matplotlib; public domain), equally spaced from 0
/// to 1.
const VIRIDIS: [[u8; 3]; 11] = [
    [68, 1, 84],
    [72, 36, 117],
    [65, 68, 135],
    [53, 95, 141],
    [42, 120, 142],
    [33, 145, 140],
    [34, 168, 132],
    [68, 191, 112],
    [122, 209, 81],
    [189, 223, 38],
    [253, 231, 37],
];

/// Returns the viridis color of a number in `[0, 1]`; numbers outside are clamped, NaN gives the color of 0.
pub(crate) fn viridis(place: f64) -> [u8; 3] {
    let last = VIRIDIS.len() - 1;
    let place = if place.is_nan() { 0.0 } else { place.clamp(0.0, 1.0) * last as f64 };
    let lower = (place as usize).min(last - 1);
    mix(VIRIDIS[lower], VIRIDIS[lower + 1], place - lower as f64)
}

/// The colors of the axes x, y and z, distinguishable for color-blind readers (Okabe and Ito, Color universal design).
pub(crate) const AXES: [[u8; 3]; 3] = [[213, 94, 0], [0, 158, 115], [0, 114, 178]];

/// Returns the color of a number in `[-1, 1]` in a diverging map from blue (-1) through gray (0) to red (1). Numbers
/// outside are clamped; NaN gives gray. The ends are those of the map RdBu (Harrower and Brewer, ColorBrewer); the gray
/// is dark enough for thin lines on white.
pub(crate) fn diverging(place: f64) -> [u8; 3] {
    const BELOW: [[u8; 3]; 4] = [[176, 182, 188], [103, 169, 207], [33, 102, 172], [5, 48, 97]];
    const ABOVE: [[u8; 3]; 4] = [[176, 182, 188], [239, 138, 98], [190, 30, 45], [103, 0, 31]];
    let side = if place < 0.0 { BELOW } else { ABOVE };
    let place = if place.is_nan() { 0.0 } else { place.abs().min(1.0) * 3.0 };
    let lower = (place as usize).min(2);
    mix(side[lower], side[lower + 1], place - lower as f64)
}

/// Interpolates from `first` (`part = 0`) to `second` (`part = 1`).
pub(crate) fn mix(first: [u8; 3], second: [u8; 3], part: f64) -> [u8; 3] {
    std::array::from_fn(|c| {
        let (from, to) = (f64::from(first[c]), f64::from(second[c]));
        (from + part.clamp(0.0, 1.0) * (to - from)).round() as u8
    })
}

/// Darkens a color; `light = 1` leaves it unchanged.
pub(super) fn shade(color: [u8; 3], light: f64) -> [u8; 3] {
    color.map(|part| (f64::from(part) * light).round().clamp(0.0, 255.0) as u8)
}

/// Returns the numbers at the ends of the color map: the range of all finite values, or, if a few outliers would leave
/// the others with one color, the range from the 1st to the 99th percentile.
pub(crate) fn range(values: &[f64]) -> (f64, f64) {
    let mut sorted: Vec<f64> = values.iter().copied().filter(|value| value.is_finite()).collect();
    sorted.sort_by(f64::total_cmp);
    let (Some(&low), Some(&high)) = (sorted.first(), sorted.last()) else { return (0.0, 1.0) };
    let at = |part: f64| sorted[(part * (sorted.len() - 1) as f64).round() as usize];
    let (inner_low, inner_high) = (at(0.01), at(0.99));
    let outliers = inner_high > inner_low && high - low > 1.5 * (inner_high - inner_low);
    let (low, high) = if outliers { (inner_low, inner_high) } else { (low, high) };
    // A uniform field gets a range around its value, so that it has a color and a color bar.
    if high > low { (low, high) } else { (low - 0.5 * low.abs().max(1e-300), high + 0.5 * high.abs().max(1e-300)) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn viridis_becomes_lighter_with_increasing_numbers() {
        let gray = |[r, g, b]: [u8; 3]| 0.299 * f64::from(r) + 0.587 * f64::from(g) + 0.114 * f64::from(b);
        let grays: Vec<f64> = (0..=50).map(|k| gray(viridis(f64::from(k) / 50.0))).collect();
        assert!(grays.windows(2).all(|pair| pair[0] < pair[1]), "{grays:?}");
        assert_eq!((viridis(-1.0), viridis(2.0)), (VIRIDIS[0], VIRIDIS[10]));
        assert_eq!(viridis(f64::NAN), VIRIDIS[0]);
    }

    #[test]
    fn the_diverging_map_becomes_darker_on_both_sides_of_zero() {
        let gray = |[r, g, b]: [u8; 3]| 0.299 * f64::from(r) + 0.587 * f64::from(g) + 0.114 * f64::from(b);
        for side in [-1.0, 1.0] {
            let grays: Vec<f64> = (0..=30).map(|k| gray(diverging(side * f64::from(k) / 30.0))).collect();
            assert!(grays.windows(2).all(|pair| pair[0] > pair[1]), "{grays:?}");
        }
        let ([r, _, b], [cold, _, warm]) = (diverging(0.7), diverging(-0.7));
        assert!(r > b && warm > cold);
        assert_eq!((diverging(5.0), diverging(f64::NAN)), (diverging(1.0), diverging(0.0)));
    }

    #[test]
    fn the_range_of_colors_excludes_outliers() {
        let mut values: Vec<f64> = (0..1000).map(f64::from).collect();
        assert_eq!(range(&values), (0.0, 999.0));
        values[500] = 1e9;
        let (low, high) = range(&values);
        assert!(low >= 0.0 && high < 1000.0, "{low} {high}");
        assert!(range(&[2.0, 2.0]).0 < 2.0 && range(&[2.0]).1 > 2.0);
        assert!(range(&[0.0]).1 > range(&[0.0]).0);
        assert_eq!(range(&[f64::NAN]), (0.0, 1.0));
    }
}
