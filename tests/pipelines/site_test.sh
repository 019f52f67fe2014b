#!/bin/sh
# Tests site.mk on the real test site, from its cloud to images.
. "$(dirname "$0")/check.sh"
if [ -z "${GRASPMAP_DATA:-}" ]; then
  echo "skipped: GRASPMAP_DATA is not set"
  exit 77
fi
out=$scratch/site

run() {
  make --no-print-directory -f "$source/pipelines/site.mk" OUT="$out" GRASPMAP="$graspmap" \
    SITE="$GRASPMAP_DATA/clouds/artificial_rocks.pcd" SCENARIO=artificial_rocks_prescan \
    POINTS="$source/data/field_test/artificial_rocks.csv" "$@"
}

run -j2
require_files "$out/map.pcd" "$out/top.png" "$out/oblique.png" "$out/curvature.png"
[ ! -e "$out/roc.png" ] || fail "points without verdicts were evaluated"
found=$(cut -d, -f5 "$out/lookup.csv" | grep -c -x 1)
[ "$found" -eq 30 ] || fail "$found of 30 places were found"

before=$(listing "$out")
run -j2
[ "$before" = "$(listing "$out")" ] || fail "the second run changed files"
# Changed parameters change the map.
run -j2 SCORE='--solid-voxel-threshold 200'
[ "$before" != "$(listing "$out")" ] || fail "a changed parameter was not detected"
echo "passed"
