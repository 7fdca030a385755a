//! The dogbone mesh: a flat tensile sample with wide grips, circular fillets and a narrow gauge.

use super::axial_grading::{AxialGrading, cells};
use super::grid::Grid;
use super::{ShapeError, positive};
use crate::fem::mesh::{Mesh, Surface};

/// The dimensions of a dogbone, in meters. The straight gauge is the length without grips and fillets.
///
/// ```text
///     |<-grip->|<-fillet->|<---gauge--->|<-fillet->|<-grip->|
///     +--------.                                   .--------+
///     |          `-._                         _.-'          |      y
///     |               `-----------------------'             |      |
///     |               .-----------------------.             |      +-- x
///     |          .-'                            `-.         |
///     +--------'                                   `--------+
/// ```
///
/// The default is 38 mm long and 2.5 mm thick, with grips of 6 mm by 10 mm, fillets of radius 12.5 mm (7.5 mm long)
/// and a straight gauge of 11 mm by 5 mm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DogboneShape {
    /// Length of the sample along x.
    pub length: f64,
    /// Length of each grip along x.
    pub grip_length: f64,
    /// Width of the grips along y.
    pub grip_width: f64,
    /// Width of the gauge along y.
    pub gauge_width: f64,
    /// Radius of the fillets, which are tangent to the gauge and end at the width of the grips. A radius of at least
    /// twice the overhang `(grip_width - gauge_width) / 2` limits their slope to 60 degrees and avoids distorted
    /// elements.
    pub fillet_radius: f64,
    /// Thickness of the sample along z.
    pub thickness: f64,
}

impl Default for DogboneShape {
    fn default() -> Self {
        Self {
            length: 0.038,
            grip_length: 0.006,
            grip_width: 0.010,
            gauge_width: 0.005,
            fillet_radius: 0.0125,
            thickness: 0.0025,
        }
    }
}

impl DogboneShape {
    /// Checks the dimensions.
    ///
    /// # Errors
    /// Returns a [`ShapeError`] for the first invalid dimension.
    pub fn check(&self) -> Result<(), ShapeError> {
        positive("the length", self.length)?;
        positive("the grip length", self.grip_length)?;
        positive("the grip width", self.grip_width)?;
        positive("the gauge width", self.gauge_width)?;
        positive("the fillet radius", self.fillet_radius)?;
        positive("the thickness", self.thickness)?;
        let Self { length, grip_width, gauge_width, fillet_radius, .. } = *self;
        if gauge_width >= grip_width {
            return Err(ShapeError::GaugeTooWide { gauge_width, grip_width });
        }
        let least = 2.0 * self.overhang();
        if fillet_radius < least {
            return Err(ShapeError::FilletTooSmall { fillet_radius, least });
        }
        let taken = 2.0 * (self.grip_length + self.fillet_length());
        if taken >= length {
            return Err(ShapeError::NoGauge { taken, length });
        }
        Ok(())
    }

    /// Returns the length of each fillet along x, m: `sqrt(2 R d - d^2)` with the radius `R` and the overhang `d` of
    /// the grip over the gauge.
    pub fn fillet_length(&self) -> f64 {
        let overhang = self.overhang();
        (overhang * (2.0 * self.fillet_radius - overhang)).sqrt()
    }

    /// Returns the length of the straight gauge, m.
    pub fn gauge_length(&self) -> f64 {
        self.length - 2.0 * (self.grip_length + self.fillet_length())
    }

    /// Returns the volume of the two grips, m^3.
    pub fn grip_volume(&self) -> f64 {
        2.0 * self.grip_length * self.grip_width * self.thickness
    }

    /// Returns the volume between the grips, with the arcs of the fillets integrated exactly, m^3.
    pub fn gauge_volume(&self) -> f64 {
        let (radius, run) = (self.fillet_radius, self.fillet_length());
        let under_arc = 0.5 * (run * (radius * radius - run * run).sqrt() + radius * radius * (run / radius).asin());
        let fillet = (self.gauge_width + 2.0 * radius) * run - 2.0 * under_arc;
        (2.0 * fillet + self.gauge_length() * self.gauge_width) * self.thickness
    }

    fn overhang(&self) -> f64 {
        0.5 * (self.grip_width - self.gauge_width)
    }

    /// Returns the width of the sample at a distance from the end of the straight gauge (zero within the gauge).
    pub(super) fn width(&self, beyond: f64) -> f64 {
        let run = beyond.min(self.fillet_length());
        let radius = self.fillet_radius;
        self.gauge_width + 2.0 * (radius - (radius * radius - run * run).sqrt())
    }
}

/// Creates a dogbone mesh with approximately this element size (m). The left end is at `x = 0`; the sample is centered
/// at `y = 0` and `z = 0`.
///
/// `element_size` is the edge of the hexahedral cells in the grips; toward the gauge, the cells become smaller in
/// proportion to the width of the sample. The numbers of cells along all axes are even and the mesh is symmetric about
/// the three middle planes, so there are at least two layers through the thickness.
///
/// The regions are `grip` (both ends, of constant width) and `gauge` (the straight part and the fillets); the surfaces
/// are `left` (`x = 0`), `right` (`x = length`) and `sides` (the rest). The default shape has 2160 elements at an
/// element size of 0.002 m, with six cells across the gauge, and 13920 elements at 0.001 m.
///
/// # Errors
/// Returns a [`ShapeError`] if the dimensions are inconsistent, the elements are larger than the sample, or there are
/// too many of them.
pub fn dogbone(shape: &DogboneShape, element_size: f64) -> Result<Mesh, ShapeError> {
    shape.check()?;
    positive("the element size", element_size)?;
    for (what, limit) in [("grip width", shape.grip_width), ("length", shape.length)] {
        if element_size > limit {
            return Err(ShapeError::ElementTooLarge { element_size, what, limit });
        }
    }
    let grading = AxialGrading::new(shape, element_size);
    let [across, through] =
        [shape.grip_width, shape.thickness].map(|length| cells(0.5 * length, element_size).saturating_mul(2));
    // Because y is mirrored in the lower half instead of the upper one, cells in the fillets are cut along their
    // shorter diagonal.
    let grid = Grid::new([grading.cells(), across, through], Some([true, false, true]))?;
    let columns = grading.columns(shape);
    let centered = |step: usize, count: usize| step as f64 / count as f64 - 0.5;
    let nodes = grid.nodes(|i, j, k| {
        let (x, width) = columns[i];
        [x, width * centered(j, across), shape.thickness * centered(k, through)]
    });
    let elements = grid.elements(|[i, _, _]| {
        let in_grip = i < grading.grip || i >= grading.cells() - grading.grip;
        u32::from(!in_grip)
    });
    let sides = [(1, false), (1, true), (2, false), (2, true)].map(|(axis, upper)| grid.side(axis, upper)).concat();
    let surfaces = vec![
        Surface { name: "left".into(), faces: grid.side(0, false).into() },
        Surface { name: "right".into(), faces: grid.side(0, true).into() },
        Surface { name: "sides".into(), faces: sides.into() },
    ];
    Ok(Mesh::from_shape(nodes, elements, &["grip", "gauge"], surfaces)?)
}

#[cfg(test)]
mod tests {
    use super::super::assert_valid;
    use super::*;
    use std::collections::HashSet;

    const SHAPE: DogboneShape = DogboneShape {
        length: 0.038,
        grip_length: 0.006,
        grip_width: 0.010,
        gauge_width: 0.005,
        fillet_radius: 0.0125,
        thickness: 0.0025,
    };

    #[test]
    fn the_default_dimensions_are_those_documented() {
        assert_eq!(DogboneShape::default(), SHAPE);
        assert!((SHAPE.fillet_length() - 0.0075).abs() < 1e-15);
        assert!((SHAPE.gauge_length() - 0.011).abs() < 1e-15);
    }

    #[test]
    fn number_and_form_of_elements_by_size() {
        for (size, elements, gauge) in
            [(0.004, 768, 576), (0.003, 960, 768), (0.002, 2160, 1728), (0.001, 13_920, 11_040)]
        {
            let mesh = dogbone(&SHAPE, size).unwrap();
            assert_valid(&mesh);
            assert_eq!((mesh.elements().len(), mesh.elements_in(1).count()), (elements, gauge), "size {size}");
            let [sharpest, bluntest] = mesh.dihedral_range();
            assert!(sharpest > 20.0 && bluntest < 120.0, "angles of {sharpest} to {bluntest} degrees at size {size}");
        }
        let [sharpest, _] = dogbone(&SHAPE, 0.002).unwrap().dihedral_range();
        assert!(sharpest > 30.0, "{sharpest} degrees");
    }

    #[test]
    fn volumes_and_areas_are_those_of_the_shape() {
        let mut errors = Vec::new();
        for size in [0.002, 0.001, 0.0005] {
            let mesh = dogbone(&SHAPE, size).unwrap();
            let volumes = mesh.region_volumes();
            assert_eq!(mesh.regions(), ["grip", "gauge"]);
            assert!((volumes[0] / SHAPE.grip_volume() - 1.0).abs() < 1e-12);
            // The width is a convex function of x along a fillet, so the chords of the arcs overestimate the volume.
            errors.push(volumes[1] / SHAPE.gauge_volume() - 1.0);
            for end in ["left", "right"] {
                let area = mesh.surface_area(mesh.surface(end).unwrap());
                assert!((area / (SHAPE.grip_width * SHAPE.thickness) - 1.0).abs() < 1e-12);
            }
            // The area vectors of a closed surface sum to zero.
            let normals = mesh
                .surfaces()
                .iter()
                .flat_map(|surface| surface.faces.typed())
                .map(|(t, nodes)| mesh.area_vector(t, nodes));
            let sum = normals.fold([0.0; 3], |sum, normal| std::array::from_fn(|k| sum[k] + normal[k]));
            assert!(sum.iter().all(|x: &f64| x.abs() < 1e-16), "{sum:?}");
        }
        assert!(errors[0] > 0.0 && errors[0] < 0.01, "{errors:?}");
        assert!(errors.windows(2).all(|pair| pair[1] > 0.0 && pair[1] < 0.4 * pair[0]), "{errors:?}");
    }

    #[test]
    fn gauge_volume_agrees_with_quadrature() {
        let shape = DogboneShape { fillet_radius: 0.02, length: 0.05, ..SHAPE };
        let steps = 100_000;
        let step = shape.fillet_length() / f64::from(steps);
        let fillet: f64 = (0..steps).map(|k| step * shape.width(step * (f64::from(k) + 0.5))).sum();
        let volume = shape.thickness * (2.0 * fillet + shape.gauge_length() * shape.gauge_width);
        assert!((shape.gauge_volume() / volume - 1.0).abs() < 1e-9);
        assert!((shape.width(shape.fillet_length()) - shape.grip_width).abs() < 1e-15);
    }

    #[test]
    fn regions_and_fillets_have_the_expected_positions() {
        let mesh = dogbone(&SHAPE, 0.002).unwrap();
        let [low, high] = mesh.bounding_box();
        assert_eq!((low, high), ([0.0, -0.005, -0.00125], [0.038, 0.005, 0.00125]));
        for (element, &region) in mesh.region_of().iter().enumerate() {
            let from_end = |x: f64| x.min(SHAPE.length - x);
            let in_grip = mesh.positions(element).iter().all(|x| from_end(x[0]) < SHAPE.grip_length + 1e-12);
            assert_eq!(mesh.regions()[region as usize] == "grip", in_grip);
        }
        let on_the_edge = mesh.nodes().iter().filter(|[x, y, _]| {
            let beyond = (x - 0.019).abs() - 0.5 * SHAPE.gauge_length();
            beyond > 0.0 && beyond < 0.0074 && (2.0 * y.abs() - SHAPE.width(beyond)).abs() < 1e-12
        });
        // Five columns in each of two fillets, on two sides, with three nodes through the thickness.
        assert_eq!(on_the_edge.count(), 5 * 2 * 2 * 3);
    }

    #[test]
    fn the_mesh_is_symmetric() {
        let mesh = dogbone(&SHAPE, 0.002).unwrap();
        let place = |x: [f64; 3]| x.map(|x| (x * 1e9).round() as i64);
        let element = |corners: Vec<[f64; 3]>| {
            let mut corners: Vec<_> = corners.into_iter().map(place).collect();
            corners.sort_unstable();
            corners
        };
        let all: HashSet<_> = (0..mesh.elements().len()).map(|e| element(mesh.positions(e))).collect();
        for (axis, sum) in [(0, SHAPE.length), (1, 0.0), (2, 0.0)] {
            for e in 0..mesh.elements().len() {
                let mut image = mesh.positions(e);
                image.iter_mut().for_each(|x| x[axis] = sum - x[axis]);
                assert!(all.contains(&element(image)), "element {e} has no mirror image along axis {axis}");
            }
        }
    }

    #[test]
    fn invalid_dimensions_are_errors() {
        let message = |shape: DogboneShape, size| dogbone(&shape, size).unwrap_err().to_string();
        assert_eq!(message(SHAPE, 0.0), "the element size is 0: it must be positive and finite");
        assert_eq!(message(SHAPE, f64::NAN), "the element size is NaN: it must be positive and finite");
        assert_eq!(message(SHAPE, 0.02), "the element size 0.02 exceeds the grip width, 0.01");
        assert!(matches!(dogbone(&SHAPE, 1e-5), Err(ShapeError::TooManyElements(50_000_001..))));
        assert!(matches!(dogbone(&SHAPE, 1e-300), Err(ShapeError::TooManyElements(u64::MAX))));
        assert_eq!(
            message(DogboneShape { thickness: -1.0, ..SHAPE }, 0.002),
            "the thickness is -1: it must be positive and finite"
        );
        assert_eq!(
            message(DogboneShape { gauge_width: 0.01, ..SHAPE }, 0.002),
            "the gauge, 0.01 wide, is not narrower than the grips, 0.01 wide"
        );
        assert_eq!(
            message(DogboneShape { fillet_radius: 0.004, ..SHAPE }, 0.002),
            "a fillet radius of 0.004 is too small for well-shaped elements: it must be at least 0.005"
        );
        let error = dogbone(&DogboneShape { length: 0.02, ..SHAPE }, 0.002).unwrap_err();
        assert!(matches!(error, ShapeError::NoGauge { length: 0.02, .. }), "{error}");
    }
}
