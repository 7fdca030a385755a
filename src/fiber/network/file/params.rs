//! The `.params` file: the fiber materials.

use std::path::Path;

use super::lines::{COMPARE, Line, Reading};
use crate::fiber::law::{FiberMaterial, Law};
use crate::input::{InputError, InputErrors};

/// The contents of a `.params` file.
#[derive(Debug)]
pub(super) struct Params {
    pub(super) materials: Vec<FiberMaterial>,
    /// One index into `materials` per fiber.
    pub(super) reaction_of: Vec<u16>,
    pub(super) warnings: Vec<String>,
}

const REACTIONS: &str = "`0 radius E density` (linear) or `1 radius E B lambda_t density` (exponential-stretch)";

/// Reads the materials of a network with this number of fibers.
pub(super) fn parse(file: &Path, bytes: &[u8], fibers: usize) -> Result<Params, InputErrors> {
    let mut reading = Reading::new(file);
    let lines = reading.lines(bytes)?;
    let (reactions, numbers) = divide(&mut reading, &lines, fibers)?;
    let mut materials = Vec::with_capacity(reactions.len());
    for &line in reactions {
        let material = reaction(&mut reading, line);
        materials.extend(reading.keep(material)?);
    }
    let mut reaction_of = Vec::with_capacity(numbers.len());
    for &line in numbers {
        let number = number(&mut reading, line, reactions.len());
        reaction_of.extend(reading.keep(number)?);
    }
    reading.outcome()?;
    Ok(Params { materials, reaction_of, warnings: reading.warnings() })
}

/// Checks the header and returns the lines of the reactions and those of the fibers.
fn divide<'l, 't>(
    reading: &mut Reading<'_>,
    lines: &'l [Line<'t>],
    fibers: usize,
) -> Result<(&'l [Line<'t>], &'l [Line<'t>]), InputError> {
    let expected = "two counts: REACTIONS FIBERS";
    let Some((&header, rest)) = lines.split_first() else {
        return Err(InputError::in_file(reading.file, "the file is empty", expected, COMPARE));
    };
    let [reactions, counted]: [&str; 2] = reading.words(header, expected)?;
    let (reactions, counted) = (reading.count(header, reactions)?, reading.count(header, counted)?);
    if counted != fibers as u64 {
        let what = format!("the parameters are for {counted} fibers");
        let expected = format!("{fibers} fibers, as the network has");
        return Err(reading.error(header.number, what, expected, "give the .params file of this network"));
    }
    if !(1..=u64::from(u16::MAX)).contains(&reactions) {
        let what = format!("there are {reactions} reactions");
        return Err(reading.error(header.number, what, "from 1 to 65535 reactions", COMPARE));
    }
    let announced = u128::from(reactions) + u128::from(counted);
    if announced != rest.len() as u128 {
        let what = format!(
            "the header announces {reactions} reactions and {counted} fibers, which is {announced} lines, but {} \
             lines follow",
            rest.len()
        );
        let cure = if announced > rest.len() as u128 { "was the file cut short?" } else { "are there lines too many?" };
        return Err(reading.error(
            header.number,
            what,
            "one line for each thing counted",
            format!("correct it; {cure}"),
        ));
    }
    Ok(rest.split_at(reactions as usize))
}

fn reaction(reading: &mut Reading<'_>, line: Line<'_>) -> Result<FiberMaterial, InputError> {
    let kind = line.text.split_whitespace().next().unwrap_or_default();
    let (law, radius, density) = match kind {
        "0" => {
            let [_, radius, modulus, density]: [&str; 4] = reading.words(line, "0 radius E density")?;
            let radius = reading.positive(line, "radius", radius)?;
            let youngs_modulus = reading.positive(line, "modulus", modulus)?;
            (Law::Linear { youngs_modulus }, radius, density)
        }
        "1" => {
            let [_, radius, modulus, b, transition, density]: [&str; 6] =
                reading.words(line, "1 radius E B lambda_t density")?;
            let radius = reading.positive(line, "radius", radius)?;
            let youngs_modulus = reading.positive(line, "modulus", modulus)?;
            let nonlinearity = reading.positive(line, "nonlinearity B", b)?;
            let transition = reading.real(line, transition)?;
            if transition < 1.0 {
                let what = format!("the transition stretch is {transition}");
                let cure = "give the stretch above which the law goes on along its tangent line";
                return Err(reading.error(line.number, what, "a stretch from 1", cure));
            }
            (Law::ExponentialStretch { youngs_modulus, nonlinearity, transition }, radius, density)
        }
        _ => {
            let kind: String = kind.chars().take(20).flat_map(char::escape_debug).collect();
            let what = format!("there is no reaction of type `{kind}`");
            return Err(reading.error(
                line.number,
                what,
                REACTIONS,
                "name other laws in the case or in the .toml file",
            ));
        }
    };
    let density = reading.real(line, density)?;
    if density < 0.0 {
        let what = format!("the density is {density}");
        return Err(reading.error(line.number, what, "a density from 0", "give the value of a real fiber"));
    }
    Ok(FiberMaterial { law, radius, density: Some(density) })
}

fn number(reading: &mut Reading<'_>, line: Line<'_>, reactions: usize) -> Result<u16, InputError> {
    let [word]: [&str; 1] = reading.words(line, "the reaction of a fiber")?;
    let number = reading.whole(line, word)?;
    match u16::try_from(number) {
        Ok(small) if usize::from(small) < reactions => Ok(small),
        _ => {
            let (what, last) = (format!("there is no reaction {number}"), reactions - 1);
            Err(reading.error(
                line.number,
                what,
                format!("reactions 0 to {last}"),
                "correct the number of this fiber's law",
            ))
        }
    }
}
