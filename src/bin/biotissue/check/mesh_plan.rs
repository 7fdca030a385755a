//! Dimensions and element quality of the mesh, in the plan.

use std::collections::BTreeMap;

use biotissue::fem::mesh::{ElementQuality, Mesh};
use serde::Serialize;

/// The dimensions of the body and the quality of its elements.
#[derive(Serialize)]
pub struct MeshPlan {
    /// The lowest and the highest coordinates, m.
    bounding_box: [[f64; 3]; 2],
    /// Volume of the body, m^3.
    volume: f64,
    /// Area of each surface, m^2.
    surface_areas: BTreeMap<String, f64>,
    /// The mean ratio of the elements; indices of elements count from 0.
    quality: Option<ElementQuality>,
}

impl MeshPlan {
    pub fn new(mesh: &Mesh) -> Self {
        Self {
            bounding_box: mesh.bounding_box(),
            volume: mesh.volume(),
            surface_areas: mesh.surfaces().iter().map(|each| (each.name.clone(), mesh.surface_area(each))).collect(),
            quality: ElementQuality::of(&mesh.element_qualities()),
        }
    }

    /// Returns the lines of the plan about the whole body.
    pub fn text(&self) -> Vec<String> {
        let [low, high] = self.bounding_box.map(|position| position.map(rounded));
        let mut lines = vec![format!("box        {low:?} to {high:?} m, volume {:.4e} m^3", self.volume)];
        lines.extend(self.quality.map(|ElementQuality { minimum, worst, median }| {
            format!("quality    {minimum:.3} (element {worst}) or better, median {median:.3}; mean ratio, 1 is ideal")
        }));
        lines
    }

    /// Returns the name of a surface with its area.
    pub fn with_area(&self, surface: &str) -> String {
        match self.surface_areas.get(surface) {
            Some(area) => format!("{surface} ({area:.4e} m^2)"),
            None => surface.to_owned(),
        }
    }
}

/// Rounds to five significant digits.
fn rounded(x: f64) -> f64 {
    format!("{x:.4e}").parse().unwrap_or(x)
}
