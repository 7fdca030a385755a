//! Sections of version 4.1.

use super::cursor::{Cursor, DAMAGED};
use super::element_type::ElementTreatment;
use super::raw::{Raw, RawNode, element_treatment};
use crate::fem::element::CellType;
use crate::input::InputError;

/// Reads `$Entities`: the physical groups of points, curves, surfaces and volumes of the geometry.
pub(super) fn entities(cursor: &mut Cursor<'_>, raw: &mut Raw) -> Result<(), InputError> {
    raw.once(cursor, "Entities")?;
    cursor.begin_row();
    let mut counts = [0; 4];
    for count in &mut counts {
        *count = cursor.size("the numbers of points, curves, surfaces and volumes")?;
    }
    cursor.end_row()?;
    for (dimension, count) in (0..).zip(counts) {
        let noun = ["points", "curves", "surfaces", "volumes"][dimension as usize];
        cursor.expect_count(noun, count);
        for _ in 0..count {
            entity(cursor, raw, dimension)?;
            cursor.count_one();
        }
    }
    Ok(())
}

/// Reads an entity: tag, position or bounding box, physical groups and, except for points, bounding entities.
fn entity(cursor: &mut Cursor<'_>, raw: &mut Raw, dimension: i32) -> Result<(), InputError> {
    const ROW: &str =
        "an entity: its tag, its position or box, its physical groups and its bounding entities, with counts";
    cursor.begin_row();
    let tag = cursor.integer(ROW)?;
    for _ in 0..if dimension == 0 { 3 } else { 6 } {
        cursor.number(ROW)?;
    }
    let groups = cursor.size(ROW)?;
    let mut physical = Vec::new();
    for _ in 0..groups {
        // The number is negative if the group reverses the entity; triangles are oriented later by the body.
        let group = cursor.integer(ROW)?.saturating_abs();
        if group != 0 && !physical.contains(&group) {
            physical.push(group);
        }
    }
    if dimension > 0 {
        for _ in 0..cursor.size(ROW)? {
            cursor.integer(ROW)?;
        }
    }
    cursor.end_row()?;
    if raw.entities.insert((dimension, tag), physical).is_some() {
        let problem = format!("a second entity {tag} of dimension {dimension}");
        return Err(cursor.error(problem, "each entity once", DAMAGED));
    }
    Ok(())
}

/// Reads `$Nodes`: blocks of nodes on one entity, the tags of a block before its positions.
pub(super) fn nodes(cursor: &mut Cursor<'_>, raw: &mut Raw) -> Result<(), InputError> {
    const BLOCK: &str = "a block of nodes: dimension and tag of its entity, parametric flag (0 or 1), number of nodes";
    const POSITION: &str = "x, y and z of a node, and its parameters on the entity in a parametric block";
    raw.once(cursor, "Nodes")?;
    let Blocks { blocks, count } = Blocks::read(cursor, "nodes")?;
    raw.nodes.reserve(cursor.at_most(count, 8));
    for _ in 0..blocks {
        cursor.begin_row();
        let dimension = cursor.integer(BLOCK)?;
        let _entity = cursor.integer(BLOCK)?;
        let parametric = cursor.integer(BLOCK)?;
        let here = cursor.size(BLOCK)?;
        cursor.end_row()?;
        if !(0..=3).contains(&dimension) || !(0..=1).contains(&parametric) {
            let problem = format!("a block of dimension {dimension} whose parametric flag is {parametric}");
            return Err(cursor.error(problem, BLOCK, DAMAGED));
        }
        let start = raw.nodes.len();
        for _ in 0..here {
            let tag = cursor.size("the tag of a node")?;
            raw.nodes.push(RawNode { tag, position: [0.0; 3], line: cursor.line() });
        }
        for node in &mut raw.nodes[start..] {
            cursor.begin_row();
            node.position = [cursor.finite(POSITION)?, cursor.finite(POSITION)?, cursor.finite(POSITION)?];
            for _ in 0..parametric * dimension {
                cursor.number(POSITION)?;
            }
            cursor.end_row()?;
            cursor.count_one();
        }
    }
    Blocks::add_up(cursor, count, raw.nodes.len() as u64, "nodes")
}

/// Reads `$Elements`: blocks of elements of one type on one entity.
pub(super) fn elements(cursor: &mut Cursor<'_>, raw: &mut Raw) -> Result<(), InputError> {
    const BLOCK: &str = "a block of elements: dimension and tag of its entity, type and number of its elements";
    raw.once(cursor, "Elements")?;
    let Blocks { blocks, count } = Blocks::read(cursor, "elements")?;
    // Most elements of a file are volumes.
    raw.volumes.reserve_exact(cursor.at_most(count, 4));
    let mut found = 0_u64;
    for _ in 0..blocks {
        cursor.begin_row();
        let dimension = cursor.integer(BLOCK)?;
        let entity = cursor.integer(BLOCK)?;
        let number = cursor.integer(BLOCK)?;
        let treatment = element_treatment(cursor, number)?;
        let here = cursor.size(BLOCK)?;
        cursor.end_row()?;
        let (own, noun) = match treatment {
            ElementTreatment::Volume(element_type) => (3, element_type.nouns()[1]),
            ElementTreatment::Face(face_type) => (2, face_type.nouns()[1]),
            ElementTreatment::Ignored(_) => (dimension, ""),
        };
        if dimension != own {
            let problem = format!("a block of {noun} lies on an entity of dimension {dimension}");
            return Err(cursor.error(problem, format!("dimension {own}"), DAMAGED));
        }
        if let ElementTreatment::Volume(element_type) = treatment {
            let nodes = here.saturating_mul(element_type.nodes() as u64);
            let nodes = cursor.at_most(nodes, 4);
            // Meshes of many small blocks would otherwise be copied for each of them.
            match nodes < raw.node_tags.len() {
                true => raw.node_tags.reserve(nodes),
                false => raw.node_tags.reserve_exact(nodes),
            }
        }
        for _ in 0..here {
            cursor.begin_row();
            let tag = cursor.size("an element: its tag and its nodes")?;
            raw.element(cursor, (treatment, entity, tag))?;
            cursor.end_row()?;
            cursor.count_one();
            found += 1;
        }
    }
    Blocks::add_up(cursor, count, found, "elements")
}

/// The header of `$Nodes` and `$Elements`: the number of blocks and the total number of items. The lowest and highest
/// tag are ignored.
struct Blocks {
    blocks: u64,
    count: u64,
}

impl Blocks {
    fn read(cursor: &mut Cursor<'_>, noun: &'static str) -> Result<Self, InputError> {
        let expected = format!("the number of blocks, the number of {noun}, their lowest and their highest tag");
        cursor.begin_row();
        let blocks = cursor.size(&expected)?;
        let count = cursor.size(&expected)?;
        cursor.size(&expected)?;
        cursor.size(&expected)?;
        cursor.end_row()?;
        cursor.expect_count(noun, count);
        Ok(Self { blocks, count })
    }

    fn add_up(cursor: &Cursor<'_>, announced: u64, found: u64, noun: &str) -> Result<(), InputError> {
        if announced == found {
            return Ok(());
        }
        let problem = format!("the blocks contain {found} {noun}, but {announced} are announced");
        Err(cursor.error(problem, "blocks that add up to the number announced", DAMAGED))
    }
}
