//! Printing to a program that may stop reading, such as `head`.

use std::fmt::Arguments;
use std::io::{ErrorKind, Write as _};

/// Prints a line like `println!`, but ends the program without a message if nobody reads any more.
macro_rules! line {
    () => { $crate::output::print(format_args!("")) };
    ($($argument:tt)*) => { $crate::output::print(format_args!($($argument)*)) };
}
pub(crate) use line;

/// Prints a line.
pub fn print(text: Arguments<'_>) {
    if let Err(error) = writeln!(std::io::stdout(), "{text}") {
        if error.kind() == ErrorKind::BrokenPipe {
            std::process::exit(0);
        }
        eprintln!("error: standard output: {error}");
        std::process::exit(1);
    }
}
