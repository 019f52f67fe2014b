#!/bin/sh
# Tests study.mk on a coarse wall and coarse rocks: tables of locations like the thesis's B 2-3 and B 2-4,
# values in situ only where the robot measured, the inclined body, the published tables if they exist,
# the report. A second run does nothing, and a changed variable is detected.
. "$(dirname "$0")/check.sh"
out=$scratch/study

run() {
  make --no-print-directory -f "$source/pipelines/study.mk" OUT="$out" GRASPMAP="$graspmap" \
    SCENARIOS="3 4" METHODS=thesis STAGES="published grasp report" PLACES=20 TRIALS="--trials 2 --draws 2" INCLINATIONS=25 EDGE=0.03 COUNT=30000 \
    PANORAMA="--stride 3" "$@"
}
# Prints the column $2 of a table without its header.
column() {
  awk -F, -v name="$2" '/^#/ { next }
    !head { for (n = 1; n <= NF; ++n) if ($n == name) column = n; head = 1; next }
    { print $column }' "$1"
}

run -j2 >"$scratch/log"
for scenario in 3_bouldering_wall 4_artificial_rocks; do
  folder=$out/$scenario
  require_files "$folder/site.png" "$folder/panorama.png" "$folder/terrain.pcd" "$folder/panorama.pcd"
  for case in prescan insitu_raw insitu_interpolated; do
    require_files "$folder/thesis/$case/map.pcd" "$folder/thesis/$case/top.png" \
      "$folder/thesis/$case/lookup.csv"
  done
done
require_files "$out/report.html"

# Every location has a row. Pre-scanned, each has a value. In situ, some have a value, but none where the
# robot measured nothing, interpolated or not.
rocks=$out/4_artificial_rocks/thesis/table.csv
wall=$out/3_bouldering_wall/thesis/table.csv
for count in "$rocks 30" "$wall 58"; do
  table=${count% *}
  places=${count#* }
  for name in prescan prescan_combined; do
    [ "$(column "$table" $name | grep -c .)" -eq "$places" ] || fail "$table: $name has gaps"
  done
  visible=$(sed -n 's/.*"visible": \([0-9]*\).*/\1/p' "${table%table.csv}places/realtime_combined.csv.json")
  [ "$visible" -gt 3 ] && [ "$visible" -lt "$places" ] || fail "$table: $visible places are visible"
  for name in realtime_raw realtime_interpolated realtime_combined; do
    seen=$(column "$table" $name | grep -c .)
    [ "$seen" -gt 0 ] && [ "$seen" -le "$visible" ] || fail "$table: $name has $seen values"
  done
done
if column "$wall" prescan | grep -qv '^[01]$'; then fail "the wall's verdicts are not 1 or 0"; fi
column "$rocks" prescan | grep -q '^0\.[0-9]' || fail "the rocks have no scores"
# The combined criterion never accepts more than the score alone.
[ "$(column "$wall" prescan_combined | grep -c 1)" -le "$(column "$wall" prescan | grep -c 1)" ] ||
  fail "the combined criterion holds where the score does not"
[ "$(cut -d, -f1 "$out/3_bouldering_wall/thesis/evaluation/accuracy.csv" | tr '\n' ' ')" = \
  "case prescan_combined realtime_raw realtime_interpolated realtime_combined " ] ||
  fail "the wall's cases are not evaluated"

# A level robot's plane is the ground. An inclined robot's plane is approximately the ground.
planes=$out/4_artificial_rocks/poses/planes.csv
[ "$(cut -d, -f1,2 "$planes" | tr '\n' ' ')" = "direction,inclination_deg level,0 forward,25 \
backward,25 left,25 right,25 " ] || fail "other poses: $(cat "$planes")"
awk -F, 'NR == 2 && !($5 < 2) { exit 1 } NR > 2 && !($5 < 10) { exit 1 }' "$planes" ||
  fail "the plane is not the ground: $(cat "$planes")"
[ "$(head -n 1 "$out/4_artificial_rocks/poses/places_thesis.csv" | tr ',' '\n' | tail -n 5 |
  tr '\n' ' ')" = "level forward_25 backward_25 left_25 right_25 " ] || fail "the number of columns is not that of the poses"

if [ -n "${GRASPMAP_DATA:-}" ]; then
  for rate in "artificial_rocks prescan 0.7333" "artificial_rocks realtime_raw 0.6875" \
    "artificial_rocks_interpolated realtime_interpolated 0.6875" \
    "bouldering_wall realtime_raw 0.7000"; do
    set -- $rate
    grep -q "^$2,.*,$3\$" "$out/published/$1/accuracy.csv" || fail "published: not $rate"
  done
  require_files "$out/4_artificial_rocks/real/thesis/prescan/map.pcd"
fi

before=$(listing "$out")
run -j2 >"$scratch/log"
[ "$before" = "$(listing "$out")" ] || fail "the second run changed files"
map=$(sha256sum <"$out/4_artificial_rocks/thesis/prescan/map.pcd")
run -j2 LOOKUP="--mode maximum --radius 0.05" >"$scratch/log"
[ "$before" != "$(listing "$out")" ] || fail "changed flags of the look-up were not detected"
[ "$map" = "$(sha256sum <"$out/4_artificial_rocks/thesis/prescan/map.pcd")" ] ||
  fail "the look-up changed the map"
for wrong in SCENARIOS=5 METHODS=theses STAGES=all OUT= 'OUT=two words'; do
  if run "$wrong" >/dev/null 2>"$scratch/errors"; then fail "$wrong was accepted"; fi
  grep -q "\*\*\* ${wrong%%=*} .*${wrong#*=}" "$scratch/errors" || fail "the error does not name $wrong"
done
echo "passed"
