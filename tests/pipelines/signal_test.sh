#!/bin/bash
# Checks that a pipeline that receives SIGTERM (only make) or SIGTERM and SIGINT (all processes) ends by
# that signal, leaves no processes or partial files, and can be resumed. If two pipelines run in one
# folder, the second reports an error and changes nothing.
. "$(dirname "$0")/check.sh"
RANDOM=${SEED:-1}
set -m # one process group per job

start() {
  (cd "$scratch" && GRASPMAP_TEST_RUN=$scratch exec make --no-print-directory \
    -f "$source/pipelines/primitive_shapes.mk" OUT="${1:-out}" SPACING="${SPACING:-0.03}" \
    GRASPMAP="$graspmap" -j2) >>"$scratch/log" 2>&1 &
}

# Two pipelines at the same time, of which the first is the undisturbed run.
began=$(date +%s%N)
start
first=$!
until [ -n "$(find "$scratch/out" -name 'terrain.pcd' 2>/dev/null)" ]; do
  kill -0 "$first" 2>/dev/null || { cat "$scratch/log" >&2; fail "the first run failed"; }
  sleep 0.05
done
if (cd "$scratch" && make --no-print-directory -f "$source/pipelines/primitive_shapes.mk" OUT=out \
  GRASPMAP="$graspmap") >"$scratch/second" 2>&1; then
  fail "a second run in the folder does not fail"
fi
grep -qx 'out: another make works in this folder' "$scratch/second" || fail "$(cat "$scratch/second")"
wait "$first" || { cat "$scratch/log" >&2; fail "the first of two runs failed"; }
took_ms=$((($(date +%s%N) - began) / 1000000))
expected=$(digest "$scratch/out")
rm -rf "$scratch/out"

ended=0
tell() {
  signal=$1
  status=$2
  whom=$3
  start
  job=$!
  sleep "$(awk -v ms=$((took_ms * RANDOM / 32768)) 'BEGIN { print ms / 1600 }')"
  if [ "$whom" = group ]; then job=-$job; fi
  kill "-$signal" -- "$job" 2>/dev/null || true
  code=0
  wait "${job#-}" 2>/dev/null || code=$?
  require_no_processes "$scratch" "$scratch/out"
  left=$(find "$scratch/out" -name '.*.partial*' 2>/dev/null) || true
  [ -z "$left" ] || fail "after $signal to $whom: left $left"
  case $code in
    "$status") ended=$((ended + 1)) ;;
    0) rm -rf "$scratch/out" ;;
    *) tail -n 20 "$scratch/log" >&2; fail "$signal to $whom: exit status $code, not $status" ;;
  esac
}
for _ in $(seq "${TIMES:-2}"); do
  tell TERM 143 make
  tell TERM 143 group
  tell INT 130 group
done
[ "$ended" -gt 0 ] || fail "no run received the signal in time"
start
wait $! || { tail -n 20 "$scratch/log" >&2; fail "the run after the last signal failed"; }
diff <(echo "$expected") <(digest "$scratch/out") || fail "outputs differ after $ended signals"
echo "passed: $ended runs ended, undisturbed $took_ms ms"
