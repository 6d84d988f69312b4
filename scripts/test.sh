#!/bin/sh
# Run the tests in two processes side by side:  scripts/test.sh PYTHON [ARGUMENTS OF PYTEST]
#
# Kernels are compiled on one core, so that a single process leaves half of two cores idle for much of its time. What the
# tests of sampling and of integrators print is held back until the others are done. They have one thread, as two that
# wait for each other beside another process cost a seventh more. The others need two: with one, Mitsuba never ends to
# write an OpenEXR file.
set -u

python=$1
shift
report='--durations=10 --durations-min=1'
sampled='tests/statistics tests/integrators tests/sampling'
log=$(mktemp)
# Both in the background: a signal ends a wait at once, and then them, where Dr.Jit would make a failed test of it.
# shellcheck disable=SC2086  # several words
STRATALUX_TEST_THREADS=1 "$python" -m pytest $report $sampled "$@" >"$log" 2>&1 &
statistics=$!
# shellcheck disable=SC2086
"$python" -m pytest $report $(printf -- '--ignore=%s ' $sampled) "$@" &
others=$!
trap 'kill "$statistics" "$others" 2>/dev/null; rm -f "$log"' EXIT
trap 'exit 130' INT
trap 'exit 143' TERM HUP

wait "$others"
others_status=$?
echo "$sampled, at the same time:"
wait "$statistics"
statistics_status=$?
cat "$log"

# 5: the arguments select no test there. In both, that is an error.
if [ "$others_status" -eq 5 ]; then exit "$statistics_status"; fi
if [ "$statistics_status" -eq 5 ]; then exit "$others_status"; fi
exit $((others_status > statistics_status ? others_status : statistics_status))
