#!/usr/bin/env bash
# Builds the C interface, then compiles and runs a C and a Fortran program that use two backends each, shared and static,
# under valgrind where it is installed. Needs a C and a Fortran compiler (CC, FC).
set -euo pipefail
cd "$(dirname "$0")/.."

target=${CARGO_TARGET_DIR:-$PWD/target}
out=$target/capi
mkdir -p "$out"

cargo run --quiet --target-dir "$target/headers" --manifest-path tools/headers/Cargo.toml -- --check
for kind in cdylib staticlib; do
    cargo rustc --quiet --lib --crate-type "$kind" --no-default-features --features sparse,dense,batched,capi
done
cp "$target/debug/libbiotissue.so" "$target/debug/libbiotissue.a" "$out"

check() {
    if command -v valgrind >/dev/null; then
        # LeakSanitizer's kind of question: nothing lost, nothing read or written that is not ours.
        (cd "$out" && valgrind --quiet --error-exitcode=9 --leak-check=full --show-leak-kinds=definite,indirect,possible \
            --errors-for-leak-kinds=definite,indirect,possible "$@")
    else
        (cd "$out" && "$@")
    fi
}

cc=${CC:-cc}
fc=${FC:-gfortran}
$cc -std=c11 -Wall -Wextra -Werror -g -Iinclude tests/capi/springs.c -o "$out/springs-shared" \
    -L"$out" -lbiotissue -Wl,-rpath,"$out" -lm
$cc -std=c11 -Wall -Wextra -Werror -g -Iinclude tests/capi/springs.c -o "$out/springs-static" \
    "$out/libbiotissue.a" -lm -lpthread -ldl
$fc -std=f2018 -Wall -g -J"$out" include/las.f90 tests/capi/springs.f90 -o "$out/springs-fortran" \
    -L"$out" -lbiotissue -Wl,-rpath,"$out"
for program in springs-shared springs-static springs-fortran; do
    check "./$program"
done
