#!/usr/bin/env bash
# Runs a program under valgrind. The exit code is 9 after a memory leak or an invalid access; leaks of MPI are ignored.
#
#     bash scripts/memcheck.sh PROGRAM [ARGUMENTS]
set -euo pipefail
root=$(cd "$(dirname "$0")/.." && pwd)

leaks=definite,possible
suppressed=(--suppressions="$root/tests/mpi.supp")
open_mpi=/usr/share/openmpi/openmpi-valgrind.supp
if [ -e "$open_mpi" ]; then
    suppressed+=(--suppressions="$open_mpi")
fi
# Valgrind does not support all instructions; OpenBLAS must use none beyond AVX2.
export OPENBLAS_CORETYPE=Haswell OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1
exec valgrind --quiet --error-exitcode=9 --num-callers=30 --leak-check=full --show-leak-kinds=$leaks \
    --errors-for-leak-kinds=$leaks "${suppressed[@]}" "$@"
