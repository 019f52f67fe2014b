#!/usr/bin/python3
"""Tracking of a fast hand-held camera by `graspmap refine`: tracked frames and errors.

usage: fast_hands.py BUILD_FOLDER --folder FOLDER [--seeds 61,62,63] [--threads N] [--page README.md]

Simulates a RealSense D435 (rolling shutter of 20 ms) that moves around a rock site in 13 s (193 frames)
and rotates by about 65 and up to 160 degrees per second, and refines the frames from their images only.
The results of a run are stored in FOLDER, and such runs are not repeated. Prints a Markdown table of
medians and worst seeds. --page writes it between the marks of that page.
"""

import json
import statistics
import subprocess
import sys

import numpy

from benchmark_runs import measure, put_into_page, scan_options
from faults import align, read_poses, read_truth

FRAMES = 193
# Color camera: exposure in s, and the share of images with this exposure.
BLURS = {
    "none": (0.0, 1.0),
    "33 ms, half of the pictures": (0.033, 0.5),
    "33 ms, all pictures": (0.033, 1.0),
    "60 ms, half of the pictures": (0.06, 0.5),
}


def run(graspmap, folder, seed, blur, threads):
    name = f"hands_{seed}_{list(BLURS).index(blur)}"
    kept, scan, poses = (folder / f"{name}{end}" for end in (".json", ".db", ".tum"))
    if kept.exists():
        return json.loads(kept.read_text())
    mesh = folder / "rocks" / "mesh.ply"
    if not mesh.exists():
        subprocess.run([graspmap, "simulate", "site", "--site", "rocks", "-o", mesh.parent, "--quiet"],
                       check=True)
    if not scan.exists():
        exposure, share = BLURS[blur]
        subprocess.run([graspmap, "simulate", "scan", mesh, "-o", scan, "--config", "realsense-d435",
                        "--frames", str(FRAMES), "--frame-interval", "0.0667", "--loops", "1",
                        "--tremor", "5", "--exposure", str(exposure), "--blurred-frames", str(share),
                        "--seed", str(seed), "--threads", str(threads), "--quiet"], check=True)
    _, seconds, mib = measure(
        [graspmap, "refine", scan, "-o", poses, "--nodes", "--start", "visual", "--axial-noise", "0.001",
         "--range-noise", "0.004", "--feature-cache", "off", "--threads", str(threads), "--quiet"])
    truth, _ = read_truth(scan)
    found = read_poses(poses)
    rmse, _ = align(*(numpy.array([of[node][:3, 3] for node in sorted(found)]) for of in (found, truth)),
                    False)
    result = {"blur": blur, "frames": len(found), "rmse_mm": 1e3 * rmse, "processor_s": seconds, "mib": mib}
    kept.write_text(json.dumps(result))
    scan.unlink()
    print(f"{name}: {result['frames']} frames, {result['rmse_mm']:.2f} mm", file=sys.stderr)
    return result


def table_of(runs):
    lines = ["| exposure | frames of 193 | RMSE mm | processor s | MiB |", "|---|---|---|---|---|"]
    for blur in BLURS:
        some = [run for run in runs if run["blur"] == blur]
        cells = []
        for key, worst, digits in (("frames", min, 0), ("rmse_mm", max, 2), ("processor_s", max, 0),
                                   ("mib", max, 0)):
            values = [run[key] for run in some]
            cells.append(f"{statistics.median(values):.{digits}f} ({worst(values):.{digits}f})")
        lines.append(f"| {blur} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def main():
    options = scan_options(__doc__.splitlines()[0], "61,62,63")
    runs = [run(options.graspmap, options.folder, seed, blur, options.threads)
            for seed in options.seeds for blur in BLURS]
    text = table_of(runs)
    print(text)
    if options.page:
        put_into_page(options.page, "hands", text)


if __name__ == "__main__":
    main()
