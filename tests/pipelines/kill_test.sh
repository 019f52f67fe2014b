#!/bin/bash
# Checks that a pipeline that is killed repeatedly at random times and restarted gives the bytes of an
# undisturbed run and leaves no temporary files or processes. In one of three cases, one process is
# killed first and the others shortly after. KILLS: number of kills (6). SPACING: spacing of the scene's
# points. SEED: seed of the times. PIECES=1: runs scan.mk with folders of tiles instead. DEMO=1: runs the
# whole demo with the variables of make in DEMO_WITH.
. "$(dirname "$0")/check.sh"
kills=${KILLS:-6}
RANDOM=${SEED:-1}
set -m # one process group per job
if [ -n "${DEMO:-}" ]; then
  pipeline="demo.mk ${DEMO_WITH:-}"
elif [ -n "${PIECES:-}" ]; then
  "$graspmap" simulate terrain --size 3 --spacing 0.02 -o "$scratch/ground" --quiet
  "$graspmap" simulate scan "$scratch/ground" --frames 10 -o "$scratch/scan.db" --quiet
  pipeline="scan.mk SCAN=$scratch/scan.db POSES=odometry TILES=1.5 FUSE=--voxel-size=0.02 MESH=--cell-size=0.02"
else
  pipeline="primitive_shapes.mk SPACING=${SPACING:-0.02}"
fi
mkdir "$scratch/tmp"

start() {
  # shellcheck disable=SC2086 # words
  (cd "$scratch" && GRASPMAP_TEST_RUN=$scratch TMPDIR=$scratch/tmp exec make \
    --no-print-directory -f "$source/pipelines/"$pipeline OUT=out GRASPMAP="$graspmap" -j2) \
    >>"$scratch/log" 2>&1 &
}
wait_ms() { sleep "$(awk -v ms="$1" 'BEGIN { print ms / 1000 }')"; }
# Delays are mostly short and at most 0.4 of the duration of an undisturbed run.
random_ms() { echo $((took_ms * 4 / 10 * RANDOM / 32768 * RANDOM / 32768 * RANDOM / 32768)); }

began=$(date +%s%N)
start
wait $! || { cat "$scratch/log" >&2; fail "the undisturbed run failed"; }
took_ms=$((($(date +%s%N) - began) / 1000000))
expected=$(digest "$scratch/out")
rm -rf "$scratch/out"

killed=0
partly=0
whole_runs=0
with_temporaries=0
for ((n = 0; n < kills; ++n)); do
  # Restarts the pipeline from the beginning if it was complete.
  require_no_processes "$scratch" "$scratch/out"
  start
  job=$!
  wait_ms "$(random_ms)"
  if ((RANDOM % 3 == 0)); then
    one=$(pgrep -g "$job" | shuf -n 1 --random-source=<(yes "$n"))
    if [ -n "$one" ] && kill -KILL "$one" 2>/dev/null; then partly=$((partly + 1)); fi
    wait_ms $((RANDOM % 300))
  fi
  if kill -KILL -- "-$job" 2>/dev/null; then killed=$((killed + 1)); fi
  if wait "$job" 2>/dev/null; then
    whole_runs=$((whole_runs + 1))
    diff <(echo "$expected") <(digest "$scratch/out") || fail "a restarted run gave different bytes"
    rm -rf "$scratch/out"
  elif [ -n "$(find "$scratch/out" -name '*.partial*' 2>/dev/null)" ]; then
    with_temporaries=$((with_temporaries + 1))
  fi
done
require_no_processes "$scratch" "$scratch/out"
start
wait $! || { tail -n 20 "$scratch/log" >&2; fail "the run after the last kill failed"; }
diff <(echo "$expected") <(digest "$scratch/out") || fail "outputs differ after $killed kills"
[ "$killed" -gt 0 ] || fail "no run was killed"
require_no_processes "$scratch" "$scratch/out"
[ -z "$(ls -A "$scratch/tmp")" ] || fail "left in TMPDIR: $(ls -A "$scratch/tmp")"
echo "passed: $killed of $kills kills ($partly of one process first; $with_temporaries left temporary" \
  "files, $whole_runs came after a whole run), $(echo "$expected" | wc -l) files, undisturbed $took_ms ms"
