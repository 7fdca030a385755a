//! Makes the C interface of every backend that is compiled in, from one template.

use std::path::PathBuf;
use std::{env, fs};

const TEMPLATE: &str = "src/capi/template.rs";
const BACKENDS: [&str; 4] = ["sparse", "dense", "batched", "petsc"];

fn main() {
    println!("cargo::rerun-if-changed={TEMPLATE}");
    if env::var_os("CARGO_FEATURE_CAPI").is_some() {
        c_interface();
    }
}

fn c_interface() {
    let template = fs::read_to_string(TEMPLATE).expect("the template of the C interface");
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo names a folder"));
    for backend in BACKENDS {
        let text = template.replace("BACKEND", backend);
        fs::write(out.join(format!("las_{backend}.rs")), text).expect("cargo's folder can be written to");
    }
}
