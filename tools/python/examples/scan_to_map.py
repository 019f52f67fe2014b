#!/usr/bin/python3
"""From the database of a scan to a plotted map, cell by cell (VS Code, Spyder and Jupytext show the
lines `# %%` as cells; Jupyter opens it with jupytext).

scan_to_map.py SCAN.db MAP.png [VOXEL_SIZE_M]
"""

# %% The scan and its first frame
import sys

import matplotlib.pyplot as plt

import graspmap

scan_file, picture_file = sys.argv[1:3]
voxel_size_m = float(sys.argv[3]) if len(sys.argv) > 3 else 0.01

scan = graspmap.open_scan(scan_file)
frame = scan.frame(scan.nodes[0])
print(f"{len(scan)} frames, depth of {frame.depth.shape}, poses: {', '.join(scan.pose_sources)}")

# %% One cloud of all frames, by the poses that the scan has
fused = graspmap.fuse(scan, voxel_size_m=voxel_size_m)
print(f"{fused.frames} frames -> {len(fused.cloud)} points, frames agree within "
      f"{1e3 * fused.disagreement_after_m:.1f} mm")

# %% The map: a score for each voxel of the ground
scored = graspmap.score(fused.cloud, voxel_size_m=max(0.01, voxel_size_m))
ground, score = scored.map.positions, scored.map.fields["score"]
print(f"{len(score)} voxels, {scored.graspable_voxels} graspable")

# %% The best footholds of the map
best = graspmap.footholds(scored.map, separation_m=0.3, max_count=20, graspable_only=False)
places = best.cloud.positions

# %% All of it in one figure
figure, (left, right) = plt.subplots(1, 2, figsize=(12, 5), layout="constrained")
left.imshow(frame.depth, cmap="magma")
left.set_title("depth of the first frame, m")
figure.colorbar(left.images[0], ax=left, shrink=0.8)
order = ground[:, 2].argsort()
right.scatter(*ground[order, :2].T, c=score[order], s=5, cmap="RdYlGn", vmin=0, vmax=1)
right.scatter(*places[:, :2].T, marker="+", c="black", label="footholds")
right.set(aspect="equal", xlabel="x, m", ylabel="y, m", title="graspability")
right.legend()
figure.colorbar(right.collections[0], ax=right, shrink=0.8, label="score")
figure.savefig(picture_file, dpi=120)
