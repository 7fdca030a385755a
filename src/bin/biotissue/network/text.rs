//! Text descriptions of a network. Writing to a string cannot fail, so the results of `write!` are ignored.

use std::fmt::Write as _;

use biotissue::fiber::law::{BUCKLING_STRAIN, COMPRESSION, YOUNGS_MODULUS, formula_parameters};
use biotissue::fiber::network::check::{NetworkReport, Removed, Rigidity};
use biotissue::fiber::network::file::sidecar::NamedLaw;
use biotissue::fiber::network::{Cube, Network};

/// Describes what cleaning removes.
pub fn removed(removed: &Removed) -> String {
    let Removed { short_fibers, dangling_fibers, unsupported_fibers, merged_fibers, nodes } = removed;
    let mut text = format!(
        "{short_fibers} short, {dangling_fibers} dangling and {unsupported_fibers} unsupported fibers, {nodes} nodes"
    );
    if *merged_fibers > 0 {
        let _ = write!(text, "; {merged_fibers} doubled fibers (merged with those of the same law beside them)");
    }
    text
}

/// Describes the doubled fibers that cleaning does not merge.
pub fn kept_doubled(count: usize, network: &Network) -> String {
    if count == 0 {
        return String::new();
    }
    let fibers = if count == 1 { "fiber" } else { "fibers" };
    let why = if network.materials().is_empty() {
        "the network has no laws"
    } else {
        "fibers with the same nodes have different laws"
    };
    format!("  not merged: {count} doubled {fibers}, since {why}\n")
}

/// Describes the properties of a network. The order parameter refers to `axis`, or else to the principal direction.
pub fn figures(report: &NetworkReport, network: &Network, cube: &Cube, axis: Option<[f64; 3]>) -> String {
    let mut text = String::new();
    let _ = writeln!(
        text,
        "  nodes            {} ({} on the boundary, {} interior: {} free unknowns)",
        report.nodes, report.boundary_nodes, report.interior_nodes, report.free_dofs
    );
    let _ = writeln!(
        text,
        "  fibers           {} ({} from boundary to boundary; Maxwell's count {:+})",
        report.fibers, report.boundary_fibers, report.maxwell_count
    );
    if report.doubled_fibers > 0 {
        let _ = writeln!(text, "  doubled fibers   {} join the same two nodes as another fiber", report.doubled_fibers);
    }
    let _ = writeln!(text, "  cube             edge {} in the file; lengths below are relative to it", cube.edges[0]);
    let length = report.length;
    let _ = writeln!(
        text,
        "  fiber length     {:.6} to {:.6}, mean {:.6}, standard deviation {:.6}",
        length.min, length.max, length.mean, length.deviation
    );
    let _ = writeln!(text, "  density          {:.6} (total length of the fibers in the cube)", report.total_length);
    coordination(&mut text, report);
    orientation(&mut text, report, axis);
    laws(&mut text, network);
    let (parts, unsupported) = (report.components.len(), report.unsupported().count());
    let _ = writeln!(text, "  parts            {parts}, {unsupported} not connected to the boundary");
    text
}

/// Rounds to ten digits, to hide the rounding errors of a computed value.
fn short(x: f64) -> f64 {
    format!("{x:.9e}").parse().unwrap_or(x)
}

/// Replaces values that four decimals show as zero by a zero without sign.
pub fn unsigned_zero(x: f64) -> f64 {
    if x.abs() < 0.5e-4 { 0.0 } else { x }
}

fn laws(text: &mut String, network: &Network) {
    for (number, material) in (0..).zip(network.materials()) {
        let law = NamedLaw::from(material);
        let modulus = material.law.youngs_modulus();
        let _ = write!(text, "  law              {}, E {:e} Pa, radius {:e} m", law.name, short(modulus), law.radius);
        for parameter in formula_parameters().into_iter().filter(|&parameter| parameter != &YOUNGS_MODULUS) {
            let _ = law.get(parameter).map_or(Ok(()), |value| write!(text, ", {} {value}", parameter.symbol));
        }
        let _ = law.points.as_ref().map_or(Ok(()), |points| write!(text, ", {} points", points.len()));
        let _ = law.get(&COMPRESSION).map_or(Ok(()), |part| write!(text, ", {part} of E in compression"));
        let _ = law.get(&BUCKLING_STRAIN).map_or(Ok(()), |strain| write!(text, " beyond {strain}"));
        if network.materials().len() > 1 {
            let fibers = network.material_of().iter().filter(|&&of| of == number).count();
            let _ = write!(text, ", {fibers} fibers");
        }
        text.push('\n');
    }
}

fn coordination(text: &mut String, report: &NetworkReport) {
    let Some(fibers) = report.coordination else { return };
    let _ = writeln!(
        text,
        "  coordination     {} to {} fibers at an interior node, mean {:.3}, standard deviation {:.3}",
        fibers.min, fibers.max, fibers.mean, fibers.deviation
    );
    let bars: Vec<String> = report
        .coordination_counts
        .iter()
        .enumerate()
        .filter(|(_, nodes)| **nodes > 0)
        .map(|(fibers, nodes)| format!("{fibers}: {nodes}"))
        .collect();
    for (row, bars) in bars.chunks(10).enumerate() {
        let name = if row == 0 { "fibers: nodes" } else { "" };
        let _ = writeln!(text, "    {name:<14} {}", bars.join("  "));
    }
}

fn orientation(text: &mut String, report: &NetworkReport, axis: Option<[f64; 3]>) {
    for (name, tensor) in [("orientation", report.orientation), ("  by length", report.orientation_by_length)] {
        let [[xx, xy, xz], [_, yy, yz], [_, _, zz]] = tensor.map(|row| row.map(unsigned_zero));
        let _ =
            writeln!(text, "  {name:<16} xx {xx:.4}  yy {yy:.4}  zz {zz:.4}  yz {yz:+.4}  xz {xz:+.4}  xy {xy:+.4}");
    }
    let (direction, name) =
        axis.map_or((report.principal_direction, "principal direction"), |axis| (axis, "direction of alignment"));
    let ([order, by_length], [x, y, z]) =
        (report.order_about(direction).map(unsigned_zero), direction.map(unsigned_zero));
    let _ = writeln!(
        text,
        "  order            P2 {order:.4}, by length {by_length:.4}, about the {name} ({x:.4} {y:.4} {z:.4})"
    );
}

/// Describes in one line whether a network is rigid.
pub fn rigid_or_floppy(zero_modes: usize, unknowns: usize) -> String {
    if zero_modes == 0 {
        return "  rigidity         rigid: at rest the network resists every motion of its interior nodes\n".into();
    }
    format!("  rigidity         floppy: at rest the network does not resist {zero_modes} of {unknowns} motions\n")
}

/// Describes where a network is floppy and why.
pub fn rigidity(found: &Rigidity) -> String {
    let mut text = rigid_or_floppy(found.zero_modes, found.unknowns);
    let _ = writeln!(text, "    self stresses  {} independent ones", found.self_stresses);
    if found.zero_modes == 0 {
        return text;
    }
    let _ = writeln!(
        text,
        "    single nodes   {} of the zero modes, at {} nodes with fewer than 3 fibers and {} with coplanar ones",
        found.single_node_modes, found.few_fibers, found.coplanar_fibers
    );
    let _ = writeln!(
        text,
        "    mobile nodes   {} of {} interior ones{}; the most mobile (3 is free):",
        found.mobile_nodes,
        found.unknowns / 3,
        if found.estimated { ", mobilities estimated" } else { "" }
    );
    for node in &found.most_mobile {
        let [x, y, z] = node.position.map(unsigned_zero);
        let _ = writeln!(text, "      node {:<8} mobility {:.4} at {x:+.4} {y:+.4} {z:+.4}", node.node, node.mobility);
    }
    text
}
