//! Starts a program as several MPI processes.

use std::ffi::{OsStr, OsString};
use std::io;
use std::path::Path;
use std::process::Command;

/// The command that starts MPI processes: `mpirun`, or the value of the environment variable `MPIRUN`.
pub struct Launcher {
    program: OsString,
    /// True for Open MPI, which starts more processes than cores only with an option.
    is_open_mpi: bool,
}

impl Launcher {
    /// Finds the command and determines its implementation of MPI.
    pub fn find() -> io::Result<Self> {
        let program = std::env::var_os("MPIRUN").unwrap_or_else(|| "mpirun".into());
        let version = command(&program).arg("--version").output()?;
        let is_open_mpi = String::from_utf8_lossy(&version.stdout).contains("Open MPI");
        Ok(Self { program, is_open_mpi })
    }

    /// Returns the command that runs a program on `ranks` ranks and ends them after `seconds` seconds.
    pub fn command(&self, program: &Path, ranks: usize, seconds: u32) -> Command {
        let mut command = command(&self.program);
        if self.is_open_mpi {
            command.arg("--oversubscribe");
        }
        command.args(["-n", &ranks.to_string()]).arg(program);
        command.env("MPIEXEC_TIMEOUT", seconds.to_string()).env("OMP_NUM_THREADS", "1");
        command
    }
}

/// Returns a command whose environment allows the user root, as in containers.
fn command(program: &OsStr) -> Command {
    let mut command = Command::new(program);
    command.envs([("OMPI_ALLOW_RUN_AS_ROOT", "1"), ("OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "1")]);
    command
}
