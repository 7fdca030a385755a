//! `cargo run --release --package overhead [--features petsc] [-- COMMAND]`
//!
//! * without a command: prints the instructions of every verb in five ways, and fails if LAS has more than a call by
//!   hand; with PETSc and valgrind, also the instructions executed by calls of PETSc, and fails if LAS executes more;
//! * `page FILE`: writes the page of the documentation, including the assembly loop under valgrind's callgrind;
//! * `list BACKEND VERB WAY`: prints the instructions of one calling function;
//! * `call VERB WAY`: calls a verb on PETSc (for callgrind);
//! * `loop BACKEND WAY`: runs the assembly loop once (for callgrind).

use std::error::Error;
use std::process::ExitCode;

use overhead::image::Image;
use overhead::{assembly, compare, executed, page, ways};

fn main() -> ExitCode {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = words.iter().map(String::as_str).collect();
    match run(&words) {
        Ok(code) => code,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run(words: &[&str]) -> Result<ExitCode, Box<dyn Error>> {
    match *words {
        [] => {
            let rows = compare::rows(&Image::of_this_program()?)?;
            print!("{}", page::table(&rows));
            let mut violations = compare::violations(&rows);
            if executed::is_possible() {
                let calls = executed::all()?;
                print!("\n{}", executed::table(&calls));
                violations.extend(executed::violations(&calls));
            }
            violations.iter().for_each(|violation| eprintln!("{violation}"));
            Ok(if violations.is_empty() { ExitCode::SUCCESS } else { ExitCode::FAILURE })
        }
        ["page", file] => {
            let rows = compare::rows(&Image::of_this_program()?)?;
            std::fs::write(file, page::page(&rows, &executed::all()?, &page::loops()?))?;
            Ok(ExitCode::SUCCESS)
        }
        ["list", backend, verb, way] => {
            let all = ways::all();
            let place = all.iter().find(|place| place.backend == backend && place.verb == verb);
            let place = place.ok_or("there is no such backend or verb")?;
            let [call, table, object] = place.others;
            let ways = page::WAYS.iter().zip([place.raw, place.las, call, table, object]);
            let (_, at) = ways.into_iter().find(|(name, _)| **name == way).ok_or("there is no such way")?;
            for instruction in Image::of_this_program()?.listing(at)?.instructions {
                println!("{:?}", instruction.code());
            }
            Ok(ExitCode::SUCCESS)
        }
        ["call", verb, way] => {
            executed::call(verb, way)?;
            Ok(ExitCode::SUCCESS)
        }
        ["loop", backend, way] => {
            let side = page::SIDE;
            let time = assembly::run(backend, way, side, 1)?;
            println!("{:.1} us", time.as_secs_f64() * 1e6);
            Ok(ExitCode::SUCCESS)
        }
        _ => Err("no command, `page FILE`, `list BACKEND VERB WAY`, `call VERB WAY` or `loop BACKEND WAY`".into()),
    }
}
