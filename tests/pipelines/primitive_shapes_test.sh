#!/bin/sh
# Tests primitive_shapes.mk on a coarser cloud: all results exist, a second run does nothing, and deleted files are recomputed.
. "$(dirname "$0")/check.sh"
out=$scratch/demo

run() {
  make --no-print-directory -f "$source/pipelines/primitive_shapes.mk" OUT="$out" SPACING=0.02 \
    SHARES=3 GRASPMAP="$graspmap" "$@"
}

run -j2
for method in thesis corrected; do
  folder=$out/$method
  require_files "$folder/map.pcd" "$folder/map.vtp" "$folder/map.pcd.json" "$folder/top.png" \
    "$folder/oblique.png" "$folder/curvature.png" "$folder/roc.png" \
    "$folder/evaluation/summary.md" "$folder/evaluation/roc.svg"
  # A header and 12 locations with values.
  [ "$(wc -l <"$folder/lookup.csv")" -eq 13 ] || fail "$folder/lookup.csv has not 12 places"
  "$graspmap" score "$out/terrain.pcd" --config primitive_shapes_prescan --method "$method" \
    -o "$scratch/whole.pcd" --quiet
  cmp "$scratch/whole.pcd" "$folder/map.pcd" || fail "the $method map is not that of score"
done

before=$(listing "$out")
run -j2
[ "$before" = "$(listing "$out")" ] || fail "the second run changed files"

map=$(sha256sum <"$out/thesis/map.pcd")
rm "$out/thesis/map.pcd" "$out/thesis/top.png"
run
[ "$map" = "$(sha256sum <"$out/thesis/map.pcd")" ] || fail "the recomputed map differs"
require_files "$out/thesis/top.png"

# A changed terrain, gripper or title is detected, even if its file is older.
cp "$source/data/grippers/scar-e.yaml" "$scratch/mine.yaml"
printf 'gripper: %s\nvoxel_size_m: 0.02\n' "$scratch/mine.yaml" >"$scratch/scenario.yaml"
"$graspmap" simulate scene --spacing 0.02 --seed 2 -o "$scratch/other.pcd" --quiet
touch -d '2001-01-01' "$scratch/other.pcd"
site() {
  make --no-print-directory -f "$source/pipelines/site.mk" OUT="$scratch/site" SHARES=2 \
    GRASPMAP="$graspmap" SCENARIO="$scratch/scenario.yaml" "$@"
}
site SITE="$out/terrain.pcd"
first=$(sha256sum <"$scratch/site/map.pcd")
site SITE="$scratch/other.pcd" TITLE="Bob's site"
second=$(sha256sum <"$scratch/site/map.pcd")
[ "$first" != "$second" ] || fail "a changed terrain was not detected"
sleep 1
sed -i 's/^palm_diameter_mm: 71/palm_diameter_mm: 90/' "$scratch/mine.yaml"
site SITE="$scratch/other.pcd" TITLE="Bob's site"
[ "$second" != "$(sha256sum <"$scratch/site/map.pcd")" ] || fail "a changed gripper was not detected"
if site SITE="no such.pcd" 2>"$scratch/errors"; then fail "a name with a space was accepted"; fi
grep -q '\*\*\* SITE .*no such.pcd' "$scratch/errors" || fail "the error does not name SITE and its value"
echo "passed"
