//! Compiles the short C file that sets CHOLMOD's parameters, whose layout differs between versions, and links CHOLMOD.

fn main() {
    println!("cargo:rerun-if-changed=src/cholmod.c");
    // Debian and Fedora install the headers in a separate folder.
    cc::Build::new().file("src/cholmod.c").include("/usr/include/suitesparse").compile("comparison_cholmod");
    println!("cargo:rustc-link-lib=cholmod");
}
