# Sourced by check.sh and .ci/run: runs scripts/lint.sh beside the tests, which alone keep two cores busy for two thirds of the time.

cargo fmt --all --check
# In a group of processes of its own, so that all of them end with this script.
setsid bash scripts/lint.sh &
lints=$!
trap 'kill -- -"$lints" 2>/dev/null || true' EXIT

wait_for_lints() {
    if ! wait "$lints"; then
        echo "error: scripts/lint.sh has failed; its messages are above" >&2
        exit 1
    fi
}
