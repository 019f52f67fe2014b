#!/usr/bin/python3
"""Time and memory of every stage from a scan to its map, in tiles, as a function of the area.

usage: chain.py BUILD_FOLDER [--sides 3,10] [--frames-per-m2 3.4] [--folder FOLDER] [--page README.md]

Simulates square rocky terrains at 1 cm and a scan in lanes over each. Runs every stage of
pipelines/scan.mk with folders of tiles as a separate process with two threads; of the virtual field
test (8 poses of 2 draws), one share of 40. Prints a Markdown table with the exponents between the first
and the last side. --page writes it between the marks of that page, and the chart chain.png beside it.
All files are in a temporary folder in FOLDER (default: TMPDIR) and are removed. Results of an earlier
run are read from FOLDER/chain_SIDE.json.
"""

import argparse
import json
import math
import pathlib
import subprocess
import sys
import tempfile

from benchmark_runs import measure, put_into_page

# Stage: arguments, inputs and outputs in the folder.
STAGES = {
    "simulate scan": "simulate scan ground --frames {frames} --seed 71 -o scan.db",
    "refine": "refine scan.db -o poses.tum --report refine.json",
    "fuse": "fuse scan.db --poses poses.tum -o cloud --corrected-poses fused.tum",
    "mesh": "mesh cloud -o mesh --cell-size 0.01",
    "crop": "crop mesh -o site",
    "texture": "texture site --scan scan.db --poses fused.tum -o model",
    "resample": "resample site -o samples",
    "score": "score samples -o map.tiles",
    "grasp, 1 of 40 shares": "grasp site --map map.tiles -o held.tiles --trials 8 --map-draws 2 --tile 1/40",
}


def run_chain(graspmap, folder, side, frames):
    """Returns the metrics of each stage, and the errors of the refined poses and of the meshes."""
    subprocess.run([graspmap, "simulate", "terrain", "--size", str(side), "--seed", "71", "-o", "ground",
                    "--quiet"], cwd=folder, check=True)
    found = {"side_m": side, "frames": frames, "stages": {}}
    for name, words in STAGES.items():
        line = [graspmap, *words.format(frames=frames).split(), "--threads", "2", "--quiet"]
        found["stages"][name] = dict(zip(("wall_s", "processor_s", "peak_mib"), measure(line, folder)))
        print(f"{side} m, {name}: {found['stages'][name]['processor_s']:.1f} s", file=sys.stderr)
    stages = json.loads((folder / "refine.json").read_text())["stages"]
    found["rmse_mm"] = [1e3 * stage["absolute_error"]["rmse_m"] for stage in (stages[0], stages[-1])]
    return found


def exponent(runs, name, key):
    """Returns the exponent of a power law of the area through the first and the last run of the stage."""
    ran = [run for run in runs if name in run["stages"]]
    first, last = ran[0], ran[-1]
    areas = last["side_m"] ** 2 / first["side_m"] ** 2
    if areas <= 1:
        return float("nan")
    return math.log(last["stages"][name][key] / first["stages"][name][key]) / math.log(areas)


def table_of(runs):
    lines = ["| side m, frames | " + " | ".join(STAGES) + " |", "|---|" + "---|" * len(STAGES)]
    for run in runs:
        lines.append(f"| {run['side_m']}, {run['frames']} | " + " | ".join(
            "{processor_s:.1f}, {peak_mib:.0f}".format(**run["stages"][name])
            if name in run["stages"] else "not run" for name in STAGES) + " |")
    if len(runs) > 1:
        lines.append("| exponents of area | " + " | ".join(
            "{:.2f}, {:.2f}".format(*(exponent(runs, name, key) for key in ("processor_s", "peak_mib")))
            for name in STAGES) + " |")
    errors = ", ".join(f"{run['rmse_mm'][0]:.1f} -> {run['rmse_mm'][1]:.2f} mm at {run['side_m']} m"
                       for run in runs)
    return "\n".join(lines) + f"\n\nRMSE of the poses, odometry -> refined: {errors}."


def draw(runs, path):
    import matplotlib
    matplotlib.use("Agg")
    from matplotlib import pyplot
    figure, axes = pyplot.subplots(1, 2, figsize=(9, 3.6))
    for axis, key, label in zip(axes, ("processor_s", "peak_mib"), ("processor time, s", "peak memory, MiB")):
        for name in STAGES:
            ran = [run for run in runs if name in run["stages"]]
            axis.loglog([run["side_m"] ** 2 for run in ran], [run["stages"][name][key] for run in ran],
                        "o-", label=name)
        axis.set(xlabel="area, m2", ylabel=label)
        axis.grid(True, which="both", alpha=0.3)
    axes[1].legend(fontsize=7)
    figure.tight_layout()
    figure.savefig(path, dpi=90)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("build", type=pathlib.Path)
    parser.add_argument("--sides", default="3,10")
    parser.add_argument("--frames-per-m2", type=float, default=3.4)
    parser.add_argument("--folder", type=pathlib.Path, help="where the temporary folder goes")
    parser.add_argument("--page", type=pathlib.Path)
    options = parser.parse_args()
    graspmap = (options.build / "graspmap").resolve()
    runs = []
    for side in map(int, options.sides.split(",")):
        kept = options.folder / f"chain_{side}.json" if options.folder else None
        if kept and kept.exists():
            runs.append(json.loads(kept.read_text()))
            continue
        with tempfile.TemporaryDirectory(prefix="graspmap_chain_", dir=options.folder) as name:
            frames = max(20, round(options.frames_per_m2 * side * side))
            runs.append(run_chain(graspmap, pathlib.Path(name), side, frames))
        if kept:
            kept.write_text(json.dumps(runs[-1]))
    text = table_of(runs)
    print(text)
    if options.page:
        draw(runs, options.page.parent / "chain.png")
        put_into_page(options.page, "chain", text + "\n\n![Time and memory of each stage](chain.png)")


if __name__ == "__main__":
    main()
