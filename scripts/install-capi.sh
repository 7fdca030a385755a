#!/usr/bin/env bash
# Installs the C interface: libraries, header, Fortran module source and a pkg-config file.
#
#     bash scripts/install-capi.sh PREFIX [FEATURES]
#
# FEATURES: the backends, by default sparse,dense,batched. README.md shows how to compile programs. PROFILE=checked builds an
# unoptimized library that checks more, such as whether added entries are in the pattern of the matrix.
set -euo pipefail

prefix=${1:?no folder given; usage: bash scripts/install-capi.sh PREFIX [FEATURES]}
mkdir -p "$prefix"
prefix=$(cd "$prefix" && pwd)
cd "$(dirname "$0")/.."
features=${2:-sparse,dense,batched}
profile=${PROFILE:-release}
target=${CARGO_TARGET_DIR:-$PWD/target}
version=$(sed -n 's/^version = "\(.*\)"/\1/p' Cargo.toml | head -1)
# The soname contains the minor version, because minor versions before 1.0 are incompatible.
soname=liblas.so.${version%.*}
linker=()
if [ "$(uname)" = Linux ]; then linker=(-C "link-arg=-Wl,-soname,$soname"); fi
cargo rustc --quiet --profile "$profile" --lib --crate-type cdylib,staticlib --no-default-features --features "$features,capi" -- "${linker[@]}"
case $profile in
dev) built=$target/debug ;;
*) built=$target/$profile ;;
esac
mkdir -p "$prefix/lib/pkgconfig" "$prefix/include"
install -m 755 "$built/libbiotissue.so" "$prefix/lib/liblas.so.$version"
ln -sf "liblas.so.$version" "$prefix/lib/$soname"
ln -sf "$soname" "$prefix/lib/liblas.so"
install -m 644 "$built/libbiotissue.a" "$prefix/lib/liblas.a"
install -m 644 include/las.h include/las.f90 "$prefix/include"
requires=
case ,$features, in
*,petsc,*) if pkg-config --exists PETSc; then requires="Requires.private: PETSc"; else requires="Requires.private: petsc"; fi ;;
esac
cat >"$prefix/lib/pkgconfig/las.pc" <<END_OF_FILE
prefix=$prefix
libdir=\${prefix}/lib
includedir=\${prefix}/include

Name: las
Description: Linear-algebra interface of biotissue; backends: $features
Version: $version
$requires
Libs: -L\${libdir} -llas
Libs.private: -lm -lpthread -ldl
Cflags: -I\${includedir}
END_OF_FILE
echo "installed in $prefix; PKG_CONFIG_PATH=$prefix/lib/pkgconfig pkg-config --cflags --libs las"
