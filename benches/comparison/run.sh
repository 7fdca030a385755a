#!/usr/bin/env bash
# Compares the direct solver with faer and CHOLMOD on one core. The arguments are parts of the names of networks to run.
#
# Needs Debian's libsuitesparse-dev and libopenblas0-serial, and a C compiler. BIOTISSUE_NETWORKS is the folder of the
# published networks.
set -euo pipefail
cd "$(dirname "$0")"

# Debian's OpenBLAS does not recognize new processors and would use only SSE3 on them.
if [ -z "${OPENBLAS_CORETYPE:-}" ]; then
    if grep -qw avx512f /proc/cpuinfo; then OPENBLAS_CORETYPE=SkylakeX; else OPENBLAS_CORETYPE=Haswell; fi
    export OPENBLAS_CORETYPE
fi
# CHOLMOD requests four threads regardless of OMP_NUM_THREADS, but cannot exceed OMP_THREAD_LIMIT.
export OPENBLAS_NUM_THREADS=1 OMP_NUM_THREADS=1 OMP_THREAD_LIMIT=1
echo "OpenBLAS kernels: $OPENBLAS_CORETYPE; vector instructions: $(grep -owE 'avx|avx2|fma|avx512f' /proc/cpuinfo | sort -u | tr '\n' ' ')"
echo
# Unless another target folder is set, use that of the crate.
export CARGO_TARGET_DIR=${CARGO_TARGET_DIR:-$PWD/../../target}
cargo run --quiet --release -- "$@"
