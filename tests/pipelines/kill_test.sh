#!/bin/bash
# The example's pipeline, killed again and again at random moments and begun once more, ends with the
# bytes of an undisturbed run, and leaves no temporary file and no display behind. KILLS: how often
# (6); SPACING: of the scene's points.
. "$(dirname "$0")/check.sh"
kills=${KILLS:-6}
RANDOM=${SEED:-1}
set -m # a process group a job

start() {
  (cd "$scratch" && exec make --no-print-directory -f "$source/pipelines/primitive_shapes.mk" \
    OUT="$1" SPACING="${SPACING:-0.02}" GRASPMAP="$graspmap" -j2) >>"$scratch/log" 2>&1 &
}
# All outputs; manifests without the section of times.
digest() {
  (cd "$scratch/out" && find . -mindepth 1 ! -type d | LC_ALL=C sort | while read -r file; do
    case $file in
      *.json) sed '/^  "run": {/,$d' "$file" | sha256sum | sed "s|-|$file|" ;;
      *) sha256sum "$file" ;;
    esac
  done)
}

began=$(date +%s%N)
start out
wait $! || { cat "$scratch/log" >&2; fail "the undisturbed run failed"; }
took_ms=$((($(date +%s%N) - began) / 1000000))
expected=$(digest)
rm -rf "$scratch/out"

displays=$(pgrep -c Xvfb || true)
killed=0
for ((n = 0; n < kills; ++n)); do
  # Begun anew when it came to its end.
  start out
  pipeline=$!
  sleep "$(awk -v ms=$((RANDOM * took_ms / 32768)) 'BEGIN { print ms / 2000 }')"
  if kill -KILL -- "-$pipeline" 2>/dev/null; then killed=$((killed + 1)); fi
  if wait "$pipeline" 2>/dev/null; then
    [ "$(digest)" = "$expected" ] || fail "a run that was disturbed before ended with other bytes"
    rm -rf "$scratch/out"
  fi
done
start out
wait $! || { tail -n 20 "$scratch/log" >&2; fail "the run after the last kill failed"; }
diff <(echo "$expected") <(digest) || fail "outputs differ after $killed kills"
[ "$killed" -gt 0 ] || fail "no run was killed"
sleep 1
[ "$(pgrep -c Xvfb || true)" -le "$displays" ] || fail "virtual displays were left behind"
echo "passed: $killed of $kills kills, undisturbed $took_ms ms"
