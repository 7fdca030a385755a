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
    for kind in cdylib staticlib; do
        cargo rustc --quiet --lib --crate-type "$kind" --no-default-features --features "$1,capi"
    done
    cp "$target/debug/libbiotissue.so" "$target/debug/libbiotissue.a" "$out/$2"
}

# Nothing lost, nothing read or written that is not ours.
lost=definite,indirect,possible
memcheck=(valgrind --quiet --error-exitcode=9 --leak-check=full --show-leak-kinds=$lost --errors-for-leak-kinds=$lost)

cargo run --quiet --package headers -- --check

build sparse,dense,batched plain
$cc "${strict[@]}" tests/capi/springs.c -o "$out/plain/springs-shared" \
    -L"$out/plain" -lbiotissue -Wl,-rpath,"$out/plain" -lm
$cc "${strict[@]}" tests/capi/springs.c -o "$out/plain/springs-static" "$out/plain/libbiotissue.a" -lm -lpthread -ldl
$fc -std=f2018 -Wall -g -J"$out/plain" include/las.f90 tests/capi/springs.f90 -o "$out/plain/springs-fortran" \
    -L"$out/plain" -lbiotissue -Wl,-rpath,"$out/plain"
for program in springs-shared springs-static springs-fortran; do
    echo "$program:"
    (cd "$out/plain" && "${memcheck[@]}" "./$program")
done

build sparse,petsc petsc
$mpicc "${strict[@]}" tests/capi/ranks.c -o "$out/petsc/ranks" -L"$out/petsc" -lbiotissue -Wl,-rpath,"$out/petsc" -lm
export OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1
for ranks in 1 2; do
    echo "ranks, $ranks:"
    mpirun --oversubscribe -n "$ranks" "$out/petsc/ranks"
    mpirun --oversubscribe -n "$ranks" "$out/petsc/ranks" of-the-library
done
