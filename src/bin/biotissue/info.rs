//! `biotissue info`: version, features, backends compiled in and their libraries.

use clap::Args;
use serde::Serialize;

use crate::failure::Failure;
use crate::output;

/// Print version, features, backends compiled in and their libraries
#[derive(Args)]
pub struct InfoCommand {
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct Info {
    version: &'static str,
    features: Vec<&'static str>,
    backends: Vec<BackendInfo>,
    threads: usize,
}

#[derive(Serialize)]
struct BackendInfo {
    name: &'static str,
    library: String,
}

/// Runs the command.
pub fn run(command: &InfoCommand) -> Result<(), Failure> {
    let info = Info {
        version: env!("CARGO_PKG_VERSION"),
        features: [
            ("sparse", cfg!(feature = "sparse")),
            ("dense", cfg!(feature = "dense")),
            ("batched", cfg!(feature = "batched")),
            ("petsc", cfg!(feature = "petsc")),
            ("cuda", cfg!(feature = "cuda")),
            ("metis", cfg!(feature = "metis")),
            ("mpi", cfg!(feature = "mpi")),
            ("hwloc", cfg!(feature = "hwloc")),
            ("capi", cfg!(feature = "capi")),
            ("generate", cfg!(feature = "generate")),
            ("app", cfg!(feature = "app")),
        ]
        .into_iter()
        .filter_map(|(name, on)| on.then_some(name))
        .collect(),
        backends: biotissue::backends::compiled()
            .iter()
            .map(|&name| BackendInfo { name, library: library(name) })
            .collect(),
        threads: rayon::current_num_threads(),
    };
    if command.json {
        return output::print_json(&info);
    }
    let mut lines = vec![format!("biotissue  {}", info.version), format!("features   {}", info.features.join(", "))];
    for backend in &info.backends {
        lines.push(format!("backend    {:<8} {}", backend.name, backend.library));
    }
    lines.push(format!("threads    {}", info.threads));
    output::print(&lines.join("\n"))
}

/// Returns the library that a backend uses.
fn library(backend: &str) -> String {
    match backend {
        "sparse" | "dense" => "faer 0.24, compiled in".to_owned(),
        #[cfg(feature = "petsc")]
        "petsc" => {
            let packages = biotissue::backends::petsc::Session::packages();
            format!("PETSc {} with {}", biotissue::backends::petsc::Session::version(), packages.join(", "))
        }
        "cuda" => "NVIDIA's, loaded when a run starts".to_owned(),
        _ => "its own".to_owned(),
    }
}
