#!/usr/bin/env bash
# Tests the C interface: the commands and first programs of README.md; C and Fortran programs that use two backends, linked
# with the shared and the static library, under valgrind; and a program on PETSc, on one and two ranks.
#
# Needs C and Fortran compilers (CC, FC, MPICC), pkg-config, valgrind and PETSc.
set -euo pipefail
cd "$(dirname "$0")/.."

out=${CARGO_TARGET_DIR:-$PWD/target}/capi
mkdir -p "$out"
cc=${CC:-cc}
fc=${FC:-gfortran}
mpicc=${MPICC:-mpicc}
strict=(-std=c11 -Wall -Wextra -Werror -g)
export PROFILE=checked

las() { # las PREFIX_NAME PKG_CONFIG_OPTIONS...
    PKG_CONFIG_PATH=$out/$1/lib/pkgconfig${PKG_CONFIG_PATH:+:$PKG_CONFIG_PATH} pkg-config "${@:2}" las
}

cargo run --quiet --package headers -- --check

bash scripts/install-capi.sh "$out/plain" sparse,dense,batched
# shellcheck disable=SC2046
{
    $cc "${strict[@]}" -DLIBRARY_HAS_CHECKS tests/capi/springs.c -o "$out/springs-shared" $(las plain --cflags --libs) -lm \
        -Wl,-rpath,"$out/plain/lib"
    $cc "${strict[@]}" -DLIBRARY_HAS_CHECKS tests/capi/springs.c -o "$out/springs-static" $(las plain --cflags) \
        "$out/plain/lib/liblas.a" -lm -lpthread -ldl
    $fc -std=f2018 -Wall -g -J"$out" "$out/plain/include/las.f90" tests/capi/springs.f90 -o "$out/springs-fortran" \
        $(las plain --libs) -Wl,-rpath,"$out/plain/lib"
}
for program in springs-shared springs-static springs-fortran; do
    echo "$program:"
    (cd "$out" && bash "$OLDPWD/scripts/memcheck.sh" "./$program")
done

# The fenced block of README.md that calls install-capi.sh. Its features are those above, so that nothing is built again.
commands=$(awk '/^```sh$/ { inside = 1; block = ""; next }
    /^```$/ { if (inside && block ~ /install-capi/) printf "%s", block; inside = 0 }
    inside { block = block $0 "\n" }' README.md)
printf 'commands of README.md:\n%s\n' "$commands"
printed=$(bash -euo pipefail -c "$commands")
echo "$printed"
if [ "$(grep -cx 'u = 1.0 2.0 3.0' <<<"$printed")" != 2 ]; then
    echo "error: the first programs in C and Fortran do not both print u = 1.0 2.0 3.0" >&2
    exit 1
fi
# shellcheck disable=SC2046
$cc "${strict[@]}" examples/c/first.c -o "$out/first" $(las plain --cflags --libs) -Wl,-rpath,"$out/plain/lib"
bash scripts/memcheck.sh "$out/first"

bash scripts/install-capi.sh "$out/petsc" sparse,petsc
# shellcheck disable=SC2046
$mpicc "${strict[@]}" tests/capi/ranks.c -o "$out/ranks" $(las petsc --cflags --libs) -lm -Wl,-rpath,"$out/petsc/lib"
export OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1
for ranks in 1 2; do
    for option in "" library-starts-mpi; do
        echo "ranks, $ranks $option:"
        # shellcheck disable=SC2086
        mpirun --oversubscribe -n "$ranks" bash scripts/memcheck.sh "$out/ranks" $option
    done
done
