#!/usr/bin/python3
"""`graspmap refine` on a real sequence with measured truth, whole and in parts.

usage: real_sequence.py BUILD_FOLDER --folder FOLDER [--threads N] [--page README.md]

Reads $GRASPMAP_DATA/sequences/tum_fr1_rpy. What a run gave is kept in FOLDER as one file .json; such
runs are not repeated. Prints a Markdown table; with --page, puts it between the marks of that page.
"""

import json
import os
import pathlib
import sys

from benchmark_runs import measure, put_into_page, scan_options

NAME = "tum_fr1_rpy"
# Shares of the frames.
PARTS = {"whole": (0, 1), "third 1": (0, 1 / 3), "third 2": (1 / 3, 2 / 3), "third 3": (2 / 3, 1)}


def write_part(source, folder, first, last):
    """A folder of images with the frames from one share to another; the rest are links."""
    folder.mkdir(exist_ok=True)
    for path in source.iterdir():
        target = folder / path.name
        if target.exists():
            continue
        if path.name not in ("rgb.txt", "depth.txt"):
            target.symlink_to(path)
            continue
        lines = path.read_text().splitlines()
        comments = [line for line in lines if line.startswith("#")]
        frames = [line for line in lines if line and not line.startswith("#")]
        chosen = frames[round(first * len(frames)):round(last * len(frames))]
        target.write_text("\n".join(comments + chosen) + "\n")


def run(part, options, source):
    name = part.replace(" ", "_")
    kept = options.folder / f"{name}.json"
    if kept.exists():
        return json.loads(kept.read_text())
    scan = options.folder / name
    write_part(source, scan, *PARTS[part])
    poses = options.folder / f"{name}.tum"
    wall, processor, mebibytes = measure(
        [options.graspmap, "refine", scan, "-o", poses, "--feature-cache", "off", "--force", "--quiet",
         "--threads", str(options.threads)])
    results = json.loads((options.folder / f"{name}.tum.json").read_text())["results"]
    frames = sum(not line.startswith("#") for line in (scan / "rgb.txt").read_text().splitlines())
    found = {"frames": frames, "poses": results["poses"], "rmse_mm": 1e3 * results["trajectory_rmse_m"],
             "rotation_deg": results["trajectory_rotation_error_deg"],
             "processor_s": processor, "wall_s": wall, "mebibytes": mebibytes}
    kept.write_text(json.dumps(found, indent=1))
    return found


def table_of(rows):
    lines = ["| part | poses | RMSE mm | rotation deg | processor s per frame | MiB |",
             "|---|---|---|---|---|---|"]
    for part, row in rows.items():
        lines.append(f"| {part} | {row['poses']} of {row['frames']} | {row['rmse_mm']:.1f} "
                     f"| {row['rotation_deg']:.2f} | {row['processor_s'] / row['frames']:.2f} "
                     f"| {row['mebibytes']:.0f} |")
    return "\n".join(lines)


def main():
    if "GRASPMAP_DATA" not in os.environ:
        sys.exit("GRASPMAP_DATA is not set")
    options = scan_options(__doc__.splitlines()[0], "0")
    source = pathlib.Path(os.environ["GRASPMAP_DATA"]).resolve() / "sequences" / NAME
    text = table_of({part: run(part, options, source) for part in PARTS})
    print(text)
    if options.page:
        put_into_page(options.page, "sequence", text)


if __name__ == "__main__":
    main()
