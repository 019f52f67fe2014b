#!/bin/sh
# Tests castle.mk on a real RealSense sequence without poses and with unregistered depth: every frame is
# tracked, the mesh fits the planes of the castle, a second run does nothing.
. "$(dirname "$0")/check.sh"
[ -d /usr/share/visp-images-data ] && command -v pnmtopng >/dev/null || exit 77
out=$scratch/out

castle() {
  make --no-print-directory -f "$source/pipelines/castle.mk" OUT="$out" GRASPMAP="$graspmap" "$@"
}

castle -j2
require_files "$out/scan/depth_camera.yaml" "$out/model.glb" "$out/texture.png" "$out/map/map.pcd"
[ "$(grep -vc '^#' "$out/poses.tum")" -eq 30 ] || fail "not all 30 frames have a pose"
# ViSP gives the pose of the planes in the first image. The camera saw half of their area.
awk '/^icp:/ { near = $11 < 1.6 && $14 < 8 }
     /^points within/ { covered = $8 > 45 }
     END { exit !(near && covered) }' "$out/planes.txt" || fail "other planes: $(cat "$out/planes.txt")"

before=$(listing "$out")
castle -j2
[ "$before" = "$(listing "$out")" ] || fail "the second run changed files"
echo "passed"
