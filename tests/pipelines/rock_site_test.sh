#!/bin/sh
# Tests rock_site.mk on a small simulated scan: cloud and surface agree with the true mesh, the site is
# cropped, locations are found, a second run does nothing, and deleted files are recomputed identically.
. "$(dirname "$0")/check.sh"
out=$scratch/rocks

run() {
  make --no-print-directory -f "$source/pipelines/rock_site.mk" OUT="$out" FRAMES=12 EDGE=0.02 \
    MESH=--cell-size=0.02 SHARES=2 GRASPMAP="$graspmap" "$@"
}

run -j2 POSES=ground-truth
require_files "$out/site.png" "$out/scan.db" "$out/scan.db.json" "$out/scan/scan.txt" \
  "$out/scan/cloud.ply" "$out/scan/cloud.png" "$out/scan/accuracy.txt" "$out/scan/mesh.ply" \
  "$out/scan/mesh.txt" "$out/scan/site.ply" "$out/scan/site.site_from_map.txt" \
  "$out/scan/site.png" "$out/scan/terrain.pcd" "$out/scan/model.glb" "$out/scan/texture.png" \
  "$out/scan/spot_check.txt" "$out/scan/spot_check.csv" "$out/scan/map/map.pcd" \
  "$out/scan/map/top.png" "$out/scan/map/lookup.csv"
grep -q '^nodes: 12$' "$out/scan/scan.txt" || fail "info does not count 12 nodes"
# The noise is 5 to 12 mm at these ranges. With true poses, the cloud is more accurate than one view, and
# the surface more accurate than the cloud.
for rmse in $(sed -n 's/^rmse: \([0-9.]*\) mm$/\1/p' "$out/scan/accuracy.txt"); do
  awk -v rmse="$rmse" 'BEGIN { exit !(rmse > 0 && rmse < 4) }' || fail "$rmse mm off the truth"
done
[ "$(grep -c '^rmse' "$out/scan/accuracy.txt")" -eq 2 ] || fail "the cloud and the surface were not compared"
grep -q '^manifold: yes$' "$out/scan/mesh.txt" || fail "the surface is not manifold"
mean=$(sed -n 's/^mean of .* locations: \([0-9.]*\) m.*/\1/p' "$out/scan/spot_check.txt")
awk -v mean="$mean" 'BEGIN { exit !(mean > 0 && mean < 0.004) }' || fail "the edges are $mean m off"
[ "$(wc -l <"$out/scan/map/lookup.csv")" -eq 31 ] || fail "the number of looked-up locations is not 30"

# The texture uses the poses of the fused cloud.
grep -q 'fused_poses.tum' "$out/scan/model.glb.json" || fail "the texture does not use the poses of the cloud"

before=$(listing "$out")
run -j2 POSES=ground-truth
[ "$before" = "$(listing "$out")" ] || fail "the second run changed files"

scan=$(sha256sum <"$out/scan.db")
cloud=$(sha256sum <"$out/scan/cloud.ply")
terrain=$(sha256sum <"$out/scan/terrain.pcd")
rm "$out/scan.db" "$out/scan/cloud.ply" "$out/scan/site.ply"
run POSES=ground-truth
[ "$scan" = "$(sha256sum <"$out/scan.db")" ] || fail "the recomputed scan differs"
[ "$cloud" = "$(sha256sum <"$out/scan/cloud.ply")" ] || fail "the recomputed cloud differs"
[ "$terrain" = "$(sha256sum <"$out/scan/terrain.pcd")" ] || fail "the recomputed samples differ"

# Changed poses and a changed seed are detected.
scan_to() {
  make --no-print-directory -f "$source/pipelines/scan.mk" OUT="$out/scan" GRASPMAP="$graspmap" "$@"
}
scan_to SCAN="$out/scan.db" POSES=odometry "$out/scan/cloud.ply"
[ "$cloud" != "$(sha256sum <"$out/scan/cloud.ply")" ] || fail "changed poses were not detected"
run SEED=2 "$out/scan.db"
[ "$scan" != "$(sha256sum <"$out/scan.db")" ] || fail "a changed seed was not detected"
# Another scan is detected, even if its file is older than the results.
cp "$out/scan.db" "$scratch/other.db"
touch -d 2001-01-01 "$scratch/other.db"
before=$(listing "$out/scan" | grep '^scan.txt ')
scan_to SCAN="$scratch/other.db" "$out/scan/scan.txt"
[ "$before" != "$(listing "$out/scan" | grep '^scan.txt ')" ] || fail "another, older scan was not detected"
echo "passed"
