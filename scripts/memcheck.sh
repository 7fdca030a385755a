#!/usr/bin/env bash
# Runs a program under valgrind: ends with 9 where memory is lost, or read or written where it must not be. What MPI itself
# leaves behind is not counted.
#
#     bash scripts/memcheck.sh PROGRAM [ARGUMENTS]
set -euo pipefail
root=$(cd "$(dirname "$0")/.." && pwd)

lost=definite,possible
suppressed=(--suppressions="$root/tests/mpi.supp")
of_open_mpi=/usr/share/openmpi/openmpi-valgrind.supp
if [ -e "$of_open_mpi" ]; then
    suppressed+=(--suppressions="$of_open_mpi")
fi
# Valgrind does not know the instructions of every processor: no kernels of OpenBLAS beyond AVX2.
export OPENBLAS_CORETYPE=Haswell OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1
exec valgrind --quiet --error-exitcode=9 --num-callers=30 --leak-check=full --show-leak-kinds=$lost \
    --errors-for-leak-kinds=$lost "${suppressed[@]}" "$@"
