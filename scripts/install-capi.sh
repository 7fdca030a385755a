#!/usr/bin/env bash
# Installs the C interface: libraries, header, Fortran module source and a pkg-config file.
#
#     bash scripts/install-capi.sh PREFIX [FEATURES]
#
# FEATURES: the backends, by default sparse,dense,batched. Then: cc $(pkg-config --cflags las) code.c $(pkg-config --libs las)
set -euo pipefail
cd "$(dirname "$0")/.."

prefix=${1:?where to: bash scripts/install-capi.sh PREFIX [FEATURES]}
features=${2:-sparse,dense,batched}
target=${CARGO_TARGET_DIR:-$PWD/target}
for kind in cdylib staticlib; do
    cargo rustc --release --lib --crate-type "$kind" --no-default-features --features "$features,capi"
done
mkdir -p "$prefix/lib/pkgconfig" "$prefix/include"
prefix=$(cd "$prefix" && pwd)
install -m 755 "$target/release/libbiotissue.so" "$prefix/lib/liblas.so"
install -m 644 "$target/release/libbiotissue.a" "$prefix/lib/liblas.a"
install -m 644 include/las.h include/las.f90 "$prefix/include"
version=$(sed -n 's/^version = "\(.*\)"/\1/p' Cargo.toml | head -1)
cat >"$prefix/lib/pkgconfig/las.pc" <<END
prefix=$prefix
libdir=\${prefix}/lib
includedir=\${prefix}/include

Name: las
Description: Linear-algebra abstraction of biotissue; backends: $features
Version: $version
Libs: -L\${libdir} -llas
Libs.private: -lm -lpthread -ldl
Cflags: -I\${includedir}
END
echo "installed in $prefix; PKG_CONFIG_PATH=$prefix/lib/pkgconfig pkg-config --libs las"
