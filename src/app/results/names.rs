//! The names of the files that a run writes for steps and elements.

use super::collection::{field_file, index_file, partial};
use super::networks::{NetworkPoint, network_collection, network_file};
use super::pieces::part_file;

/// A file of a step or an element, recognized by its name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum FileName {
    /// The fields or the integration points of an undivided body.
    Fields { step: usize },
    /// The index file of the pieces of a divided body.
    Index { step: usize },
    /// The fields or the integration points of a piece of a divided body.
    Part { step: usize },
    /// The network of an RVE.
    Network { point: NetworkPoint, step: usize },
    /// The collection of the networks of an RVE.
    Collection { point: NetworkPoint },
    /// Fields or a network of a state within a step.
    Partial,
}

impl FileName {
    /// Parses a name; `None` if no run writes such a name.
    pub(super) fn parse(name: &str) -> Option<Self> {
        // Integration points have the names of fields with another beginning.
        let as_fields = name.strip_prefix("points-").map(|rest| format!("fields-{rest}"));
        let name = as_fields.as_deref().unwrap_or(name);
        let of_step = name.replacen("-partial", "", 1);
        let (kind, whole) = if let Some([step]) = numbers(&of_step, ["fields-", ".vtu"]) {
            (Self::Fields { step }, field_file(step))
        } else if let Some([step]) = numbers(&of_step, ["fields-", ".pvtu"]) {
            (Self::Index { step }, index_file(step))
        } else if let Some([step, part]) = numbers(&of_step, ["fields-", "-part-", ".vtu"]) {
            if name == part_file(&partial(&index_file(step)), part) {
                return Some(Self::Partial);
            }
            (Self::Part { step }, part_file(&index_file(step), part))
        } else if let Some([element, point, step]) = numbers(&of_step, ["element-", "-point-", "-step-", ".vtp"]) {
            let point = NetworkPoint { element, point: Some(point) };
            (Self::Network { point, step }, network_file(point, step))
        } else if let Some([element, step]) = numbers(&of_step, ["element-", "-step-", ".vtp"]) {
            let point = NetworkPoint { element, point: None };
            (Self::Network { point, step }, network_file(point, step))
        } else if let Some([element, point]) = numbers(&of_step, ["element-", "-point-", ".pvd"]) {
            let point = NetworkPoint { element, point: Some(point) };
            (Self::Collection { point }, network_collection(point))
        } else {
            let [element] = numbers(&of_step, ["element-", ".pvd"])?;
            let point = NetworkPoint { element, point: None };
            (Self::Collection { point }, network_collection(point))
        };
        let has_partial = matches!(kind, Self::Fields { .. } | Self::Index { .. } | Self::Network { .. });
        match name {
            _ if name == whole => Some(kind),
            _ if has_partial && name == partial(&whole) => Some(Self::Partial),
            _ => None,
        }
    }

    /// Returns the step of the fields or the network.
    pub(super) fn step(self) -> Option<usize> {
        match self {
            Self::Fields { step } | Self::Index { step } | Self::Part { step } | Self::Network { step, .. } => {
                Some(step)
            }
            Self::Collection { .. } | Self::Partial => None,
        }
    }

    /// Returns true for fields and integration points, in one file or in pieces.
    pub(super) fn is_fields(self) -> bool {
        matches!(self, Self::Fields { .. } | Self::Index { .. } | Self::Part { .. } | Self::Partial)
    }

    /// Returns true for networks and their collections.
    pub(super) fn is_networks(self) -> bool {
        matches!(self, Self::Network { .. } | Self::Collection { .. } | Self::Partial)
    }
}

/// Returns the `N - 1` numbers between the `N` given pieces of a name.
pub(super) fn numbers<const N: usize, const M: usize>(name: &str, pieces: [&str; N]) -> Option<[usize; M]> {
    let mut rest = name.strip_prefix(pieces[0])?;
    let mut numbers = [0; M];
    for (number, piece) in numbers.iter_mut().zip(&pieces[1..]) {
        let (digits, after) = rest.split_once(piece)?;
        (*number, rest) = (digits.parse().ok()?, after);
    }
    rest.is_empty().then_some(numbers)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_recognized_exactly() {
        use FileName::{Collection, Fields, Index, Network, Part, Partial};
        let of = |point| NetworkPoint { element: 17, point };
        for (name, expected) in [
            ("fields-00003.vtu", Some(Fields { step: 3 })),
            ("fields-00003.pvtu", Some(Index { step: 3 })),
            ("fields-00003-part-0002.vtu", Some(Part { step: 3 })),
            ("fields-123456-part-12345.vtu", Some(Part { step: 123_456 })),
            ("element-00017-step-00003.vtp", Some(Network { point: of(None), step: 3 })),
            ("element-00017-point-02-step-00003.vtp", Some(Network { point: of(Some(2)), step: 3 })),
            ("element-00017.pvd", Some(Collection { point: of(None) })),
            ("element-00017-point-26.pvd", Some(Collection { point: of(Some(26)) })),
            ("element-00017-point-2.pvd", None),
            ("fields-00003-partial.vtu", Some(Partial)),
            ("fields-00003-partial.pvtu", Some(Partial)),
            ("fields-00003-partial-part-0002.vtu", Some(Partial)),
            ("element-00017-step-00003-partial.vtp", Some(Partial)),
            ("points-00003.vtu", Some(Fields { step: 3 })),
            ("points-00003.pvtu", Some(Index { step: 3 })),
            ("points-00003-part-0002.vtu", Some(Part { step: 3 })),
            ("points-00003-partial.vtu", Some(Partial)),
            ("points-3.vtu", None),
            ("fields-3.vtu", None),
            ("fields-+0003.vtu", None),
            ("fields-00003.vtu.bak", None),
            ("fields-00003-part-2.vtu", None),
            ("fields-00003-part-0002.pvtu", None),
            ("fields-00003-part-0002-partial.vtu", None),
            ("fields-00003-partial-partial.vtu", None),
            ("element-00017-partial.pvd", None),
            ("my-partial.vtu", None),
        ] {
            assert_eq!(FileName::parse(name), expected, "{name}");
        }
    }
}
