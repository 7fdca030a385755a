//! Sections of version 2.2.

use super::cursor::Cursor;
use super::raw::{Raw, RawNode, element_treatment};
use crate::input::InputError;

const NODE: &str = "a node: its number and its x, y and z";
const ELEMENT: &str = "an element: its number, its type, its number of tags, its tags, its nodes";

/// Reads `$Nodes`: a count, then number and position of each node.
pub(super) fn nodes(cursor: &mut Cursor<'_>, raw: &mut Raw) -> Result<(), InputError> {
    raw.once(cursor, "Nodes")?;
    let count = cursor.text_count("the number of nodes")?;
    cursor.expect_count("nodes", count);
    raw.nodes.reserve(cursor.at_most(count, 8));
    for _ in 0..count {
        cursor.begin_row();
        let tag = cursor.small_size(NODE)?;
        let line = cursor.line();
        let position = [cursor.finite(NODE)?, cursor.finite(NODE)?, cursor.finite(NODE)?];
        cursor.end_row()?;
        raw.nodes.push(RawNode { tag, position, line });
        cursor.count_one();
    }
    Ok(())
}

/// Reads `$Elements`: a count, then the elements; binary files group them in blocks of equal type and number of tags.
pub(super) fn elements(cursor: &mut Cursor<'_>, raw: &mut Raw) -> Result<(), InputError> {
    raw.once(cursor, "Elements")?;
    let count = cursor.text_count("the number of elements")?;
    cursor.expect_count("elements", count);
    // Most elements of a file are volumes.
    raw.volumes.reserve_exact(cursor.at_most(count, 16));
    if cursor.is_text() {
        for _ in 0..count {
            cursor.begin_row();
            let tag = cursor.small_size(ELEMENT)?;
            let number = cursor.integer(ELEMENT)?;
            let treatment = element_treatment(cursor, number)?;
            let tags = cursor.small_size(ELEMENT)?;
            let group = physical(cursor, tags)?;
            raw.element(cursor, (treatment, group, tag))?;
            cursor.end_row()?;
            cursor.count_one();
        }
        return Ok(());
    }
    let mut left = count;
    while left > 0 {
        let number = cursor.integer("the type of the elements of a block")?;
        let treatment = element_treatment(cursor, number)?;
        let here = cursor.small_size("the number of elements in a block")?;
        let tags = cursor.small_size("the number of tags an element has")?;
        if here > left {
            let problem = format!("a block of {here} elements, but only {left} of the {count} announced are left");
            let cure = "the file is damaged: export it again";
            return Err(cursor.error(problem, "blocks that add up to the number of elements", cure));
        }
        for _ in 0..here {
            let tag = cursor.small_size(ELEMENT)?;
            let group = physical(cursor, tags)?;
            raw.element(cursor, (treatment, group, tag))?;
            cursor.count_one();
        }
        left -= here;
    }
    Ok(())
}

/// Reads the tags of an element and returns the first one, the physical group; skips the others (entity, partitions). A
/// negative group marks elements that Gmsh has reversed.
fn physical(cursor: &mut Cursor<'_>, tags: u64) -> Result<i32, InputError> {
    let mut group = 0;
    for k in 0..tags {
        let tag = cursor.integer(ELEMENT)?;
        if k == 0 {
            group = tag.saturating_abs();
        }
    }
    Ok(group)
}
