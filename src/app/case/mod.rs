#![doc = include_str!("../../../docs/case.md")]

mod choice;
mod constraint;
mod data;
mod elastic;
mod field_names;
mod formula;
mod law;
mod load;
mod load_value;
mod material;
mod names;
mod networks;
mod parameter;
mod problems;
mod range;
mod read;
mod section;
mod solver;
mod table;
#[cfg(test)]
mod tests;
mod value;
mod write;

pub use crate::fem::boundary::LoadCurve;
pub use crate::fem::stepping::{AdaptiveIncrements, StepStart};
pub use crate::fiber::rve::StressScale;
pub use crate::tissue::materials::{
    BeforeCreation, ElementSelection, FiberRve, Formula, NetworkAssignment, RegionMaterial, RveLifecycle, RveParams,
    RveScale,
};
pub use choice::{Bins, ChoiceField, INDEX, NetworkChoice, NetworkPattern};
pub use data::*;
pub use field_names::FieldSelection;
pub(in crate::app) use field_names::{NODAL, OF_FIBERS, OF_RVES, components, is_needed};
pub use formula::{FieldFormula, FormulaCase, FormulaModel};
pub(crate) use formula::{Unstable, entries as formula_entries};
pub use load_value::LoadValue;
pub(crate) use load_value::terms;
pub(crate) use material::FRACTIONS;
pub(crate) use parameter::direction;
pub use parameter::{AxisCase, FieldCase, FieldSource, ParameterCase};
pub(crate) use range::Range;
pub use read::CaseFile;
