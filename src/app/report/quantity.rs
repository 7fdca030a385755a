//! The quantities of a field file that give colors to elements: one number per element each.

use nalgebra::Matrix3;

use crate::app::report::ReportError;
use crate::app::results::Fields;

/// Preferred fields if none is requested, in this order.
const PREFERRED: [&str; 3] = ["von_mises_stress", "energy_density", "fiber_alignment"];

/// The components of a symmetric tensor that differ, with their places in its nine numbers.
const COMPONENTS: [(&str, usize); 6] = [("xx", 0), ("yy", 4), ("zz", 8), ("xy", 1), ("yz", 5), ("xz", 2)];

/// The symmetric tensors whose components are quantities.
const SYMMETRIC: [&str; 2] = ["cauchy_stress", "green_lagrange_strain"];

/// The vectors whose components are the principal values of a tensor.
const PRINCIPAL: [&str; 2] = ["principal_stresses", "principal_stretches"];

/// The numbers that describe fibers. The files have 0 in elements without fibers.
const OF_FIBERS: [&str; 3] = ["fiber_alignment", "stretch_min", "stretch_max"];

/// One value per element, with its name and unit.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Quantity {
    /// The name in options: that of the field, with the component.
    pub(super) name: String,
    /// The name for readers.
    pub(super) label: String,
    /// The unit without prefix; empty for a dimensionless quantity.
    pub(super) unit: &'static str,
    /// True for numbers of regions, networks and the like, which have no meaningful mean.
    pub(super) is_integer: bool,
    /// The values of all elements; NaN in elements without a value, as that of fibers where there are none.
    pub(super) values: Vec<f64>,
}

impl Quantity {
    fn new(name: &str, values: Vec<f64>, is_integer: bool) -> Self {
        let (label, unit) = describe(name);
        Self { name: name.into(), label, unit, is_integer, values }
    }

    /// Returns the requested quantity, or else the first preferred one that exists, or else the magnitude of the
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

    /// Returns the quantities of the elements, the preferred ones first.
    pub(super) fn all(fields: &Fields) -> Vec<Self> {
        let rest = available(fields).into_iter().filter(|name| !PREFERRED.contains(&name.as_str()));
        let of_elements = rest.filter(|name| fields.point_vector(name).is_none() && name != "fiber_direction");
        let names = PREFERRED.into_iter().map(str::to_owned).chain(of_elements);
        names.filter_map(|name| Self::named(fields, &name)).collect()
    }

    /// Returns the quantity of this name.
    pub(super) fn named(fields: &Fields, name: &str) -> Option<Self> {
        if let Some(values) = fields.cell_integer(name) {
            return Some(Self::new(name, values.iter().map(|&value| value as f64).collect(), true));
        }
        let values = if let Some(values) = fields.cell_scalar(name) {
            if OF_FIBERS.contains(&name) { of_fibers(fields, values) } else { values.to_vec() }
        } else if let Some(values) = fields.cell_vector(name) {
            values.iter().map(length).collect()
        } else if let Some(values) = component(fields, name) {
            values
        } else {
            let values = fields.point_vector(name)?;
            let at = |node: &u32| values.get(*node as usize).map_or(0.0, length);
            fields.elements.iter().map(|nodes| nodes.iter().map(at).sum::<f64>() / nodes.len() as f64).collect()
        };
        Some(Self::new(name, values, false))
    }
}

/// Returns a component of a tensor, a principal value, or the volume ratio.
fn component(fields: &Fields, name: &str) -> Option<Vec<f64>> {
    if name == "volume_ratio" {
        let gradients = fields.cell_tensor("deformation_gradient")?;
        return Some(gradients.iter().map(|f| Matrix3::from_row_slice(f).determinant()).collect());
    }
    let (field, part) = name.rsplit_once('_')?;
    if PRINCIPAL.contains(&field) {
        let place = ["1", "2", "3"].iter().position(|number| *number == part)?;
        return Some(fields.cell_vector(field)?.iter().map(|values| values[place]).collect());
    }
    let &(_, place) = COMPONENTS.iter().find(|(name, _)| *name == part && SYMMETRIC.contains(&field))?;
    Some(fields.cell_tensor(field)?.iter().map(|tensor| tensor[place]).collect())
}

/// Returns numbers that describe fibers, with NaN in elements without fibers: no fiber has the stretch 0.
fn of_fibers(fields: &Fields, values: &[f64]) -> Vec<f64> {
    let Some(stretches) = fields.cell_scalar("stretch_max") else { return values.to_vec() };
    let or_none = |(&value, &stretch): (&f64, &f64)| if stretch > 0.0 { value } else { f64::NAN };
    values.iter().zip(stretches).map(or_none).collect()
}

fn length([x, y, z]: &[f64; 3]) -> f64 {
    (x * x + y * y + z * z).sqrt()
}

/// Returns the names of all quantities.
fn available(fields: &Fields) -> Vec<String> {
    let mut names: Vec<String> = fields.cell_scalars.iter().map(|(name, _)| name.clone()).collect();
    for (name, _) in &fields.cell_vectors {
        match PRINCIPAL.contains(&name.as_str()) {
            true => names.extend((1..=3).map(|k| format!("{name}_{k}"))),
            false => names.push(name.clone()),
        }
    }
    // The means at the nodes come from fields of the elements, which are smoothed as well.
    let vectors = fields.point_vectors.iter().filter(|(name, _)| !name.starts_with("nodal_"));
    names.extend(vectors.map(|(name, _)| name.clone()));
    for (name, _) in &fields.cell_tensors {
        match name.as_str() {
            "deformation_gradient" => names.push("volume_ratio".into()),
            name if SYMMETRIC.contains(&name) => names.extend(COMPONENTS.iter().map(|(xy, _)| format!("{name}_{xy}"))),
            _ => {}
        }
    }
    names.extend(fields.cell_integers.iter().map(|(name, _)| name.clone()));
    names
}

/// Returns the label and the unit of a quantity.
fn describe(name: &str) -> (String, &'static str) {
    let (label, unit) = match name {
        "von_mises_stress" => ("von Mises stress", "Pa"),
        "energy_density" => ("energy density", "J/m\u{b3}"),
        "displacement" => ("displacement", "m"),
        "fiber_alignment" => ("fiber alignment (largest eigenvalue of \u{3a9} \u{2212} 1/3)", ""),
        "stretch_min" => ("smallest fiber stretch", ""),
        "stretch_max" => ("largest fiber stretch", ""),
        "volume_ratio" => ("volume ratio J", ""),
        "rve_iterations" => ("RVE iterations, sum over the step", ""),
        "rve_status" => ("RVE status (0 awake, 1 asleep, 2 not created, 3 deleted)", ""),
        other => {
            let readable = other
                .replace("principal_stresses", "principal stress")
                .replace("principal_stretches", "principal stretch")
                .replace("cauchy", "Cauchy")
                .replace("green_lagrange", "Green-Lagrange")
                .replace('_', " ");
            return (readable, if other.contains("stress") { "Pa" } else { "" });
        }
    };
    (label.into(), unit)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn components_of_tensors_and_principal_values_are_quantities() {
        let tensor: [f64; 9] = [1.0, 2.0, 3.0, 2.0, 5.0, 6.0, 3.0, 6.0, 9.0];
        let fields = Fields {
            elements: vec![[0, 1, 2, 3]].into(),
            cell_integers: vec![("region".into(), vec![4])],
            cell_vectors: vec![("principal_stretches".into(), vec![[3.0, 2.0, 1.0]])],
            cell_tensors: vec![
                ("cauchy_stress".into(), vec![tensor]),
                ("deformation_gradient".into(), vec![[2.0, 0.0, 0.0, 0.0, 3.0, 0.0, 0.0, 0.0, 1.0]]),
            ],
            ..Fields::default()
        };
        let value = |name: &str| Quantity::named(&fields, name).unwrap().values[0];
        let names = ["cauchy_stress_yz", "principal_stretches_2", "volume_ratio", "region"];
        assert_eq!(names.map(value), [6.0, 2.0, 6.0, 4.0]);
        let all = Quantity::all(&fields);
        assert_eq!(all.len(), 3 + 6 + 1 + 1);
        assert_eq!((all[0].label.as_str(), all[0].unit), ("principal stretch 1", ""));
        let stress = all.iter().find(|quantity| quantity.name == "cauchy_stress_xx").unwrap();
        assert_eq!((stress.label.as_str(), stress.unit, stress.is_integer), ("Cauchy stress xx", "Pa", false));
        assert!(all.last().unwrap().is_integer && Quantity::named(&fields, "cauchy_stress_1").is_none());
    }

    #[test]
    fn elements_without_fibers_have_no_stretch() {
        let fields = Fields {
            elements: vec![[0, 1, 2, 3]; 3].into(),
            cell_scalars: vec![
                ("energy_density".into(), vec![0.0, 1.0, 2.0]),
                ("fiber_alignment".into(), vec![0.0, 0.0, 0.2]),
                ("stretch_max".into(), vec![0.0, 1.0, 1.4]),
            ],
            ..Fields::default()
        };
        let values = |name: &str| Quantity::named(&fields, name).unwrap().values;
        assert_eq!(values("energy_density"), [0.0, 1.0, 2.0]);
        for (name, expected) in [("fiber_alignment", [0.0, 0.2]), ("stretch_max", [1.0, 1.4])] {
            let values = values(name);
            assert!(values[0].is_nan() && values[1..] == expected, "{name}: {values:?}");
        }
    }
}
