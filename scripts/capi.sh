#!/usr/bin/env bash
# Installs the C interface beside the build, then compiles and runs a C and a Fortran program that use two backends each,
# shared and static, and one on the ranks of PETSc: under valgrind, which finds no leak and no access that is not ours. Needs
# a C and a Fortran compiler (CC, FC, MPICC), pkg-config, valgrind, and PETSc for the last.
set -euo pipefail
cd "$(dirname "$0")/.."

out=${CARGO_TARGET_DIR:-$PWD/target}/capi
mkdir -p "$out"
cc=${CC:-cc}
fc=${FC:-gfortran}
mpicc=${MPICC:-mpicc}
strict=(-std=c11 -Wall -Wextra -Werror -g)

las() { # folder, questions to pkg-config
    PKG_CONFIG_PATH=$out/$1/lib/pkgconfig${PKG_CONFIG_PATH:+:$PKG_CONFIG_PATH} pkg-config "${@:2}" las
}

cargo run --quiet --package headers -- --check

PROFILE=checked bash scripts/install-capi.sh "$out/plain" sparse,dense,batched
# shellcheck disable=SC2046
{
    $cc "${strict[@]}" tests/capi/springs.c -o "$out/springs-shared" $(las plain --cflags --libs) -lm \
        -Wl,-rpath,"$out/plain/lib"
    $cc "${strict[@]}" tests/capi/springs.c -o "$out/springs-static" $(las plain --cflags) "$out/plain/lib/liblas.a" \
        -lm -lpthread -ldl
    $fc -std=f2018 -Wall -g -J"$out" "$out/plain/include/las.f90" tests/capi/springs.f90 -o "$out/springs-fortran" \
        $(las plain --libs) -Wl,-rpath,"$out/plain/lib"
}
for program in springs-shared springs-static springs-fortran; do
    echo "$program:"
    (cd "$out" && bash "$OLDPWD/scripts/memcheck.sh" "./$program")
done

PROFILE=checked bash scripts/install-capi.sh "$out/petsc" sparse,petsc
# shellcheck disable=SC2046
$mpicc "${strict[@]}" tests/capi/ranks.c -o "$out/ranks" $(las petsc --cflags --libs) -lm -Wl,-rpath,"$out/petsc/lib"
export OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1
for ranks in 1 2; do
    for way in "" of-the-library; do
        echo "ranks, $ranks $way:"
        # shellcheck disable=SC2086
        mpirun --oversubscribe -n "$ranks" bash scripts/memcheck.sh "$out/ranks" $way
    done
done
