#!/usr/bin/env bash
# Builds the C interface, then compiles and runs a C and a Fortran program that use two backends each, shared and static, and
# one on the ranks of PETSc: under valgrind, which finds no leak and no access that is not ours. Needs a C and a Fortran
# compiler (CC, FC, MPICC), valgrind, and PETSc for the last.
set -euo pipefail
cd "$(dirname "$0")/.."

target=${CARGO_TARGET_DIR:-$PWD/target}
out=$target/capi
mkdir -p "$out"
cc=${CC:-cc}
fc=${FC:-gfortran}
mpicc=${MPICC:-mpicc}
strict=(-std=c11 -Wall -Wextra -Werror -g -Iinclude)

build() { # features, folder
    mkdir -p "$out/$2"
    cargo rustc --quiet --lib --crate-type cdylib,staticlib --no-default-features --features "$1,capi"
    cp "$target/debug/libbiotissue.so" "$target/debug/libbiotissue.a" "$out/$2"
}

cargo run --quiet --package headers -- --check

build sparse,dense,batched plain
$cc "${strict[@]}" tests/capi/springs.c -o "$out/plain/springs-shared" \
    -L"$out/plain" -lbiotissue -Wl,-rpath,"$out/plain" -lm
$cc "${strict[@]}" tests/capi/springs.c -o "$out/plain/springs-static" "$out/plain/libbiotissue.a" -lm -lpthread -ldl
$fc -std=f2018 -Wall -g -J"$out/plain" include/las.f90 tests/capi/springs.f90 -o "$out/plain/springs-fortran" \
    -L"$out/plain" -lbiotissue -Wl,-rpath,"$out/plain"
for program in springs-shared springs-static springs-fortran; do
    echo "$program:"
    (cd "$out/plain" && bash "$OLDPWD/scripts/memcheck.sh" "./$program")
done

build sparse,petsc petsc
$mpicc "${strict[@]}" tests/capi/ranks.c -o "$out/petsc/ranks" -L"$out/petsc" -lbiotissue -Wl,-rpath,"$out/petsc" -lm
export OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1
for ranks in 1 2; do
    for way in "" of-the-library; do
        echo "ranks, $ranks $way:"
        # shellcheck disable=SC2086
        mpirun --oversubscribe -n "$ranks" bash scripts/memcheck.sh "$out/petsc/ranks" $way
    done
done
