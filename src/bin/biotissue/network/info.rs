//! `biotissue network info`.

use std::path::PathBuf;

use biotissue::backends;
use biotissue::fiber::network::Network;
use biotissue::fiber::network::check::{examine, zero_modes};

use clap::Args;
use serde_json::json;

use super::{json_of_file, not_counted, read, text};
use crate::dispatch::{Job, ProgramBackend, dispatch};
use crate::failure::Failure;
use crate::output;

/// Networks with more unknowns are not checked for zero modes, because that would take more than a few seconds.
const MAX_UNKNOWNS: usize = 60_000;

#[derive(Args)]
pub struct InfoArguments {
    /// The network file
    file: PathBuf,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

pub fn run(arguments: &InfoArguments) -> Result<(), Failure> {
    let read = read(&arguments.file)?;
    let report = examine(&read.network);
    let counted = report.free_dofs <= MAX_UNKNOWNS && !backends::compiled().is_empty();
    let zero_modes = if counted { Some(dispatch(None, ZeroModesJob { network: &read.network })?) } else { None };
    if arguments.json {
        let mut object = json_of_file(&report, &read);
        object["rigidity"] = zero_modes.map_or(json!(null), |zero_modes| json!({ "zero_modes": zero_modes }));
        return output::print_json(&object);
    }
    let rigidity = zero_modes.map_or_else(
        || "  rigidity         not examined; `biotissue network check` does\n".to_owned(),
        |zero_modes| text::rigid_or_floppy(zero_modes, report.free_dofs),
    );
    output::print(&format!("{}\n{}{rigidity}", report.name, text::figures(&report, &read.network, &read.cube, None)))
}

/// The job that counts the zero modes.
struct ZeroModesJob<'a> {
    network: &'a Network,
}

impl Job for ZeroModesJob<'_> {
    type Output = usize;

    fn run<B: ProgramBackend>(self, context: B::Context) -> Result<usize, Failure> {
        zero_modes::<B>(&context, self.network).map_err(|error| not_counted(self.network.name(), &error))
    }
}
