#!/usr/bin/env bash
# The direct solver beside faer as it comes and CHOLMOD, on one core. Arguments: parts of the names of networks.
#
# Needs Debian's libsuitesparse-dev and libopenblas0-serial, and a C compiler. BIOTISSUE_NETWORKS names the folder of the
# published networks.
set -euo pipefail
cd "$(dirname "$0")"

# Debian's OpenBLAS does not know new processors and would fall back to SSE3: name the kind of this one.
if [ -z "${OPENBLAS_CORETYPE:-}" ]; then
    if grep -qw avx512f /proc/cpuinfo; then OPENBLAS_CORETYPE=SkylakeX; else OPENBLAS_CORETYPE=Haswell; fi
    export OPENBLAS_CORETYPE
fi
# CHOLMOD asks for four threads whatever OMP_NUM_THREADS says; the limit it cannot exceed.
export OPENBLAS_NUM_THREADS=1 OMP_NUM_THREADS=1 OMP_THREAD_LIMIT=1
echo "OpenBLAS kernels: $OPENBLAS_CORETYPE; vector instructions: $(grep -owE 'avx|avx2|fma|avx512f' /proc/cpuinfo | sort -u | tr '\n' ' ')"
echo
# The crate's folder for what is built, unless another is named.
export CARGO_TARGET_DIR=${CARGO_TARGET_DIR:-$PWD/../../target}
cargo run --quiet --release -- "$@"
