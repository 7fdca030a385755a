#!/usr/bin/env bash
# Passes the tests of ranks, couplings and the exchange on MPICH: those of `tests/mpi.rs`, on 1 to 8 processes.
#
# Installs MPICH beside another MPI as packages of the system where it is missing (Debian and Ubuntu). PETSc is not touched:
# its packages are built for one MPI.
set -euo pipefail
cd "$(dirname "$0")/.."

if ! command -v mpicc.mpich >/dev/null; then
    sudo=
    if [ "$(id -u)" -ne 0 ]; then sudo=sudo; fi
    $sudo apt-get install --yes --no-install-recommends mpich libmpich-dev libclang-dev
fi
# The bindings are of one MPI: a folder of their own.
export MPICC=mpicc.mpich MPIRUN=mpirun.mpich CARGO_TARGET_DIR=${CARGO_TARGET_DIR:-$PWD/target}/mpich
cargo test --quiet --no-default-features --features sparse,mpi --test mpi
