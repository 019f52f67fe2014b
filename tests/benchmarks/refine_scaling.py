#!/usr/bin/python3
"""Time and memory of `graspmap refine` as a function of the number of nodes.

usage: refine_scaling.py BUILD_FOLDER [--frames 60,125,250,500,1000] [--seed N] [--threads N]

Simulates the rock site and scans of consecutive loops of about 30 frames, with images of 256 x 212
pixels, and refines each. Prints a Markdown table: processor seconds of each stage, peak memory, RMSE of
the trajectory before and after refinement, and the exponents of a power law fitted to all sizes.
"""

import argparse
import json
import math
import os
import pathlib
import subprocess
import tempfile

CAMERA = """%YAML:1.0
---
camera_name: half
image_width: 256
image_height: 212
camera_matrix: !!opencv-matrix
  {rows: 3, cols: 3, dt: d, data: [182.5, 0, 127.75, 0, 182.5, 105.75, 0, 0, 1]}
distortion_model: plumb_bob
distortion_coefficients: !!opencv-matrix
  {rows: 1, cols: 5, dt: d, data: [0, 0, 0, 0, 0]}
"""


def run(words):
    """Returns the processor seconds and MB of a command."""
    process = subprocess.Popen(list(map(str, words)))
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode != 0:
        raise SystemExit(f"failed: {' '.join(map(str, words))}")
    return usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024


def stage_kind(name):
    return "closures" if name.startswith("closures") else name.split(":")[0]


def measure(graspmap, folder, frames, options):
    scan, poses, report = (folder / f"{frames}.{end}" for end in ("db", "tum", "json"))
    run([graspmap, "simulate", "scan", folder / "site/mesh.ply", "-o", scan, "--camera",
         folder / "camera.yaml", "--frames", frames, "--loops", max(1, frames // 30), "--seed",
         options.seed, "--quiet"])
    total, memory = run([graspmap, "refine", scan, "-o", poses, "--report", report, "--threads",
                         options.threads, "--feature-cache", "off", "--quiet"])
    times = {}
    for name, seconds in json.loads((poses.parent / (poses.name + ".json")).read_text())["run"][
            "timings_s"].items():
        if name.endswith(", processor"):
            kind = stage_kind(name.removesuffix(", processor"))
            times[kind] = times.get(kind, 0.0) + seconds
    stages = json.loads(report.read_text())["stages"]
    errors = [1e3 * stage["absolute_error"]["rmse_m"] for stage in (stages[0], stages[-1])]
    scan.unlink()
    return {**times, "all": total, "MB": memory}, errors


def exponent(sizes, values):
    """Returns the exponent of the power law fitted by least squares of logarithms."""
    points = [(math.log(n), math.log(v)) for n, v in zip(sizes, values) if v > 0.01]
    if len(points) < 2:
        return float("nan")
    mean_x, mean_y = (sum(p[axis] for p in points) / len(points) for axis in (0, 1))
    return (sum((x - mean_x) * (y - mean_y) for x, y in points) /
            sum((x - mean_x) ** 2 for x, y in points))


def main():
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("build", type=pathlib.Path)
    parser.add_argument("--frames", default="60,125,250,500,1000")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--threads", type=int, default=2)
    options = parser.parse_args()
    graspmap = (options.build / "graspmap").resolve()
    sizes = [int(text) for text in options.frames.split(",")]
    results = []
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        (folder / "camera.yaml").write_text(CAMERA)
        run([graspmap, "simulate", "site", "-o", folder / "site", "--quiet"])
        columns = []
        for frames in sizes:
            figures, errors = measure(graspmap, folder, frames, options)
            if not columns:
                columns = [key for key in figures if key != "start"]
                print("| nodes | " + " | ".join(columns) + " | RMSE mm |")
                print("|" + "---|" * (len(columns) + 2))
            results.append(figures)
            print(f"| {frames} | " + " | ".join(
                f"{figures.get(key, 0):.0f}" if key == "MB" else f"{figures.get(key, 0):.2f}"
                for key in columns) + f" | {errors[0]:.1f} -> {errors[1]:.2f} |", flush=True)
    print("| exponent | " + " | ".join(
        f"{exponent(sizes, [r.get(key, 0) for r in results]):.2f}" for key in columns) + " | |")


if __name__ == "__main__":
    main()
