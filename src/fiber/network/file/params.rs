//! The `.params` file: the fiber materials.

use std::path::Path;

use super::lines::{COMPARE, Line, Parser};
use crate::fiber::law::{FiberMaterial, Law};
use crate::input::{InputError, InputErrors};

/// The contents of a `.params` file.
#[derive(Debug)]
pub(super) struct Params {
    pub(super) materials: Vec<FiberMaterial>,
    /// One index into `materials` per fiber.
    pub(super) material_of: Vec<u16>,
    pub(super) warnings: Vec<String>,
}

const REACTIONS: &str = "`0 radius E density` (linear) or `1 radius E B lambda_t density` (exponential-stretch)";

/// Reads the materials of a network with this number of fibers.
pub(super) fn parse(file: &Path, bytes: &[u8], fibers: usize) -> Result<Params, InputErrors> {
    let mut parser = Parser::new(file);
    let lines = parser.lines(bytes)?;
    let (reactions, numbers) = divide(&mut parser, &lines, fibers)?;
    let mut materials = Vec::with_capacity(reactions.len());
    for &line in reactions {
        let material = reaction(&mut parser, line);
        materials.extend(parser.ok_or_record(material)?);
    }
    let mut material_of = Vec::with_capacity(numbers.len());
    for &line in numbers {
        let number = number(&mut parser, line, reactions.len());
        material_of.extend(parser.ok_or_record(number)?);
    }
    parser.outcome()?;
    Ok(Params { materials, material_of, warnings: parser.warnings() })
}

/// Checks the header and returns the lines of the reactions and those of the fibers.
fn divide<'l, 't>(
    parser: &mut Parser<'_>,
    lines: &'l [Line<'t>],
    fibers: usize,
) -> Result<(&'l [Line<'t>], &'l [Line<'t>]), InputError> {
    let expected = "two counts: REACTIONS FIBERS";
    let Some((&header, rest)) = lines.split_first() else {
        return Err(InputError::in_file(parser.file, "the file is empty", expected, COMPARE));
    };
    let [reactions, counted]: [&str; 2] = parser.words(header, expected)?;
    let (reactions, counted) = (parser.count(header, reactions)?, parser.count(header, counted)?);
    if counted != fibers as u64 {
        let what = format!("the parameters are for {counted} fibers");
        let expected = format!("{fibers} fibers, as the network has");
        return Err(parser.error(header.number, what, expected, "give the .params file of this network"));
    }
    if !(1..=u64::from(u16::MAX)).contains(&reactions) {
        let what = format!("there are {reactions} reactions");
        return Err(parser.error(header.number, what, "from 1 to 65535 reactions", COMPARE));
    }
    let announced = u128::from(reactions) + u128::from(counted);
    if announced != rest.len() as u128 {
        let what = format!(
            "the header announces {reactions} reactions and {counted} fibers, which is {announced} lines, but {} \
             lines follow",
            rest.len()
        );
        return Err(parser.wrong_line_count(header, what, announced, rest.len()));
    }
    Ok(rest.split_at(reactions as usize))
}

fn reaction(parser: &mut Parser<'_>, line: Line<'_>) -> Result<FiberMaterial, InputError> {
    let kind = line.text.split_whitespace().next().unwrap_or_default();
    let (law, radius, density) = match kind {
        "0" => {
            let [_, radius, modulus, density]: [&str; 4] = parser.words(line, "0 radius E density")?;
            let radius = parser.positive(line, "radius", radius)?;
            let youngs_modulus = parser.positive(line, "modulus", modulus)?;
            (Law::Linear { youngs_modulus }, radius, density)
        }
        "1" => {
            let [_, radius, modulus, b, transition, density]: [&str; 6] =
                parser.words(line, "1 radius E B lambda_t density")?;
            let radius = parser.positive(line, "radius", radius)?;
            let youngs_modulus = parser.positive(line, "modulus", modulus)?;
            let nonlinearity = parser.positive(line, "nonlinearity B", b)?;
            let transition = parser.real(line, transition)?;
            if transition < 1.0 {
                let what = format!("the transition stretch is {transition}");
                let cure = "give the stretch above which the law continues along its tangent line";
                return Err(parser.error(line.number, what, "a stretch of at least 1", cure));
            }
            (Law::ExponentialStretch { youngs_modulus, nonlinearity, transition }, radius, density)
        }
        _ => {
            let kind: String = kind.chars().take(20).flat_map(char::escape_debug).collect();
            let what = format!("there is no reaction of type `{kind}`");
            return Err(parser.error(
                line.number,
                what,
                REACTIONS,
                "give other laws in the case file or in the .toml file",
            ));
        }
    };
    let density = parser.real(line, density)?;
    if density < 0.0 {
        let what = format!("the density is {density}");
        return Err(parser.error(line.number, what, "a density of at least 0", "give the value of a real fiber"));
    }
    Ok(FiberMaterial { law, radius, density: Some(density) })
}

fn number(parser: &mut Parser<'_>, line: Line<'_>, reactions: usize) -> Result<u16, InputError> {
    let [word]: [&str; 1] = parser.words(line, "the reaction of a fiber")?;
    let number = parser.whole(line, word)?;
    match u16::try_from(number) {
        Ok(small) if usize::from(small) < reactions => Ok(small),
        _ => {
            let (what, last) = (format!("there is no reaction {number}"), reactions - 1);
            Err(parser.error(
                line.number,
                what,
                format!("reactions 0 to {last}"),
                "correct the number of this fiber's law",
            ))
        }
    }
}
