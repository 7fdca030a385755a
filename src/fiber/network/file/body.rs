//! The network file: counts, nodes, fibers and periodic pairs.

use std::path::Path;

use super::lines::{COMPARE, Line, Parser};
use super::older;
use crate::fiber::network::geometry::{doubled, problems};
use crate::fiber::network::{Cube, NetworkError};
use crate::input::{InputError, InputErrors};

/// The checked contents of a network file, in the units of the file.
#[derive(Debug)]
pub(super) struct Body {
    pub(super) nodes: Vec<[f64; 3]>,
    pub(super) fibers: Vec<[u32; 2]>,
    /// Periodic pairs of nodes; nodes count from 0.
    pub(super) periodic: Vec<[u32; 2]>,
    pub(super) cube: Cube,
    pub(super) warnings: Vec<String>,
}

/// The lines of a network file, by section.
struct Sections<'l, 't> {
    nodes: &'l [Line<'t>],
    fibers: &'l [Line<'t>],
    periodic: &'l [Line<'t>],
}

/// The numbers of the lines that give the nodes and the fibers.
pub(super) struct LineNumbers {
    pub(super) nodes: Vec<usize>,
    pub(super) fibers: Vec<usize>,
}

impl LineNumbers {
    fn of_node(&self, node: usize) -> usize {
        self.nodes.get(node).copied().unwrap_or(1)
    }

    fn of_fiber(&self, fiber: usize) -> usize {
        self.fibers.get(fiber).copied().unwrap_or(1)
    }
}

/// Parses and checks the contents of a network file.
///
/// # Errors
/// Returns all errors found in the first stage that fails: the lines, the bounding box, or the geometry.
pub(super) fn parse(file: &Path, bytes: &[u8]) -> Result<Body, InputErrors> {
    let mut parser = Parser::new(file);
    let lines = parser.lines(bytes)?;
    if older::is_older(&lines) {
        return older::parse(&mut parser, &lines);
    }
    let sections = divide(&mut parser, &lines)?;
    let mut nodes = Vec::with_capacity(sections.nodes.len());
    for &line in sections.nodes {
        let node = node(&mut parser, line);
        nodes.extend(parser.ok_or_record(node)?);
    }
    let fibers = pairs(&mut parser, sections.fibers, "the two nodes of a fiber: i j", 0, sections.nodes.len())?;
    let expected = "two paired nodes: a b, counted from 1";
    let periodic = pairs(&mut parser, sections.periodic, expected, 1, sections.nodes.len())?;
    parser.outcome()?;
    let cube = cube(&parser, &nodes)?;
    let numbers = LineNumbers { nodes: numbers_of(sections.nodes), fibers: numbers_of(sections.fibers) };
    check(&mut parser, &numbers, cube, &nodes, &fibers)?;
    let mut warnings = parser.warnings();
    if !periodic.is_empty() {
        let (file, pairs) = (file.display(), periodic.len());
        warnings.push(format!("{file}: {pairs} periodic pairs are read but not used: the boundary moves affinely"));
    }
    warnings.extend(doubled_warning(&parser, &numbers, &fibers));
    Ok(Body { nodes, fibers, periodic, cube, warnings })
}

fn numbers_of(lines: &[Line<'_>]) -> Vec<usize> {
    lines.iter().map(|line| line.number).collect()
}

/// Records all problems of the geometry, and returns an `Err` if there are any.
pub(super) fn check(
    parser: &mut Parser<'_>,
    numbers: &LineNumbers,
    cube: Cube,
    nodes: &[[f64; 3]],
    fibers: &[[u32; 2]],
) -> Result<(), InputErrors> {
    for problem in problems(cube, nodes, fibers) {
        let error = explain(parser, numbers, &problem);
        parser.record(error)?;
    }
    parser.outcome()
}

/// Returns the warning of fibers that join the same two nodes, if there are any.
pub(super) fn doubled_warning(parser: &Parser<'_>, numbers: &LineNumbers, fibers: &[[u32; 2]]) -> Option<String> {
    let found = doubled(fibers);
    let line = numbers.of_fiber(*found.first()? as usize);
    let (file, count) = (parser.file.display(), found.len());
    let join = if count == 1 { "fiber joins" } else { "fibers join" };
    Some(format!(
        "{file}:{line}: {count} {join} two nodes that another fiber already joins (this is the first); all contribute"
    ))
}

/// Reads the header and checks that its counts agree with the number of lines, before memory is allocated according to
/// these counts.
fn divide<'l, 't>(parser: &mut Parser<'_>, lines: &'l [Line<'t>]) -> Result<Sections<'l, 't>, InputError> {
    let expected = "three counts: NODES FIBERS PERIODIC";
    let Some((&header, rest)) = lines.split_first() else {
        return Err(InputError::in_file(parser.file, "the file is empty", expected, COMPARE));
    };
    let words: [&str; 3] = parser.words(header, expected)?;
    let mut counts = [0; 3];
    for (count, word) in counts.iter_mut().zip(words) {
        *count = parser.count(header, word)?;
    }
    let announced = counts.iter().map(|&count| u128::from(count)).sum::<u128>();
    if announced != rest.len() as u128 {
        let [nodes, fibers, periodic] = counts;
        let three = rest.iter().filter(|line| line.text.split_whitespace().count() >= 3).count();
        let what = format!(
            "the header announces {nodes} nodes, {fibers} fibers and {periodic} periodic pairs, which is {announced} \
             lines, but {} lines follow: {three} of three words or more and {} of fewer",
            rest.len(),
            rest.len() - three,
        );
        return Err(parser.wrong_line_count(header, what, announced, rest.len()));
    }
    // The counts sum to the number of lines in memory, so they fit in `usize`.
    let (nodes, rest) = rest.split_at(counts[0] as usize);
    let (fibers, periodic) = rest.split_at(counts[1] as usize);
    Ok(Sections { nodes, fibers, periodic })
}

fn node(parser: &mut Parser<'_>, line: Line<'_>) -> Result<[f64; 3], InputError> {
    let words: [&str; 3] = parser.words(line, "the position of a node: x y z")?;
    let mut position = [0.0; 3];
    for (x, word) in position.iter_mut().zip(words) {
        *x = parser.real(line, word)?;
    }
    Ok(position)
}

/// Reads pairs of node numbers, counted from `base` in the file; returns them counted from 0.
fn pairs(
    parser: &mut Parser<'_>,
    lines: &[Line<'_>],
    expected: &str,
    base: i64,
    nodes: usize,
) -> Result<Vec<[u32; 2]>, InputErrors> {
    let mut read: Vec<(Line<'_>, [i64; 2])> = Vec::with_capacity(lines.len());
    for &line in lines {
        let words = parser.words(line, expected);
        let Some([a, b]) = parser.ok_or_record(words)? else { continue };
        let (a, b) = (parser.whole(line, a), parser.whole(line, b));
        if let (Some(a), Some(b)) = (parser.ok_or_record(a)?, parser.ok_or_record(b)?) {
            read.push((line, [a, b]));
        }
    }
    let last = nodes as i64 - 1 + base;
    let all = || read.iter().flat_map(|(_, pair)| pair);
    let from_one = base == 0 && all().min() == Some(&1) && all().max() == Some(&(last + 1));
    let mut pairs = Vec::with_capacity(read.len());
    for (line, pair) in &read {
        match pair.iter().find(|&&index| !(base..=last).contains(&index)) {
            None => pairs.push(pair.map(|index| (index - base) as u32)),
            Some(&index) if from_one => {
                let what = format!("node {index} of {nodes}: the whole file counts its nodes from 1");
                let cure = "subtract 1 from every node number of the fibers";
                parser.record(parser.error(line.number, what, "node numbers from 0", cure))?;
                break;
            }
            Some(&index) => {
                let what = format!("there is no node {index}");
                let cure = "correct the number, or the counts in the first line";
                parser.record(parser.error(line.number, what, format!("nodes {base} to {last}"), cure))?;
            }
        }
    }
    Ok(pairs)
}

fn cube(parser: &Parser<'_>, nodes: &[[f64; 3]]) -> Result<Cube, InputError> {
    Cube::around(nodes).map_err(|error| {
        let cure = "give a network that fills a cube; stretched boxes cannot be centered and scaled to the unit cube";
        InputError::in_file(parser.file, error.to_string(), "edges that are equal within 1e-6 of the longest", cure)
    })
}

/// Describes a problem of the geometry, with the lines that cause it.
fn explain(parser: &Parser<'_>, numbers: &LineNumbers, problem: &NetworkError) -> InputError {
    let (node_line, fiber_line) = (|node| numbers.of_node(node), |fiber| numbers.of_fiber(fiber));
    match *problem {
        NetworkError::Loop { fiber, .. } => parser.error(
            fiber_line(fiber),
            problem.to_string(),
            "two different nodes",
            "remove the fiber or correct it",
        ),
        NetworkError::ZeroLength { fiber, ends: [a, b], .. } => {
            let (first, second) = (node_line(a as usize), node_line(b as usize));
            let cure = format!("merge the two nodes, lines {first} and {second}, or move one");
            parser.error(fiber_line(fiber), problem.to_string(), "a fiber of positive length", cure)
        }
        NetworkError::CoincidentNodes { first, second, .. } => {
            let cure = format!("merge the two, or move one; the other is on line {}", node_line(first));
            parser.error(node_line(second), problem.to_string(), "a different position for every node", cure)
        }
        NetworkError::Outside { node, .. } => parser.error(
            node_line(node),
            problem.to_string(),
            "nodes inside the cube and on its faces",
            "move the node, or correct the size of the cube",
        ),
        NetworkError::NoFibers => {
            parser.error(1, problem.to_string(), "at least one fiber", "generate the network again, with more points")
        }
        _ => InputError::in_file(parser.file, problem.to_string(), "a network in a cube", COMPARE),
    }
}
