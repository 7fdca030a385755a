//! `cargo run --package headers`, from the root of the repository: writes `include/las.h` and `include/las.f90` from the
//! source of the C interface. With `--check` it writes nothing and fails where they differ.

mod fortran;

use std::error::Error;
use std::path::{Path, PathBuf};
use std::{env, fs};

const BACKENDS: [&str; 4] = ["sparse", "dense", "batched", "petsc"];
const COMMON: &str = "src/capi/mod.rs";
const TEMPLATE: [&str; 4] = ["vector", "matrix", "products", "solver"];
/// What PETSc has beside the template.
const RANKS: &str = "ranks";

fn main() -> Result<(), Box<dyn Error>> {
    let check = env::args().any(|argument| argument == "--check");
    let common = fs::read_to_string(COMMON)?;
    let template = TEMPLATE.map(part).into_iter().collect::<Result<String, _>>()?;
    let mut parts: Vec<(&str, String)> =
        BACKENDS.iter().map(|&name| (name, template.replace("BACKEND", name))).collect();
    if let Some((_, petsc)) = parts.iter_mut().find(|(name, _)| *name == "petsc") {
        petsc.push_str(&part(RANKS)?);
    }
    put(Path::new("include/las.h"), &header(&parts)?, check)?;
    put(Path::new("include/las.f90"), &fortran::module(&common, &parts)?, check)
}

fn part(name: &str) -> Result<String, std::io::Error> {
    fs::read_to_string(format!("src/capi/template/{name}.rs"))
}

fn put(file: &Path, text: &str, check: bool) -> Result<(), Box<dyn Error>> {
    if !check {
        return Ok(fs::write(file, text)?);
    }
    if fs::read_to_string(file)? == text {
        return Ok(());
    }
    Err(format!("{} is not what the source says: run `cargo run --package headers`", file.display()).into())
}

fn header(parts: &[(&str, String)]) -> Result<String, Box<dyn Error>> {
    let folder = env::temp_dir().join(format!("las-headers-{}", std::process::id()));
    fs::create_dir_all(&folder)?;
    let mut builder = cbindgen::Builder::new()
        .with_language(cbindgen::Language::C)
        .with_cpp_compat(true)
        .with_include_guard("LAS_H")
        .with_documentation(true)
        .with_header(
            "/* The linear-algebra abstraction LAS of the crate biotissue, for C and C++. Made by tools/headers.\n\n   \
             A function returns LAS_OK or what was wrong; las_message() says it in words. Which backends there are, the\n   \
             features of the build decide: link errors name the others. On `batched` an entry is four numbers, one a lane.\n\n   \
             What a caller promises: a pointer is null, which is an error unless the function allows it, or points to as many\n   \
             values as the function says; a handle came from its las_create_... and is not used after its las_destroy_...;\n   \
             the thread that uses a handle is the only one that does so at that time. Different handles may be used by\n   \
             different threads, and a message belongs to the thread whose call failed. On `petsc`, all calls come from the\n   \
             thread that made the first, and all ranks of a handle make the same calls in the same order. When memory runs\n   \
             out, the program ends. */",
        )
        .with_src(PathBuf::from(COMMON));
    for (name, text) in parts {
        let file = folder.join(format!("{name}.rs"));
        fs::write(&file, text)?;
        builder = builder.with_src(file);
    }
    let mut text = Vec::new();
    builder.generate()?.write(&mut text);
    fs::remove_dir_all(&folder)?;
    Ok(String::from_utf8(text)?)
}
