//! The micro scale: creates and deletes RVEs on command of the macro scale, solves them, and sends the answers.

use std::collections::{HashMap, HashSet};
use std::time::Instant;

use super::TwoScaleError;
use super::channels::Channels;
use super::protocol::{
    Answer, Command, Failed, MACRO, NetworkOutput, NewRve, RankReport, Seconds, SerializeIter, Strain, Task,
    UnitReport, pack, pack_into, unpack,
};
use crate::app::case::{Case, RveOutput};
use crate::app::checkpoint::UnitRecord;
use crate::coupling::Scales;
use crate::las::{Backend, Comm, Message, Scalar};
use crate::tissue::micro_scale::{ElementMaterial, Library, PointFailure, PointSummary, UnitState, Units};

/// The main function of the micro scale on one rank.
///
/// # Errors
/// Returns [`TwoScaleError`] if communication fails, a message does not follow the protocol, or a saved state does not
/// match its RVE.
pub fn run<C: Comm, B: Backend<Scalar = f64>>(
    scales: &Scales<C>,
    case: &Case,
    library: Library<B>,
) -> Result<(), TwoScaleError>
where
    B::Reduced: Scalar,
{
    MicroSide::new(scales, case, library)?.run()
}

/// The RVEs of a rank and their couplings.
struct MicroSide<'a, C: Comm, B: Backend> {
    scales: &'a Scales<C>,
    /// Index of the macro scale in `scales`.
    above: usize,
    drawn: RveOutput,
    units: Units<B>,
    channels: Channels<C>,
    /// The last strains received, in the order of the units.
    asked: Vec<Strain>,
    failed: Option<PointFailure>,
    seconds: Vec<Seconds>,
    /// Times since the last answers were sent, counted at the next ones.
    between: Seconds,
}

impl<'a, C: Comm, B: Backend<Scalar = f64>> MicroSide<'a, C, B>
where
    B::Reduced: Scalar,
{
    fn new(scales: &'a Scales<C>, case: &Case, library: Library<B>) -> Result<Self, TwoScaleError> {
        let above = scales.find(MACRO).ok_or(TwoScaleError::Scale(MACRO))?;
        let channels = Channels::new(scales)?;
        let (units, drawn) = (Units::new(library), case.output.rve.clone());
        let (asked, failed, seconds, between) = (Vec::new(), None, Vec::new(), Seconds::default());
        Ok(Self { scales, above, drawn, units, channels, asked, failed, seconds, between })
    }

    fn run(mut self) -> Result<(), TwoScaleError> {
        let mut complete = false;
        while !complete {
            match self.command()? {
                Command::Units => {
                    let start = Instant::now();
                    self.update_units()?;
                    self.between.exchanging += start.elapsed().as_secs_f64();
                }
                Command::Step => {
                    let mut step_complete = false;
                    while !step_complete {
                        self.answer_strains()?;
                        step_complete = self.commands_of_step()?;
                    }
                }
                Command::Complete => complete = true,
                between => self.between_steps(between)?,
            }
        }
        Ok(())
    }

    /// Carries out commands after the answers; returns false if the macro scale asks for another trial state of the
    /// step.
    fn commands_of_step(&mut self) -> Result<bool, TwoScaleError> {
        loop {
            match self.command()? {
                Command::Iterate => return Ok(false),
                // The strain demands new RVEs; the macro scale then solves for equilibrium again.
                Command::Units => {
                    let start = Instant::now();
                    self.update_units()?;
                    self.between.exchanging += start.elapsed().as_secs_f64();
                }
                Command::Explain => {
                    let start = Instant::now();
                    self.explain()?;
                    self.between.exchanging += start.elapsed().as_secs_f64();
                }
                over => {
                    self.between_steps(over)?;
                    return Ok(true);
                }
            }
        }
    }

    fn between_steps(&mut self, command: Command) -> Result<(), TwoScaleError> {
        match command {
            Command::Accept => self.report(true),
            Command::Reject => self.report(false),
            Command::Restore(states) => self.restore(states),
            _ => Err(TwoScaleError::Protocol),
        }
    }

    fn command(&mut self) -> Result<Command, TwoScaleError> {
        let start = Instant::now();
        let news = self.scales.receive(self.above)?;
        self.between.idle += start.elapsed().as_secs_f64();
        Ok(unpack(&news)?)
    }

    /// Deletes RVEs, then creates new ones at rest, as the macro scale commands.
    fn update_units(&mut self) -> Result<(), TwoScaleError> {
        let before = self.channels.units().to_vec();
        let kept = self.channels.down.reconcile_removed()?;
        let kept: HashSet<u64> = kept.into_iter().map(|place| before[place as usize]).collect();
        let gone = before.into_iter().filter(|unit| !kept.contains(unit)).map(|unit| unit as usize).collect();
        self.units.remove(&gone);
        let delta = self.channels.down.reconcile_added()?;
        let mut headers = vec![NewRve { region: 0 }; delta.units().len()];
        self.channels.headers.receive(&delta, &mut headers)?;
        for (&element, header) in delta.units().iter().zip(headers) {
            let element = element as usize;
            if let ElementMaterial::Rve { model, matrix } =
                self.units.library().of_element(header.region as usize, element)
            {
                self.units.add(element, model, matrix);
            }
        }
        self.channels.turn_back();
        Ok(())
    }

    /// Receives a strain for every RVE, brings all RVEs to equilibrium, and sends their answers.
    fn answer_strains(&mut self) -> Result<(), TwoScaleError> {
        self.asked.resize(self.units.len(), Strain { gradient: [0.0; 9], task: Task::Rest as u64 });
        let (start, before) = (Instant::now(), self.channels.strains.waited());
        self.channels.strains.receive(&self.channels.down, &mut self.asked)?;
        let (asked, waited) = (Instant::now(), self.channels.strains.waited() - before);
        let strains = &self.asked;
        let solved = self.units.solve(|number, _| strains[number].for_task(Task::Solve));
        let verified = solved.and_then(|()| self.units.verify(|number, _| strains[number].for_task(Task::Verify)));
        let (replaced, failed) = match verified {
            Ok(replaced) => (replaced, None),
            Err(failure) => (Vec::new(), Some(failure)),
        };
        let solved = Instant::now();
        let is_replaced = |number: usize| replaced.binary_search(&number).is_ok();
        let answers = self.units.answers().enumerate().map(|(number, (element, response))| {
            Answer::new(element, response.filter(|_| failed.is_none()), is_replaced(number))
        });
        let answers: Vec<Answer> = answers.collect();
        self.failed = failed;
        self.channels.answers.send(&self.channels.back, &answers)?;
        let between = std::mem::take(&mut self.between);
        self.seconds.push(Seconds {
            busy: (solved - asked).as_secs_f64() + between.busy,
            idle: waited.as_secs_f64() + between.idle,
            exchanging: (asked - start - waited + solved.elapsed()).as_secs_f64() + between.exchanging,
        });
        Ok(())
    }

    /// Sends the macro scale the failure of the lowest element with one on each rank of this scale.
    fn explain(&mut self) -> Result<(), TwoScaleError> {
        let failed = self.failed.take().map(|failure| {
            let start = self.units.take_lost().map(|lost| {
                let mut gradient = [0.0; 9];
                gradient.copy_from_slice(lost.dump.target.as_slice());
                let state = UnitState { rve: Some(lost.dump.start), answer: None, iterations: 0 };
                (lost.model, UnitRecord::from(state), gradient)
            });
            Failed { failure, start }
        });
        // `Units` reverts on the rank of the failed RVE; the other ranks revert too, so that the start of the next
        // trial state does not depend on the distribution of RVEs.
        self.units.revert();
        self.gather_to_macro(pack(&failed)?)
    }

    /// Commits or reverts the step and sends the report of this rank to the macro scale. The time for that counts for
    /// the next step.
    fn report(&mut self, converged: bool) -> Result<(), TwoScaleError> {
        let start = Instant::now();
        if converged {
            self.units.commit()
        } else {
            self.units.revert()
        }
        let summaries = if converged { self.units.summaries() } else { Vec::new() };
        let seconds = std::mem::take(&mut self.seconds);
        let summarized = Instant::now();
        let units = || {
            summaries.iter().enumerate().map(|(number, summary)| UnitReport {
                element: self.units.elements()[number] as u64,
                summary: summary.clone(),
                state: self.units.state(number).into(),
                network: self.drawn(number, summary.as_ref()),
            })
        };
        let report = RankReport {
            stats: self.units.take_stats(),
            bytes: self.units.bytes(),
            seconds,
            units: SerializeIter(units),
        };
        // The size of the RVEs is about that of the report.
        self.gather_to_macro(pack_into(Message::zeros(report.bytes), &report)?)?;
        self.between.busy += (summarized - start).as_secs_f64();
        self.between.exchanging += summarized.elapsed().as_secs_f64();
        Ok(())
    }

    /// The deformed network of a unit, if the case requests it as output.
    fn drawn(&self, number: usize, summary: Option<&PointSummary>) -> Option<NetworkOutput> {
        let element = self.units.elements()[number];
        let is_drawn = match &self.drawn {
            RveOutput::None => false,
            RveOutput::All => true,
            RveOutput::Elements(elements) => elements.binary_search(&element).is_ok(),
        };
        let model = summary.map_or(0, |summary| summary.network);
        let deformed = if is_drawn { self.units.deformed_network(number) } else { None };
        deformed.map(|deformed| NetworkOutput::new(model, deformed))
    }

    /// Gathers a message of every rank of this scale and sends them to the macro scale, in the order of ranks.
    fn gather_to_macro(&self, message: Message) -> Result<(), TwoScaleError> {
        let all = self.scales.comm().gather(0, message)?;
        Ok(self.scales.broadcast(self.above, Message::join(all.unwrap_or_default()))?)
    }

    fn restore(&mut self, states: Vec<(u64, UnitRecord)>) -> Result<(), TwoScaleError> {
        let mut states: HashMap<u64, UnitRecord> = states.into_iter().collect();
        let own = self.units.elements().iter().filter_map(|&element| states.remove(&(element as u64)));
        let own = own.map(Into::into).collect();
        self.units.restore(own).map_err(|error| TwoScaleError::State(error.to_string()))
    }
}
