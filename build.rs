//! Finds PETSc where the feature `petsc` is on, and makes the C interface of every backend where `capi` is.

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rustc-check-cfg=cfg(petsc_has, values(\"mumps\", \"superlu_dist\", \"hypre\", \"suitesparse\"))");
    #[cfg(feature = "petsc")]
    if let Err(reason) = petsc::find() {
        fail(&reason);
    }
    #[cfg(feature = "capi")]
    if let Err(reason) = capi::write() {
        fail(&reason);
    }
}

#[cfg(any(feature = "petsc", feature = "capi"))]
fn fail(reason: &str) -> ! {
    eprintln!("error: {reason}");
    std::process::exit(1)
}

/// One copy of the template for each backend, the word BACKEND replaced by its name. `tools/headers` does the same.
#[cfg(feature = "capi")]
mod capi {
    use std::path::PathBuf;
    use std::{env, fs};

    const TEMPLATE: [&str; 4] = ["vector", "matrix", "products", "solver"];
    /// What PETSc has beside the template.
    const RANKS: &str = "ranks";

    pub fn write() -> Result<(), String> {
        let out = PathBuf::from(env::var_os("OUT_DIR").ok_or("cargo names no OUT_DIR")?);
        let template = TEMPLATE.map(read).into_iter().collect::<Result<String, _>>()?;
        let ranks = read(RANKS)?;
        for backend in ["sparse", "dense", "batched", "petsc"] {
            let mut text = template.replace("BACKEND", backend);
            if backend == "petsc" {
                text.push_str(&ranks);
            }
            let file = out.join(format!("las_{backend}.rs"));
            fs::write(&file, text).map_err(|error| format!("{}: {error}", file.display()))?;
        }
        Ok(())
    }

    fn read(part: &str) -> Result<String, String> {
        let file = format!("src/capi/template/{part}.rs");
        println!("cargo:rerun-if-changed={file}");
        fs::read_to_string(&file).map_err(|error| format!("{file}: {error}"))
    }
}

#[cfg(feature = "petsc")]
mod petsc {
    use std::fs;
    use std::path::PathBuf;

    /// The packages that decide which solvers there are.
    const PACKAGES: [&str; 4] = ["mumps", "superlu_dist", "hypre", "suitesparse"];

    /// Links PETSc and tells the crate which packages it was built with.
    pub fn find() -> Result<(), String> {
        println!("cargo:rerun-if-env-changed=PKG_CONFIG_PATH");
        let library = probe()?;
        let folders: Vec<PathBuf> = library.include_paths;
        let configuration = read(&folders, "petscconf.h")?;
        let version = read(&folders, "petscversion.h")?;
        supported(&configuration, &version)?;
        for package in PACKAGES {
            if is_set(&configuration, &format!("PETSC_HAVE_{}", package.to_uppercase())) {
                println!("cargo:rustc-cfg=petsc_has=\"{package}\"");
            }
        }
        let [major, minor, patch] =
            ["MAJOR", "MINOR", "SUBMINOR"].map(|part| number(&version, &format!("PETSC_VERSION_{part}")).unwrap_or(0));
        println!("cargo:rustc-env=BIOTISSUE_PETSC_VERSION={major}.{minor}.{patch}");
        Ok(())
    }

    fn probe() -> Result<pkg_config::Library, String> {
        let first = match pkg_config::Config::new().atleast_version("3.18").probe("PETSc") {
            Ok(library) => return Ok(library),
            Err(error) => error,
        };
        pkg_config::Config::new().atleast_version("3.18").probe("petsc").map_err(|_| {
            format!(
                "the feature `petsc` needs PETSc 3.18 or later, and pkg-config finds none.\n  cure: install it (Debian and \
                 Ubuntu: petsc-dev), or let PKG_CONFIG_PATH name the folder of its PETSc.pc.\n{first}"
            )
        })
    }

    fn read(folders: &[PathBuf], name: &str) -> Result<String, String> {
        let found = folders.iter().find_map(|folder| fs::read_to_string(folder.join(name)).ok());
        found.ok_or_else(|| {
            format!("pkg-config names PETSc, but there is no {name} in {folders:?}.\n  cure: install its headers (petsc-dev)")
        })
    }

    /// Refuses a PETSc whose numbers are not those that the crate is written for.
    fn supported(configuration: &str, version: &str) -> Result<(), String> {
        let refuse = |what: &str| {
            Err(format!(
                "this PETSc has {what}.\n  cure: let PKG_CONFIG_PATH name one with real double-precision scalars and 32-bit indices"
            ))
        };
        if is_set(configuration, "PETSC_USE_COMPLEX") {
            return refuse("complex scalars");
        }
        if !is_set(configuration, "PETSC_USE_REAL_DOUBLE") {
            return refuse("scalars of another precision than double");
        }
        if is_set(configuration, "PETSC_USE_64BIT_INDICES") {
            return refuse("64-bit indices");
        }
        match (number(version, "PETSC_VERSION_MAJOR"), number(version, "PETSC_VERSION_MINOR")) {
            (Some(3), Some(18..)) => Ok(()),
            (major, minor) => refuse(&format!("the version {major:?}.{minor:?}, not 3.18 or a later 3")),
        }
    }

    /// Whether the header defines the name.
    fn is_set(header: &str, name: &str) -> bool {
        value(header, name).is_some()
    }

    fn number(header: &str, name: &str) -> Option<u32> {
        value(header, name)?.parse().ok()
    }

    fn value<'a>(header: &'a str, name: &str) -> Option<&'a str> {
        header.lines().find_map(|line| {
            let mut words = line.strip_prefix("#define")?.split_whitespace();
            (words.next()? == name).then(|| words.next().unwrap_or(""))
        })
    }
}
