#!/bin/bash
# Checks the target world of scan.mk: the world of the textured site; a second run does nothing, and
# changed flags make it again.
. "$(dirname "$0")/check.sh"
out=$scratch/out
"$graspmap" simulate terrain --size 2 --spacing 0.02 -o "$scratch/ground" --quiet
"$graspmap" simulate scan "$scratch/ground" --frames 8 -o "$scratch/scan.db" --quiet

world() {
  make --no-print-directory -f "$source/pipelines/scan.mk" SCAN="$scratch/scan.db" OUT="$out" \
    GRASPMAP="$graspmap" POSES=odometry FUSE=--voxel-size=0.02 MESH=--cell-size=0.03 "$@" world \
    >>"$scratch/log" 2>&1 || { cat "$scratch/log" >&2; fail "make $*"; }
}

world
require_files "$out"/site.world/world.{sdf,xml,urdf} "$out/site.world/meshes/site.glb"
ls "$out"/site.world/meshes/site_visual_*.png >/dev/null || fail "the world has no texture"
grep -q 'gravity="0 0 -9.81"' "$out/site.world/world.xml" || fail "earth is not the default"
before=$(listing "$out")
world
[ "$(listing "$out")" = "$before" ] || fail "a second run wrote files"
world WORLD="--gravity moon"
grep -q 'gravity="0 0 -1.62"' "$out/site.world/world.xml" || fail "WORLD is not used"
echo passed
