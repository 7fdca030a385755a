//! The quantity that determines the color of an element.

use crate::app::report::ReportError;
use crate::app::results::Fields;

/// Preferred fields if none is requested, in this order.
const PREFERRED: [&str; 3] = ["von_mises_stress", "energy_density", "fiber_alignment"];

/// One value per element, with its name and unit.
#[derive(Clone, Debug)]
pub(super) struct Quantity {
    /// The name of the quantity.
    pub(super) label: String,
    /// The unit without prefix; empty for a dimensionless quantity.
    pub(super) unit: &'static str,
    /// The values of all elements.
    pub(super) values: Vec<f64>,
}

impl Quantity {
    /// Returns the requested field, or else the first preferred one that exists, or else the magnitude of the
    /// displacement. A vector field gives the lengths of its vectors, a field of points their mean over the nodes of
    /// each element. Returns `None` if no field is requested and none of these exists.
    ///
    /// # Errors
    /// Returns [`ReportError::NoField`] if the requested field does not exist.
    pub(super) fn find(fields: &Fields, name: Option<&str>) -> Result<Option<Self>, ReportError> {
        if let Some(name) = name {
            return Self::named(fields, name)
                .map(Some)
                .ok_or_else(|| ReportError::NoField(name.into(), available(fields)));
        }
        let preferred = PREFERRED.into_iter().chain(["displacement"]);
        Ok(preferred.filter_map(|name| Self::named(fields, name)).next())
    }

    fn named(fields: &Fields, name: &str) -> Option<Self> {
        let values = if let Some(values) = fields.cell_scalar(name) {
            values.to_vec()
        } else if let Some(values) = fields.cell_integer(name) {
            values.iter().map(|&value| value as f64).collect()
        } else if let Some(values) = fields.cell_vector(name) {
            values.iter().map(length).collect()
        } else {
            let values = fields.point_vector(name)?;
            let at = |node: &u32| values.get(*node as usize).map_or(0.0, length);
            fields.elements.iter().map(|nodes| nodes.iter().map(at).sum::<f64>() / nodes.len() as f64).collect()
        };
        let (label, unit) = describe(name);
        Some(Self { label, unit, values })
    }
}

fn length([x, y, z]: &[f64; 3]) -> f64 {
    (x * x + y * y + z * z).sqrt()
}

fn available(fields: &Fields) -> Vec<String> {
    let scalars = fields.cell_scalars.iter().map(|(name, _)| name);
    let integers = fields.cell_integers.iter().map(|(name, _)| name);
    let vectors = fields.cell_vectors.iter().chain(&fields.point_vectors).map(|(name, _)| name);
    scalars.chain(integers).chain(vectors).cloned().collect()
}

/// Returns the label and the unit of a field.
fn describe(name: &str) -> (String, &'static str) {
    let (label, unit) = match name {
        "von_mises_stress" => ("von Mises stress", "Pa"),
        "energy_density" => ("energy density", "J/m\u{b3}"),
        "displacement" => ("displacement", "m"),
        "fiber_alignment" => ("fiber alignment (largest eigenvalue of \u{3a9} \u{2212} 1/3)", ""),
        "stretch_max" => ("largest fiber stretch", ""),
        "rve_iterations" => ("RVE iterations", ""),
        "rve_status" => ("RVE status", ""),
        other => return (other.replace('_', " "), ""),
    };
    (label.into(), unit)
}
