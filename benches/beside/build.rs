//! Compiles the few lines of C that fill CHOLMOD's settings, whose layout differs from version to version, and links it.

fn main() {
    println!("cargo:rerun-if-changed=src/cholmod.c");
    // Debian and Fedora keep the headers in a folder of their own.
    cc::Build::new().file("src/cholmod.c").include("/usr/include/suitesparse").compile("beside_cholmod");
    println!("cargo:rustc-link-lib=cholmod");
}
