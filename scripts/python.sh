#!/usr/bin/env bash
# Builds the wheel of the Python package, installs it in an environment of its own below `target`, and runs its tests,
# which run the example and the programs of the documents too. Arguments go to pytest, for example: -k network
#
# Needs Rust, and Python 3.10 or newer.
set -euo pipefail
cd "$(dirname "$0")/.."

environment="$PWD/target/python-package"
if ! "$environment/bin/python3" -c 'import maturin, mypy, numpy, pytest, scipy' 2>/dev/null; then
    rm -rf "$environment"
    python3 -m venv "$environment"
    "$environment/bin/pip" install --quiet --disable-pip-version-check 'maturin>=1.9.4,<2' mypy numpy pytest scipy
fi

# The profile `dev`, in which the assertions of the library are on. (`pip install ./python` builds a release.)
wheels="$PWD/target/wheels"
rm -rf "$wheels"
"$environment/bin/maturin" build --quiet --locked --manifest-path python/Cargo.toml --interpreter "$environment/bin/python3" \
    --compatibility linux --out "$wheels"
"$environment/bin/pip" install --quiet --disable-pip-version-check --force-reinstall --no-deps "$wheels"/biotissue-*.whl
"$environment/bin/pytest" --quiet -p no:cacheprovider "$@" python/tests
