#!/bin/sh
# Tests job arrays over the tiles of a terrain with a real Slurm of two nodes on this machine: one task is
# killed while it runs, Slurm requeues it, and the merged map is identical to that of a single process.
. "$(dirname "$0")/check.sh"
for program in slurmctld slurmd sbatch munged; do
  PATH=$PATH:/usr/sbin command -v $program >/dev/null || {
    echo "skipped: $program is not installed"
    exit 77
  }
done
out=$scratch/out
site=$scratch/terrain
if [ -n "${GRASPMAP_DATA:-}" ]; then
  site=$GRASPMAP_DATA/clouds/artificial_rocks.pcd
else
  "$graspmap" simulate terrain --size 3 --tile-size 1 -o "$site" --quiet
fi
SLURM_LOCAL=$scratch/slurm
export SLURM_LOCAL
slurm_local=$source/scripts/slurm-local

# Kills the first try of share 2 after 0.15 s. Even if the try ended earlier, its task reports the exit
# code of SIGKILL.
cat >"$scratch/graspmap" <<END
#!/bin/sh
if [ "\${SLURM_ARRAY_TASK_ID:-}" = 2 ] && [ "\${SLURM_RESTART_COUNT:-0}" = 0 ]; then
  timeout -s KILL 0.15 "$graspmap" "\$@" || true
  exit 137
fi
exec "$graspmap" "\$@"
END
chmod +x "$scratch/graspmap"

stop() {
  [ $? -eq 0 ] || tail -n 5 "$out"/logs/*.log "$SLURM_LOCAL/slurmctld.log" >&2 || true
  [ -z "${hurry:-}" ] || kill "$hurry" 2>/dev/null || true
  "$slurm_local" stop
  rm -rf "$scratch"
}
trap stop EXIT
eval "$("$slurm_local" start)"
[ "$(sinfo --noheader --Node --format=%N%t | tr '\n' ' ')" = "node1idle node2idle " ] ||
  fail "not two idle nodes: $(sinfo --Node)"

# Slurm delays a requeued task for two minutes. A few seconds suffice for its nodes to distinguish the
# new try from the old one.
pending_again() {
  squeue --noheader --states=PENDING --array --format='%A %r' 2>/dev/null | sed -n 's/ BeginTime//p'
}
while sleep 0.5; do
  jobs=$(pending_again)
  [ -n "$jobs" ] || continue
  sleep 4
  for job in $jobs; do scontrol update "JobId=$job" StartTime=now 2>/dev/null || true; done
done &
hurry=$!

run() {
  timeout 300 make --no-print-directory -f "$source/pipelines/slurm/tiles.mk" OUT="$out" \
    GRASPMAP="$scratch/graspmap" SCORE="--method corrected --tile-size 0.4" "$@"
}
run map TERRAIN="$site" SHARES=4
"$graspmap" score "$site" --config artificial_rocks_prescan --method corrected --tile-size 0.4 \
  -o "$scratch/local.pcd" --quiet
cmp "$scratch/local.pcd" "$out/map.pcd" || fail "the map by Slurm differs from the local one"
"$graspmap" info --verify "$out/map.tiles" >/dev/null || fail "the store is not sound"

[ "$(cat "$out"/logs/*.log | grep -c ', try 1, ')" -eq 4 ] || fail "the number of tasks is not four"
grep -q 'graspmap ended with 137' "$out/logs/2.log" || fail "task 2 was not killed"
grep -q 'share 2 of 4, try 2,' "$out/logs/2.log" || fail "task 2 was not repeated"
scontrol --oneliner show jobs | grep 'ArrayTaskId=2 ' | grep -q 'JobState=COMPLETED .*Restarts=1 ' ||
  fail "Slurm does not report a restart of task 2"
for node in node1 node2; do
  grep -q "on $node\$" "$out"/logs/*.log || fail "$node did nothing"
done

# Tests of a gripper on a mesh at each voxel, and tiles of a mesh at the same time: the files are identical
# to those of a single process.
"$graspmap" simulate site --edge-length 0.05 -o "$scratch/site" --quiet
"$graspmap" resample "$scratch/site/mesh.ply" --radius 0.03 -o "$scratch/site.pcd" --quiet
held() {
  run "$@" TERRAIN="$scratch/site.pcd" OUT="$scratch/held" SHARES=3 MESH="$scratch/site/mesh.ply" \
    SCORE="--voxel-size 0.06 --tile-size 1" GRASP="--trials 2 --map-draws 1" \
    SURFACE="--cell-size 0.05 --tile-size 0.7"
}
held -j2 held_map mesh
"$graspmap" grasp "$scratch/site/mesh.ply" --map "$scratch/held/map.tiles" --trials 2 --map-draws 1 \
  -o "$scratch/held.pcd" --quiet
cmp "$scratch/held.pcd" "$scratch/held/held.pcd" || fail "the test by Slurm differs from the local one"
"$graspmap" mesh "$scratch/site.pcd" --cell-size 0.05 --tile-size 0.7 -o "$scratch/mesh" --quiet
diff -r "$scratch/mesh" "$scratch/held/mesh" || fail "the mesh by Slurm differs from the local one"
[ "$(cat "$scratch"/held/mesh_logs/*.log | grep -c ', try 1, ')" -eq 3 ] || fail "not three shares"
grep -q 'share 2 of 3, try 2,' "$scratch/held/mesh_logs/2.log" || fail "no second try of a killed mesh"
[ ! -e "$scratch/held/mesh.progress" ] || fail "the pieces were not removed"
"$graspmap" simulate scan "$scratch/site/mesh.ply" --frames 6 --loops 1 -o "$scratch/scan.db" --quiet
scan() {
  run "$@" OUT="$scratch/held" SHARES=2 MESH="$scratch/mesh" SCAN="$scratch/scan.db" \
    POSES=odometry FUSE="--tile-size 1.5 --voxel-size 0.03" TEXTURE="--texel-size 0.02"
}
scan -j2 cloud model
"$graspmap" fuse "$scratch/scan.db" --poses odometry --tile-size 1.5 --voxel-size 0.03 \
  --corrected-poses "$scratch/fused.tum" -o "$scratch/cloud" --quiet
diff -r "$scratch/cloud" "$scratch/held/cloud" || fail "the cloud by Slurm differs from the local one"
cmp "$scratch/fused.tum" "$scratch/held/fused_poses.tum" || fail "the poses by Slurm differ"
"$graspmap" texture "$scratch/mesh" --scan "$scratch/scan.db" --poses odometry \
  --texel-size 0.02 -o "$scratch/model" --quiet
diff -r "$scratch/model" "$scratch/held/model" || fail "the texture by Slurm differs from the local one"

jobs=$(scontrol --oneliner show jobs | wc -l)
held -j2 held_map mesh
scan -j2 cloud model
before=$(listing "$out")
run map TERRAIN="$site" SHARES=4
[ "$before" = "$(listing "$out")" ] || fail "the second run changed files"
[ "$jobs" = "$(scontrol --oneliner show jobs | wc -l)" ] || fail "the second run submitted jobs"

# An invalid terrain fails at once and is not retried.
echo "no cloud" >"$scratch/bad.pcd"
if run TERRAIN="$scratch/bad.pcd" OUT="$scratch/bad" SHARES=1 2>"$scratch/errors"; then
  fail "a broken terrain was accepted"
fi
grep -q 'tasks failed' "$scratch/errors" || fail "no clear error for a broken terrain"
grep -q 'bad.pcd' "$scratch/bad/logs/1.log" || fail "the log does not name the broken terrain"
grep -q 'try 2' "$scratch/bad/logs/1.log" && fail "bad input was retried"

"$slurm_local" stop
[ ! -e "$SLURM_LOCAL" ] || fail "slurm-local stop left its folder"
echo "passed"
