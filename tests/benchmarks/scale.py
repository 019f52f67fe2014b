#!/usr/bin/python3
"""Time and memory of `graspmap score` into a tile store as a function of the terrain size.

usage: scale.py BUILD_FOLDER [--sides 3,10,30,100] [--repeat N] [--folder FOLDER] [--page README.md]

Simulates square rocky terrains at 1 cm, scores each out of core in a separate process, and looks up a
million locations in the tile store of the largest map. Prints a Markdown table. --page writes it between
the marks of that page, and the chart scale.png beside it. All files are in a temporary folder in FOLDER
(default: TMPDIR), about 9 GB for 100 x 100 m, and are removed.
"""

import argparse
import csv
import json
import pathlib
import random
import subprocess
import sys
import tempfile

from benchmark_runs import measure, put_into_page


def bytes_of(folder):
    return sum(file.stat().st_size for file in folder.rglob("*") if file.is_file())


def score(graspmap, terrain, store, repeat):
    """Returns the run with the lowest processor time; each run creates a new tile store."""
    runs = []
    for _ in range(repeat):
        subprocess.run(["rm", "-rf", store, f"{store}.json"], check=True)
        runs.append(measure([graspmap, "score", terrain, "-o", store, "--zero-plane", "-0.05",
                             "--quiet"]))
    return min(runs, key=lambda run: run[1])


def write_points(path, side, count):
    draw = random.Random(1)
    with open(path, "w", encoding="ascii") as out:
        out.write("x,y,z\n")
        for _ in range(count):
            out.write(f"{draw.uniform(0, side):.3f},{draw.uniform(0, side):.3f},"
                      f"{draw.uniform(-0.1, 0.1):.3f}\n")


def row_of(graspmap, folder, side, repeat):
    terrain = folder / f"terrain_{side}"
    store = folder / f"map_{side}.tiles"
    simulated = measure([graspmap, "simulate", "terrain", "--size", str(side), "-o", terrain,
                         "--quiet"])
    wall, processor, peak = score(graspmap, terrain, store, repeat)
    with open(f"{terrain}.json", encoding="utf-8") as file:
        points = json.load(file)["results"]["points"]
    info = json.loads(subprocess.run([graspmap, "info", store, "--json"], check=True,
                                     capture_output=True).stdout)
    return {"side_m": side, "area_m2": side * side, "points": points, "pivots": info["points"],
            "graspable": info["graspable_voxels"], "simulate_s": simulated[1], "wall_s": wall,
            "processor_s": processor, "us_per_pivot": 1e6 * processor / info["points"],
            "peak_mib": peak, "terrain_mb": bytes_of(terrain) / 1e6, "map_mb": bytes_of(store) / 1e6}


def look_up(graspmap, folder, side):
    points = folder / "points.csv"
    write_points(points, side, 1_000_000)
    wall, processor, peak = measure([graspmap, "lookup", folder / f"map_{side}.tiles", points,
                                     "--points-frame", "input", "--max-distance", "0.5",
                                     "-o", folder / "answers.csv", "--quiet"])
    return (f"Looking up a million random locations in the {side} x {side} m store takes "
            f"{wall:.1f} s ({processor:.1f} s of processor time, {peak:.0f} MiB).")


def table_of(rows):
    lines = ["| side m | points | pivots | graspable % | wall s | CPU s | us per pivot | "
             "relative to {0} m | peak MiB | terrain MB | map MB |",
             "|---|---|---|---|---|---|---|---|---|---|---|"]
    lines[0] = lines[0].format(rows[0]["side_m"])
    for row in rows:
        lines.append("| {side_m} | {points} | {pivots} | {share:.2f} | {wall_s:.2f} | "
                     "{processor_s:.2f} | {us_per_pivot:.2f} | {ratio:.0f} % | {peak_mib:.0f} | "
                     "{terrain_mb:.1f} | {map_mb:.1f} |".format(
                         share=100 * row["graspable"] / row["pivots"],
                         ratio=100 * row["us_per_pivot"] / rows[0]["us_per_pivot"], **row))
    return "\n".join(lines)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("build", type=pathlib.Path)
    parser.add_argument("--sides", default="3,10,30,100")
    parser.add_argument("--repeat", type=int, default=1, help="runs of each; the minimum counts")
    parser.add_argument("--folder", help="where the temporary folder goes")
    parser.add_argument("--page", type=pathlib.Path)
    options = parser.parse_args()
    sides = [int(side) for side in options.sides.split(",")]
    graspmap = options.build / "graspmap"
    with tempfile.TemporaryDirectory(prefix="graspmap_scale_", dir=options.folder) as name:
        folder = pathlib.Path(name)
        rows = []
        for side in sides:
            rows.append(row_of(graspmap, folder, side, options.repeat if side < 50 else 1))
            print(f"{side} m: {rows[-1]['processor_s']:.2f} s", file=sys.stderr)
        text = table_of(rows) + "\n\n" + look_up(graspmap, folder, sides[-1])
        print(text)
        if options.page:
            with open(folder / "scale.csv", "w", newline="", encoding="ascii") as out:
                writer = csv.DictWriter(out, rows[0].keys())
                writer.writeheader()
                writer.writerows(rows)
            subprocess.run([options.build / "benchmarks/scale_chart", folder / "scale.csv",
                            options.page.parent / "scale.png"], check=True)
            put_into_page(options.page, "scale", text + "\n\n![Time and memory against area](scale.png)")


if __name__ == "__main__":
    main()
