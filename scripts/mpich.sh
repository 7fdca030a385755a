#!/usr/bin/env bash
# Runs `tests/mpi.rs` (ranks, couplings, exchange) on MPICH, with up to 12 processes.
#
# Installs MPICH, next to another MPI, if it is missing (Debian and Ubuntu). PETSc is not tested, because its packages are
# built for the default MPI.
set -euo pipefail
cd "$(dirname "$0")/.."

if ! command -v mpicc.mpich >/dev/null; then
    sudo=
    if [ "$(id -u)" -ne 0 ]; then sudo=sudo; fi
    $sudo apt-get install --yes --no-install-recommends mpich libmpich-dev libclang-dev
fi
# The Rust bindings are generated for one MPI, so they are built in a separate folder.
export MPICC=mpicc.mpich MPIRUN=mpirun.mpich CARGO_TARGET_DIR=${CARGO_TARGET_DIR:-$PWD/target}/mpich
cargo test --quiet --no-default-features --features sparse,mpi --test mpi
