//! Prescribed displacement components.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::{BoundaryError, ENDS, LoadCurve, check_finite, check_finite_at};
use crate::fem::mesh::Mesh;

/// The origin of a prescribed displacement.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// A surface: index into [`Mesh::surfaces`].
    Surface(usize),
    /// A point condition: index into [`Conditions::points`](super::Conditions::points).
    Point(usize),
    /// A support against a free rigid-body mode; see
    /// [`Conditions::hold_free_modes`](super::Conditions::hold_free_modes).
    FreeMode,
}

/// The number of parts of pseudo-time at whose ends motions are compared.
const COMPARED: u32 = 100;

/// Returns the pseudo-times at which motions are compared: every hundredth, and the break points.
pub(super) fn compared_times(break_points: Vec<f64>) -> impl Iterator<Item = f64> {
    let grid = (0..=COMPARED).map(|k| f64::from(k) / f64::from(COMPARED));
    grid.chain(break_points)
}

/// One prescribed displacement component.
#[derive(Clone, Debug, PartialEq)]
pub struct PrescribedComponent {
    /// The node.
    pub node: u32,
    /// 0, 1, 2 for x, y, z.
    pub component: u8,
    /// Displacement at a factor of 1, m.
    pub value: f64,
    /// The condition that prescribes the component.
    pub source: Source,
    /// The reference position of the node, m.
    position: [f64; 3],
    curve: Arc<LoadCurve>,
}

impl PrescribedComponent {
    /// Creates a support that holds a component of a node at zero.
    pub(super) fn support(mesh: &Mesh, node: u32, component: u8) -> Self {
        let position = mesh.nodes()[node as usize];
        Self { node, component, value: 0.0, source: Source::FreeMode, position, curve: Arc::new(LoadCurve::Ramp) }
    }

    /// Returns the displacement at pseudo-time `t`, m.
    pub fn displacement(&self, t: f64) -> f64 {
        self.value * self.curve.factor(t, self.position)
    }

    /// Returns the formula of the factor.
    pub(super) fn formula(&self) -> Option<String> {
        self.curve.formula().map(str::to_owned)
    }

    /// Returns true if the displacement is 0 at all times.
    pub(super) fn is_held(&self) -> bool {
        self.value == 0.0 || self.compared_times(&[]).all(|t| self.displacement(t) == 0.0)
    }

    /// Returns true if two components prescribe the same displacement. Functions are compared at every hundredth of
    /// pseudo-time and at the break points of both.
    fn agrees_with(&self, other: &Self) -> bool {
        if self.value == other.value && (self.value == 0.0 || self.curve == other.curve) {
            return true;
        }
        self.compared_times(&other.curve.break_points()).all(|t| self.displacement(t) == other.displacement(t))
    }

    fn compared_times(&self, others: &[f64]) -> impl Iterator<Item = f64> {
        compared_times(self.curve.break_points()).chain(others.to_vec())
    }

    /// Returns true if a displacement that is finite at both ends of pseudo-time is finite at all times.
    pub(super) fn is_separable(&self) -> bool {
        self.curve.is_separable()
    }

    /// Checks that the displacement is finite at pseudo-time `t`.
    pub(super) fn check_finite(&self, mesh: &Mesh, t: f64) -> Result<(), BoundaryError> {
        check_finite_at(|| self.source.describe(mesh), (&[self.value], &self.curve), t, self.position)
    }

    /// Returns the pseudo-times at which the velocity jumps; none for a component that is held at 0.
    pub(super) fn break_points(&self) -> Vec<f64> {
        if self.value == 0.0 { Vec::new() } else { self.curve.break_points() }
    }
}

/// Collects prescribed components and detects conflicting values.
pub(super) struct PrescribedCollector<'m> {
    components: BTreeMap<(u32, u8), PrescribedComponent>,
    mesh: &'m Mesh,
}

impl<'m> PrescribedCollector<'m> {
    pub fn new(mesh: &'m Mesh) -> Self {
        Self { components: BTreeMap::new(), mesh }
    }

    /// Adds the components that one condition prescribes at these nodes.
    pub fn add(
        &mut self,
        nodes: &[u32],
        displacement: &[Option<f64>; 3],
        curve: &LoadCurve,
        source: Source,
    ) -> Result<(), BoundaryError> {
        let curve = Arc::new(curve.clone());
        for (component, value) in (0_u8..).zip(displacement) {
            let Some(value) = *value else { continue };
            check_finite(|| source.describe(self.mesh), &[value])?;
            for &node in nodes {
                let (position, curve) = (self.mesh.nodes()[node as usize], Arc::clone(&curve));
                let prescribed = PrescribedComponent { node, component, value, source, position, curve };
                ENDS.into_iter().try_for_each(|t| prescribed.check_finite(self.mesh, t))?;
                self.insert(prescribed)?;
            }
        }
        Ok(())
    }

    fn insert(&mut self, new: PrescribedComponent) -> Result<(), BoundaryError> {
        let first = self.components.entry((new.node, new.component)).or_insert_with(|| new.clone());
        if first.agrees_with(&new) {
            return Ok(());
        }
        Err(BoundaryError::Conflict {
            node: new.node as usize,
            component: usize::from(new.component),
            first: first.source.describe(self.mesh),
            first_value: first.value,
            second: new.source.describe(self.mesh),
            second_value: new.value,
            formulas: Box::new([first.formula(), new.formula()]),
        })
    }

    /// Removes the components that are prescribed at a node.
    pub fn take(&mut self, node: u32) -> Vec<PrescribedComponent> {
        (0..3).filter_map(|component| self.components.remove(&(node, component))).collect()
    }

    /// Returns the components, ascending by node and component.
    pub fn into_components(self) -> Vec<PrescribedComponent> {
        self.components.into_values().collect()
    }
}

impl Source {
    pub(super) fn describe(self, mesh: &Mesh) -> String {
        match self {
            Self::Surface(number) => {
                let name = mesh.surfaces().get(number).map_or("?", |surface| surface.name.as_str());
                format!("surface `{name}`")
            }
            Self::Point(number) => format!("point condition {}", number + 1),
            Self::FreeMode => "a support against a rigid-body mode".into(),
        }
    }
}
