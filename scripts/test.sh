#!/bin/sh
# Run the tests in two processes side by side:  scripts/test.sh PYTHON [ARGUMENTS OF PYTEST]
#
# Each compiles kernels on one core half of the time, so two of them take little longer than one. What the statistical
# tests print is held back until the others are done.
set -u

python=$1
shift
log=$(mktemp)
run() { "$python" -m pytest --durations=10 --durations-min=1 "$@"; }

run tests/statistics "$@" >"$log" 2>&1 </dev/null &
other=$!
trap 'kill "$other" 2>/dev/null; rm -f "$log"' EXIT
trap 'exit 130' INT
trap 'exit 143' TERM HUP

run --ignore=tests/statistics "$@"
rest=$?
echo "tests/statistics, at the same time:"
wait "$other"
statistics=$?
cat "$log"

# 5: the arguments select no test there. Of both, that is an error.
if [ "$rest" -eq 5 ]; then exit "$statistics"; fi
if [ "$statistics" -eq 5 ]; then exit "$rest"; fi
exit $((rest > statistics ? rest : statistics))
