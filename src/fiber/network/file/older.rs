//! The older network file, in which every fiber gives the positions of its two nodes.

use super::body::{Body, LineNumbers, check, doubled_warning};
use super::lines::{COMPARE, Line, Parser};
use crate::fiber::network::{BOUNDARY_TOLERANCE, Cube, SAME_PLACE};
use crate::input::{InputError, InputErrors};

/// Words on the line of a fiber.
const COLUMNS: usize = 9;
const HEADER: &str = "three counts: NODES DOFS FIBERS, with DOFS = 3 NODES";
const FIBER: &str = "a fiber with the positions of its nodes: id n1 n2 x y z x y z";

/// Returns true if the lines have this format: the first fiber has nine columns, and the counts of the header do not
/// agree with the number of lines in the current format.
pub(super) fn is_older(lines: &[Line<'_>]) -> bool {
    let [header, first, rest @ ..] = lines else { return false };
    let counts: Vec<u64> = header.text.split_whitespace().take(3).map_while(|word| word.parse().ok()).collect();
    let [nodes, second, third] = counts[..] else { return false };
    let current = u128::from(nodes) + u128::from(second) + u128::from(third);
    current != 1 + rest.len() as u128 && first.text.split_whitespace().count() >= COLUMNS
}

/// The contents while the fibers are being read; every node has the position and the line of its first fiber.
struct Reader<'p, 'a> {
    parser: &'p mut Parser<'a>,
    places: Vec<Option<([f64; 3], usize)>>,
    fibers: Vec<[u32; 2]>,
}

/// Parses and checks the lines of a file of the older format.
///
/// # Errors
/// Returns all errors found in the first stage that fails: the header, the lines, or the geometry.
pub(super) fn parse(parser: &mut Parser<'_>, lines: &[Line<'_>]) -> Result<Body, InputErrors> {
    let (nodes, fiber_lines, last) = divide(parser, lines)?;
    let mut reader = Reader { parser, places: vec![None; nodes], fibers: Vec::with_capacity(fiber_lines.len()) };
    for &line in fiber_lines {
        let fiber = reader.fiber(line);
        reader.parser.ok_or_record(fiber)?;
    }
    let Reader { parser, places, fibers } = reader;
    for node in (1..).zip(&places).filter_map(|(node, place)| place.is_none().then_some(node)) {
        let what = format!("no fiber ends at node {node}, so that its position is unknown");
        let cure = "correct the number of nodes in this line; was the file cut short?";
        parser.record(parser.error(line_of(lines), what, "a fiber at every node", cure))?;
    }
    let half_edge = last.map(|line| half_edge(parser, line));
    let half_edge = half_edge.map(|half_edge| parser.ok_or_record(half_edge)).transpose()?.flatten();
    parser.outcome()?;
    let (mut nodes, node_lines): (Vec<[f64; 3]>, Vec<usize>) = places.into_iter().flatten().unzip();
    let cube = cube(parser, &nodes, half_edge, last)?;
    let numbers = LineNumbers { nodes: node_lines, fibers: fiber_lines.iter().map(|line| line.number).collect() };
    check(parser, &numbers, cube, &nodes, &fibers)?;
    if !touches_a_face(cube, &nodes) {
        let what = format!("no node lies on a face of the cube of edge {}", cube.edges[0]);
        let line = last.map_or_else(|| line_of(lines), |line| line.number);
        let cure = "correct the last line of the file, half the edge of the cube";
        return Err(parser.error(line, what, "nodes on the faces of the cube", cure).into());
    }
    let mut warnings = parser.warnings();
    warnings.extend(doubled_warning(parser, &numbers, &fibers));
    warnings.extend(keep_cube(parser, cube, &mut nodes));
    Ok(Body { nodes, fibers, periodic: Vec::new(), cube, warnings })
}

/// The line of the header.
fn line_of(lines: &[Line<'_>]) -> usize {
    lines.first().map_or(1, |line| line.number)
}

/// Reads the header; returns the number of nodes, the lines of the fibers, and the line of the cube if there is one.
fn divide<'l, 't>(
    parser: &mut Parser<'_>,
    lines: &'l [Line<'t>],
) -> Result<(usize, &'l [Line<'t>], Option<Line<'t>>), InputError> {
    let Some((&header, rest)) = lines.split_first() else {
        return Err(InputError::in_file(parser.file, "the file is empty", HEADER, COMPARE));
    };
    let words: [&str; 3] = parser.words(header, HEADER)?;
    let mut counts = [0u64; 3];
    for (count, word) in counts.iter_mut().zip(words) {
        *count = parser.count(header, word)?;
    }
    let [nodes, dofs, fibers] = counts.map(u128::from);
    if dofs != 3 * nodes && dofs != 3 * fibers {
        let what = format!("the header announces {nodes} nodes with {dofs} unknowns, and each line gives a fiber");
        return Err(parser.error(
            header.number,
            what,
            HEADER,
            "correct the second number: three unknowns for each node",
        ));
    }
    let last = rest.split_last().filter(|(line, _)| line.text.split_whitespace().count() == 1);
    let (fiber_lines, last) = last.map_or((rest, None), |(&line, before)| (before, Some(line)));
    if fibers != fiber_lines.len() as u128 {
        let follow = fiber_lines.len();
        let what = format!("the header announces {fibers} fibers, but {follow} lines with positions follow");
        return Err(parser.wrong_line_count(header, what, fibers, follow));
    }
    // Bounds the memory by that of the lines.
    if nodes > 2 * fibers {
        let what = format!("the header announces {nodes} nodes, but {fibers} fibers end at {} at most", 2 * fibers);
        return Err(parser.error(header.number, what, "a fiber at every node", "correct the number of nodes"));
    }
    Ok((nodes as usize, fiber_lines, last))
}

impl Reader<'_, '_> {
    /// Reads the fiber on a line.
    fn fiber(&mut self, line: Line<'_>) -> Result<(), InputError> {
        let words: [&str; COLUMNS] = self.parser.words(line, FIBER)?;
        self.parser.whole(line, words[0])?;
        let mut ends = [0; 2];
        for (k, end) in ends.iter_mut().enumerate() {
            let node = self.node(line, words[1 + k])?;
            let mut position = [0.0; 3];
            for (x, word) in position.iter_mut().zip(&words[3 + 3 * k..]) {
                *x = self.parser.real(line, word)?;
            }
            self.place(line, node, position)?;
            *end = node as u32;
        }
        self.fibers.push(ends);
        Ok(())
    }

    /// Parses the number of a node; returns it counted from 0.
    fn node(&self, line: Line<'_>, word: &str) -> Result<usize, InputError> {
        let number = self.parser.whole(line, word)?;
        let nodes = self.places.len();
        let index =
            usize::try_from(number).ok().and_then(|number| number.checked_sub(1)).filter(|&index| index < nodes);
        index.ok_or_else(|| {
            let cure = if number == 0 {
                "count the nodes from 1, as files do whose lines give the positions of the fibers' ends"
            } else {
                "correct the number, or the number of nodes in the first line"
            };
            self.parser.error(line.number, format!("there is no node {number}"), format!("nodes 1 to {nodes}"), cure)
        })
    }

    /// Stores the position of a node, or compares it with that of an earlier line.
    fn place(&mut self, line: Line<'_>, node: usize, position: [f64; 3]) -> Result<(), InputError> {
        let Some((known, first)) = self.places[node] else {
            self.places[node] = Some((position, line.number));
            return Ok(());
        };
        let largest = known.iter().fold(0.0f64, |largest, x| largest.max(x.abs()));
        if known.iter().zip(position).all(|(a, b)| (a - b).abs() <= SAME_PLACE * largest) {
            return Ok(());
        }
        let what = format!("node {} is at {position:?} here, but at {known:?} on line {first}", node + 1);
        let cure = "correct one of the two positions, or give the two nodes different numbers";
        Err(self.parser.error(line.number, what, "the same position on every line of a node", cure))
    }
}

/// Reads half the edge of the cube.
fn half_edge(parser: &mut Parser<'_>, line: Line<'_>) -> Result<f64, InputError> {
    let [word]: [&str; 1] = parser.words(line, "half the edge of the cube")?;
    let value = parser.real(line, word)?;
    if value > 0.0 {
        return Ok(value);
    }
    let (what, expected) = (format!("half the edge of the cube is {value}"), "a number above 0");
    Err(parser.error(
        line.number,
        what,
        expected,
        "give half the edge of the cube around the origin, or remove the line",
    ))
}

/// Returns the cube: around the origin if the file gives its size or the nodes lie in the unit cube and on its faces,
/// and otherwise the bounding box of the nodes.
fn cube(
    parser: &Parser<'_>,
    nodes: &[[f64; 3]],
    half_edge: Option<f64>,
    last: Option<Line<'_>>,
) -> Result<Cube, InputError> {
    if let Some(half) = half_edge {
        let cube = Cube { lower: [-half; 3], edges: [2.0 * half; 3] };
        let is_finite = cube.edges[0].is_finite();
        let line = last.map_or(1, |line| line.number);
        let error = || parser.error(line, format!("the edge of the cube is 2 * {half}"), "a finite edge", COMPARE);
        return if is_finite { Ok(cube) } else { Err(error()) };
    }
    let inside = nodes.iter().flatten().all(|x| x.abs() <= 0.5 + BOUNDARY_TOLERANCE);
    if inside && touches_a_face(Cube::UNIT, nodes) {
        return Ok(Cube::UNIT);
    }
    Cube::around(nodes).map_err(|error| {
        let cure = "add a last line with half the edge of the cube, whose center is the origin";
        InputError::in_file(
            parser.file,
            error.to_string(),
            "nodes on all faces of a cube, or the size of the cube",
            cure,
        )
    })
}

/// Returns true if a node lies on the lower or upper face of the cube along an axis.
fn on_faces(cube: Cube, nodes: &[[f64; 3]], axis: usize) -> [bool; 2] {
    let (lower, edge) = (cube.lower[axis], cube.edges[axis]);
    [lower, lower + edge].map(|face| nodes.iter().any(|node| (node[axis] - face).abs() <= BOUNDARY_TOLERANCE * edge))
}

fn touches_a_face(cube: Cube, nodes: &[[f64; 3]]) -> bool {
    (0..3).any(|axis| on_faces(cube, nodes, axis).contains(&true))
}

/// Adds nodes without fibers at two opposite corners if the nodes do not span the cube, so that their bounding box is
/// the cube also where the network is written and read again. Returns the warning of this.
fn keep_cube(parser: &Parser<'_>, cube: Cube, nodes: &mut Vec<[f64; 3]>) -> Option<String> {
    if (0..3).all(|axis| on_faces(cube, nodes, axis) == [true; 2]) {
        return None;
    }
    let before = nodes.len();
    for corner in [cube.lower, [0, 1, 2].map(|k| cube.lower[k] + cube.edges[k])] {
        let near = |node: &[f64; 3]| (0..3).all(|k| (node[k] - corner[k]).abs() <= BOUNDARY_TOLERANCE * cube.edges[k]);
        if !nodes.iter().any(near) {
            nodes.push(corner);
        }
    }
    let (file, added) = (parser.file.display(), nodes.len() - before);
    let nodes = if added == 1 { "node" } else { "nodes" };
    Some(format!(
        "{file}: the fibers do not reach all faces of the cube of edge {}: {added} {nodes} without fibers at its corners \
         mark its size",
        cube.edges[0]
    ))
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::super::{body, read, write};
    use super::*;

    /// Three fibers from the faces of the unit cube to its center.
    const STAR: &str = "4 12 3\n1 1 4 -0.5 0.1 0 0.05 0 0.1\n2 2 4 0.5 -0.1 0 0.05 0 0.1\n3 4 3 0.05 0 0.1 0 0.2 0.5\n";
    /// Three chords of a cube of edge 4.
    const FILLED: &str = "6 18 3\n1 1 2 -2 0 1 2 0 1\n2 3 4 1 -2 0 1 2 0\n3 5 6 0 1 -2 0 1 2\n";

    fn parsed(text: &str) -> Body {
        body::parse(Path::new("net.txt"), text.as_bytes()).unwrap()
    }

    fn error_of(text: &str) -> String {
        body::parse(Path::new("net.txt"), text.as_bytes()).map(|_| ()).unwrap_err().to_string()
    }

    #[test]
    fn the_cube_is_the_unit_cube_the_bounding_box_or_that_of_the_last_line() {
        let star = parsed(STAR);
        assert_eq!((star.cube, &star.fibers[..]), (Cube::UNIT, &[[0, 3], [1, 3], [3, 2]][..]));
        assert_eq!(star.nodes[..4], [[-0.5, 0.1, 0.0], [0.5, -0.1, 0.0], [0.0, 0.2, 0.5], [0.05, 0.0, 0.1]]);
        assert_eq!(star.nodes[4..], [[-0.5; 3], [0.5; 3]], "the corners");
        let warning = "net.txt: the fibers do not reach all faces of the cube of edge 1: 2 nodes without fibers at its \
                       corners mark its size";
        assert_eq!(star.warnings, [warning]);
        assert_eq!(parsed(&format!("{STAR}\n 0.5 \n")).cube, Cube::UNIT);
        let filled = parsed(FILLED);
        assert_eq!((filled.cube, filled.nodes.len()), (Cube { lower: [-2.0; 3], edges: [4.0; 3] }, 6));
        assert!(filled.warnings.is_empty());
        assert_eq!(parsed(&format!("{FILLED}2\n")).cube, filled.cube);
        let with_types = FILLED.replace("0 1\n", "0 1 0\n");
        assert!(parsed(&with_types).warnings[0].contains("extra numbers"));
    }

    /// The header of a current file may have three times as many fibers as nodes, and its lines may have extra numbers.
    #[test]
    fn current_files_with_similar_headers_are_read_as_such() {
        let nodes = "-1 -1 -1 0 0 0 0 0 0\n1 1 1 0 0 0 0 0 0\n";
        let pairs = "0 1\n".repeat(6);
        let body = parsed(&format!("2 6 0\n{nodes}{pairs}"));
        assert_eq!((body.nodes.len(), body.fibers.len()), (2, 6));
        // In the older format, the number of fibers may be three times that of the nodes too.
        let chord = |k: usize| format!("{k} 1 2 -0.5 -0.5 -0.5 0.5 0.5 0.5\n");
        let body = parsed(&format!("2 6 6\n{}", (1..=6).map(chord).collect::<String>()));
        assert_eq!((body.nodes.len(), body.fibers.len()), (2, 6));
        assert!(body.warnings[0].contains(": 5 fibers join two nodes"), "{:?}", body.warnings);
        // Some writers count three unknowns for every fiber.
        assert_eq!(parsed(&STAR.replacen("4 12 3", "4 9 3", 1)).fibers.len(), 3);
    }

    #[test]
    fn errors_name_the_line_and_the_cure() {
        let star = |old: &str, new: &str| STAR.replacen(old, new, 1);
        for (text, start, cure) in [
            (
                star("4 12 3", "4 13 3"),
                "net.txt:1: the header announces 4 nodes with 13 unknowns",
                "correct the second",
            ),
            (
                star("4 12 3", "4 12 4"),
                "net.txt:1: the header announces 4 fibers, but 3 lines",
                "was the file cut short?",
            ),
            (star("4 12 3", "4 12 2"), "net.txt:1: the header announces 2 fibers, but 3 lines", "too many lines?"),
            (star("4 12 3", "9 27 3"), "net.txt:1: the header announces 9 nodes, but 3 fibers end at 6", "correct the"),
            (star("4 12 3", "5 15 3"), "net.txt:1: no fiber ends at node 5", "correct the number of nodes"),
            (star("2 2 4", "2 2 5"), "net.txt:3: there is no node 5\n  expected: nodes 1 to 4", "correct the number"),
            (star("1 1 4", "1 0 4"), "net.txt:2: there is no node 0", "count the nodes from 1"),
            (star("2 2 4", "x 2 4"), "net.txt:3: `x` is not a whole number", "compare with the format"),
            (star("0.2 0.5", "0.2"), "net.txt:4: there are 8 words on this line", "compare with the format"),
            (star("0.2 0.5", "nan 0.5"), "net.txt:4: `nan` is not finite", "find the cause in the program"),
            (
                star("4 3 0.05", "4 3 0.06"),
                "net.txt:4: node 4 is at [0.06, 0.0, 0.1] here, but at [0.05, 0.0, 0.1] on line 2",
                "correct one of the two positions",
            ),
            (star("2 2 4 0.5 -0.1 0", "2 4 4 0.05 0 0.1"), "net.txt:1: no fiber ends at node 2", "correct the number"),
            (format!("{STAR}-1\n"), "net.txt:5: half the edge of the cube is -1", "give half the edge"),
            (format!("{STAR}0.45\n"), "net.txt:2: node 0 at ", "move the node"),
            (
                format!("{STAR}0.7\n"),
                "net.txt:5: no node lies on a face of the cube of edge 1.4",
                "correct the last line",
            ),
            (
                STAR.replace("0.5", "0.4"),
                "net.txt: the bounding box of the nodes",
                "add a last line with half the edge",
            ),
        ] {
            let error = error_of(&text);
            assert!(error.starts_with(start) && error.contains("\n  cure: "), "{text}{error}");
            assert!(error.split("cure: ").nth(1).unwrap().contains(cure), "{error}");
        }
    }

    #[test]
    fn a_network_is_the_same_after_it_is_written_in_the_current_format() {
        let folder = tempfile::tempdir().unwrap();
        let [old, new] = ["old.txt", "new.txt"].map(|name| folder.path().join(name));
        let wide = "4 12 2\n1 1 2 -1.5 0.2 0 1.5 0.2 0\n2 3 4 -1.5 -0.2 0 1.5 -0.2 0\n1.5\n";
        for text in [STAR, FILLED, wide] {
            std::fs::write(&old, text).unwrap();
            let network = read(&old).unwrap().network;
            write(&new, &network).unwrap();
            let again = read(&new).unwrap().network;
            assert_eq!((network.nodes(), network.fibers()), (again.nodes(), again.fibers()));
            assert_eq!(network.boundary(), again.boundary());
        }
    }
}
