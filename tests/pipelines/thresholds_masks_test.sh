#!/bin/sh
# Tests thresholds.mk and masks.mk on coarse ground: all results exist, tables have one row per map, a
# second run does nothing.
. "$(dirname "$0")/check.sh"
out=$scratch/out

thresholds() {
  make --no-print-directory -f "$source/pipelines/thresholds.mk" OUT="$out/thresholds" \
    SPACING=0.02 TSV="120 700" HADD="1 5" METHODS=corrected CELL=120 SCORE="--voxel-size 0.02" \
    GRASPMAP="$graspmap" "$@"
}
masks() {
  make --no-print-directory -f "$source/pipelines/masks.mk" OUT="$out/masks" \
    SITES="one:$out/thresholds/terrain.pcd" METHODS="thesis corrected" GRIPPERS=scar-e CELL=120 \
    scar-e_mask="--voxel-size 0.02 --extra-void-layers 1" GRASPMAP="$graspmap" "$@"
}

thresholds -j2
require_files "$out/thresholds/corrected.png" "$out/thresholds/thresholds.csv" \
  "$out/thresholds/voxel_youden.svg" "$out/thresholds/place_youden.png" \
  "$out/thresholds/summary/regions.csv"
[ "$(wc -l <"$out/thresholds/thresholds.csv")" -eq 5 ] || fail "not four combinations"
for pair in 120,1 700,1 120,5 700,5; do
  grep -q ",scar-e,0.02,$pair," "$out/thresholds/thresholds.csv" || fail "no combination $pair"
done

masks -j2
require_files "$out/masks/scar-e.png" "$out/masks/sections/scar-e_thesis.png" \
  "$out/masks/one/scar-e/summary/histograms.svg" "$out/masks/maps.csv"
[ "$(wc -l <"$out/masks/pairs.csv")" -eq 2 ] || fail "not one pair"
grep -q '^one,scar-e,thesis,corrected,' "$out/masks/pairs.csv" || fail "another pair"

before=$(listing "$out")
thresholds -j2
masks -j2
[ "$before" = "$(listing "$out")" ] || fail "the second run changed files"
echo "passed"
