#!/usr/bin/env bash
# Runs the checks on an NVIDIA device: all, those whose names contain an argument, or the measurements:
#
#     bash scripts/gpu.sh [WORD..]
#     bash scripts/gpu.sh bench
#
# Without a device or its libraries, it prints the reason and succeeds; with BIOTISSUE_REQUIRE_GPU=1 it fails.
#
# The checks are a program, `tests/cuda`. BIOTISSUE_GPU_TESTS names a prebuilt one, for a machine without Rust, or
# without a network; otherwise a program `cuda-tests` beside this script is run, or else the program is built:
#
#     cargo test --release --features cuda --test cuda --no-run
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)

# Without this, the checks run on an emulated device.
export BIOTISSUE_REQUIRE_GPU="${BIOTISSUE_REQUIRE_GPU:-0}"

# Ends without a failure, unless a device is required.
skip() {
    echo "skipped: $1"
    [ "$BIOTISSUE_REQUIRE_GPU" = 0 ]
    exit
}

# Adds the folders of CUDA that the loader does not know: those of the toolkit and of NVIDIA's Python packages.
add_libraries() {
    local folder python
    python=$(python3 -c 'import site, sys
print(*{*site.getsitepackages(), site.getusersitepackages(), *sys.path}, sep="\n")' 2>/dev/null || true)
    for folder in "${CUDA_HOME:-/usr/local/cuda}"/{lib64,targets/*/lib} /usr/local/cuda-*/lib64 /usr/lib/wsl/lib; do
        if compgen -G "$folder/lib*.so*" >/dev/null; then
            LD_LIBRARY_PATH="${LD_LIBRARY_PATH:+$LD_LIBRARY_PATH:}$folder"
        fi
    done
    while read -r folder; do
        for folder in "$folder"/nvidia/*/lib; do
            if [ -d "$folder" ]; then
                LD_LIBRARY_PATH="${LD_LIBRARY_PATH:+$LD_LIBRARY_PATH:}$folder"
            fi
        done
    done <<<"$python"
    export LD_LIBRARY_PATH
}

# Returns success if the loader finds the library of the driver.
has_driver() {
    local folder searched=${LD_LIBRARY_PATH:-}
    if ldconfig -p 2>/dev/null | grep -q "libcuda\.so"; then
        return 0
    fi
    for folder in ${searched//:/ } /usr/lib/wsl/lib /usr/lib64 /usr/lib/x86_64-linux-gnu /usr/lib/aarch64-linux-gnu; do
        if compgen -G "$folder/libcuda.so*" >/dev/null; then
            return 0
        fi
    done
    return 1
}

known=$(ldconfig -p 2>/dev/null || true)
for library in libnvrtc libcusparse; do
    if ! grep -q "$library\.so" <<<"$known"; then
        add_libraries
        break
    fi
done

tests=${BIOTISSUE_GPU_TESTS:-}
if [ -z "$tests" ] && [ -x "$here/cuda-tests" ]; then
    tests=$here/cuda-tests
fi
if [ -z "$tests" ]; then
    if ! command -v cargo >/dev/null; then
        skip "there is no cargo to build the checks, and no prebuilt program: set BIOTISSUE_GPU_TESTS"
    fi
    # The build takes minutes, in vain without a driver.
    if ! has_driver; then
        skip "libcuda.so was not found: there is no driver of NVIDIA"
    fi
    cd "$here/.."
    tests=$(cargo test --release --features cuda --test cuda --no-run --message-format json |
        sed -n 's/.*"executable":"\([^"]*\/cuda-[^"]*\)".*/\1/p' | tail -1)
fi
if [ ! -x "$tests" ]; then
    echo "error: $tests is not a program" >&2
    exit 1
fi
exec "$tests" "$@"
