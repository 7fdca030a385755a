//! Comparison of the names in a case with those of its mesh.

use std::path::Path;

use crate::input::{InputError, InputErrors, excerpt};

use super::data::{Case, ConstraintCase, MaterialCase, MeshSource};
use super::problems::{alternatives, nearest};
use crate::fem::constraint::{ConstrainedVolume, VolumeConstraint};
use crate::tissue::materials::{OTHER_REGIONS, find_region};

impl Case {
    /// Returns the index of the `[[region]]` for a region of the mesh: the one with its name, or else `*`.
    pub fn region_of(&self, region: &str) -> Option<usize> {
        find_region(self.regions.iter().map(|each| each.name.as_str()), region)
    }

    /// Returns the material of a region of the mesh.
    pub fn material_of(&self, region: &str) -> Option<&MaterialCase> {
        self.region_of(region).map(|number| &self.regions[number].material)
    }

    /// Checks the names in the case against the regions and surfaces of its mesh.
    ///
    /// # Errors
    /// Returns every name in the case that the mesh does not have, with its line, and every region of the mesh without
    /// a material.
    pub fn check_names(&self, regions: &[String], surfaces: &[String]) -> Result<(), InputErrors> {
        let mut errors = Vec::new();
        let bodies = self.regions.iter().map(|each| (&each.name, each.line));
        let forces = self.body_forces.iter().map(|each| (&each.region, each.line));
        let constrained = self.constraints.iter().filter_map(|each| match &each.constraint.of {
            ConstrainedVolume::Region(region) => Some((region, each.line)),
            ConstrainedVolume::Cavity(_) => None,
        });
        let in_bodies = bodies.chain(forces).chain(constrained);
        for (name, line) in in_bodies.filter(|(name, _)| *name != OTHER_REGIONS && !regions.contains(name)) {
            errors.push(self.unknown("region", (name, line), regions, ("surface", surfaces)));
        }
        let loads = self.boundaries.iter().map(|each| (&each.surface, each.line));
        let walls = self.constraints.iter().flat_map(|each| match &each.constraint.of {
            ConstrainedVolume::Region(_) => Vec::new(),
            ConstrainedVolume::Cavity(surfaces) => surfaces.iter().map(|surface| (surface, each.line)).collect(),
        });
        for (name, line) in loads.chain(walls).filter(|(name, _)| !surfaces.contains(name)) {
            errors.push(self.unknown("surface", (name, line), surfaces, ("region", regions)));
        }
        // `loads.csv` has one volume per name.
        for ConstraintCase { line, constraint: VolumeConstraint { name, of, .. } } in &self.constraints {
            if regions.contains(name) && *of != ConstrainedVolume::Region(name.clone()) {
                let what = format!("the constraint has the name of region \"{}\" of the mesh", excerpt(name));
                let expected = "a name that is not that of another volume";
                errors.push(InputError::at_line(&self.file, *line, what, expected, "give it another `name`"));
            }
        }
        errors.sort_by_key(|error| error.line);
        for region in regions.iter().filter(|region| self.material_of(region).is_none()) {
            errors.push(InputError::in_file(
                &self.file,
                format!("region \"{}\" of the mesh{} has no material", excerpt(region), self.mesh_file()),
                "a [[region]] for every region of the mesh, or one of name \"*\" for the rest",
                format!("add [[region]] with name = \"{region}\" and its material"),
            ));
        }
        if errors.is_empty() { Ok(()) } else { Err(InputErrors(errors)) }
    }

    fn unknown(
        &self,
        kind: &str,
        (name, line): (&str, usize),
        known: &[String],
        (other_kind, others): (&str, &[String]),
    ) -> InputError {
        let is_empty = known.is_empty() && matches!(self.mesh, MeshSource::File(_));
        let known = || known.iter().map(String::as_str);
        let expected = match known().next() {
            Some(_) => format!("a {kind} of the mesh: {}", alternatives(known(), '"')),
            None => format!("a {kind} of the mesh, which has none"),
        };
        let cure = match nearest(name, known()) {
            Some(near) => format!("did you mean \"{near}\"?"),
            None if others.iter().any(|other| other == name) => {
                format!("\"{name}\" is a {other_kind} of the mesh: name a {kind}")
            }
            None if self.has_ending("vtu") => format!(
                "choose one of these: a .vtu file numbers its groups by an integer array `region` of the cells, \
                 here `{kind}_1` for the value 1; surfaces consist of 2-D cells"
            ),
            None if self.has_ending("mesh") => {
                format!("choose one of these: a .mesh file numbers its groups, here `{kind}_1` for the reference 1")
            }
            None if self.has_ending("inp") => match kind {
                "region" => "choose one of these, or make it an element set of the mesh (*ELSET)".into(),
                _ => "choose one of these, or make it a surface or a node set of the mesh (*SURFACE, *NSET)".into(),
            },
            None if self.has_ending("feb") => match kind {
                "region" => "choose one of these, or name the <Elements> of the mesh so".into(),
                _ => "choose one of these, or make it a <Surface> or a <NodeSet> of the mesh".into(),
            },
            None if is_empty && kind == "surface" => {
                "the mesh file has no named surfaces: add a physical group to its geometry (in Gmsh: \
                 Physical Surface(\"NAME\") = {1, ...};), mesh it again, and save it"
                    .into()
            }
            None if self.has_ending("msh") => {
                "choose one of these, or name it in the mesh as a physical group; Gmsh leaves out \
                 groups without elements"
                    .into()
            }
            None => "choose one of these, or name it in the mesh as a physical group".into(),
        };
        let what = format!("the mesh{} has no {kind} \"{}\"", self.mesh_file(), excerpt(name));
        InputError::at_line(&self.file, line, what, expected, cure)
    }

    /// Returns true if the mesh is a file whose name ends so.
    fn has_ending(&self, ending: &str) -> bool {
        let is_so = |file: &Path| file.extension().is_some_and(|of| of.eq_ignore_ascii_case(ending));
        matches!(&self.mesh, MeshSource::File(file) if is_so(file))
    }

    /// Returns the path of the mesh file with a leading space, or an empty string for a generated mesh.
    fn mesh_file(&self) -> String {
        match &self.mesh {
            MeshSource::File(file) => format!(" {}", file.display()),
            MeshSource::Box { .. } | MeshSource::Tube { .. } | MeshSource::Dogbone { .. } => String::new(),
        }
    }
}
