#!/usr/bin/python3
"""Correction of sensor faults by `graspmap refine`, and calibration of its stated deviations.

usage: faults.py BUILD_FOLDER --folder FOLDER [--seeds 31,32,33] [--threads N] [--page README.md]

Simulates and refines scans of 40 frames: of two sites with each fault at full size, and of the first
site at half and double size with the first seed. The results of a run are stored in FOLDER as a .json
file, and such runs are not repeated. Prints a Markdown table of medians and worst seeds. --page writes
it between the marks of that page, and the chart faults.png beside it.
"""

import json
import sqlite3
import statistics
import struct
import subprocess
import sys

import numpy

from benchmark_runs import measure, put_into_page, scan_options

SITES = ("rocks", "slopes_and_bumps")
INTRINSICS = {"stored-focal-percent": 1.0, "stored-cx": 4.0}
DEPTH = {"depth-scale-percent": 0.8, "depth-periodic-error": 0.004, "depth-corner": 0.006, "depth-holes": 0.05}
PICTURES = {"exposure-drift": 0.4, "vignetting": 0.35, "exposure": 0.05, "blurred-frames": 0.5,
            "jpeg-quality": 60}
# Options of `simulate scan` at full size.
FAULTS = {
    "none": {},
    "intrinsics": INTRINSICS,
    "depth": DEPTH,
    "both, pictures": {**INTRINSICS, **DEPTH, **PICTURES},
    "delay": {"depth-delay": 0.010},
    "registration": {"registration-shift": 5.0, "registration-turn": 0.5},
    "rolling shutter": {"rolling-shutter": 0.020},
}
SIZES = (0.5, 1.0, 2.0)
FIXED = ("vignetting", "blurred-frames", "jpeg-quality")  # faults without a size


def options_of(fault, size):
    return [word for name, value in FAULTS[fault].items()
            for word in (f"--{name}", f"{value if name in FIXED else size * value:g}")]


def pose_of(blob):
    """Reads a pose as RTAB-Map stores it: three rows of floats."""
    pose = numpy.eye(4)
    pose[:3] = numpy.frombuffer(blob, "<f4").reshape(3, 4)
    rotation, _, other = numpy.linalg.svd(pose[:3, :3])
    pose[:3, :3] = rotation @ other
    return pose


def read_truth(scan):
    """Returns the true poses by node, and the stored focal length."""
    with sqlite3.connect(f"file:{scan}?mode=ro", uri=True) as database:
        poses = {node: pose_of(blob) for node, blob in
                 database.execute("SELECT id, ground_truth_pose FROM Node") if blob}
        calibration, = database.execute("SELECT calibration FROM Data ORDER BY id LIMIT 1").fetchone()
    return poses, struct.unpack_from("<d", calibration, 44)[0]


def read_poses(path):
    """Returns the poses by node of a .tum file with nodes."""
    poses = {}
    for line in path.read_text().splitlines():
        if line.startswith("#"):
            continue
        _, x, y, z, i, j, k, w, node = map(float, line.split())
        pose = numpy.eye(4)
        pose[:3, 3] = x, y, z
        pose[:3, :3] = [[1 - 2 * (j * j + k * k), 2 * (i * j - k * w), 2 * (i * k + j * w)],
                        [2 * (i * j + k * w), 1 - 2 * (i * i + k * k), 2 * (j * k - i * w)],
                        [2 * (i * k - j * w), 2 * (j * k + i * w), 1 - 2 * (i * i + j * j)]]
        poses[int(node)] = pose
    return poses


def align(estimate, truth, with_scale):
    """Returns RMSE and scale of the best-fitting similarity (Umeyama 1991). Rows are positions."""
    a, b = (points - points.mean(0) for points in (estimate, truth))
    u, values, v = numpy.linalg.svd(b.T @ a)
    values[2] *= numpy.sign(numpy.linalg.det(u) * numpy.linalg.det(v))
    u[:, 2] *= numpy.sign(numpy.linalg.det(u) * numpy.linalg.det(v))
    scale = values.sum() / (a ** 2).sum() if with_scale else 1.0
    return numpy.sqrt(((scale * a @ (u @ v).T - b) ** 2).sum(1).mean()), scale


def errors_in_deviations(poses, truth, nodes, scale):
    """Returns the error of each axis of each position relative to the fixed node."""
    held = min(nodes, key=lambda node: node["deviation_m"])["node"]
    errors = []
    for node in nodes:
        name = node["node"]
        if name == held or name not in truth:
            continue
        found, true = (numpy.linalg.inv(of[held]) @ of[name] for of in (poses, truth))
        error = found[:3, :3].T @ (scale * found[:3, 3] - true[:3, 3])
        errors += list(error / numpy.sqrt(numpy.diag(numpy.array(node["covariance"]))[:3]))
    return errors


def run(graspmap, folder, site, seed, fault, size, threads):
    name = f"{site}_{seed}_{list(FAULTS).index(fault)}_{size:g}"
    kept, scan = folder / f"{name}.json", folder / f"{name}.db"
    if kept.exists():
        return json.loads(kept.read_text())
    mesh = folder / site / "mesh.ply"
    if not mesh.exists():
        subprocess.run([graspmap, "simulate", "site", "--site", site, "-o", folder / site, "--quiet"],
                       check=True)
    if not scan.exists():
        subprocess.run([graspmap, "simulate", "scan", mesh, "-o", scan, "--frames", "40", "--seed",
                        str(seed), "--threads", str(threads), "--quiet", *options_of(fault, size)],
                       check=True)
    outputs = [folder / f"{name}_{end}" for end in ("poses.tum", "report.json", "camera.yaml")]
    _, seconds, mib = measure(
        [graspmap, "refine", scan, "-o", outputs[0], "--nodes", "--report", outputs[1],
         "--write-calibration", outputs[2], "--feature-cache", "off", "--threads", str(threads), "--quiet"])
    report = json.loads(outputs[1].read_text())
    truth, stored_fx = read_truth(scan)
    poses = read_poses(outputs[0])
    common = sorted(poses.keys() & truth.keys())
    positions = [numpy.array([of[node][:3, 3] for node in common]) for of in (poses, truth)]
    (rmse, _), (scaled, scale) = (align(*positions, with_scale) for with_scale in (False, True))
    fx = float(outputs[2].read_text().split("camera_matrix")[1].split("data:")[1].split("[")[1].split(",")[0])
    true_fx = stored_fx / (1 + size * FAULTS[fault].get("stored-focal-percent", 0.0) / 100)
    found = {"site": site, "seed": seed, "fault": fault, "size": size, "processor_s": seconds, "mib": mib,
             "start_mm": 1e3 * report["stages"][0]["absolute_error"]["rmse_m"], "rmse_mm": 1e3 * rmse,
             "scaled_mm": 1e3 * scaled, "focal_percent": 100 * (fx / true_fx - 1),
             "errors": [errors_in_deviations(poses, truth, report["nodes"], factor)
                        for factor in (1.0, scale)]}
    kept.write_text(json.dumps(found))
    scan.unlink()
    print(f"{name}: {found['start_mm']:.2f} -> {found['rmse_mm']:.2f} mm", file=sys.stderr)
    return found


def median_and_worst(values):
    values = list(values)
    return f"{statistics.median(values):.2f} ({max(values):.2f})"


def shares(runs, scaled):
    """Returns the shares of errors within one and two stated deviations, percent."""
    errors = numpy.abs(numpy.concatenate([run["errors"][scaled] for run in runs]))
    return f"{100 * (errors < 1).mean():.0f}/{100 * (errors < 2).mean():.0f}"


def table_of(runs):
    lines = ["| fault | RMSE mm | aligned | σ % | aligned | time |", "|---|---|---|---|---|---|"]
    full = [run for run in runs if run["size"] == 1]
    clean = {(run["site"], run["seed"]): run for run in full if run["fault"] == "none"}

    def ratios(key, some):
        return [run[key] / clean[run["site"], run["seed"]][key] for run in some]

    for fault in FAULTS:
        some = [run for run in full if run["fault"] == fault]
        lines.append(f"| {fault} | " + " | ".join((
            *(median_and_worst(run[key] for run in some) for key in ("rmse_mm", "scaled_mm")),
            shares(some, 0), shares(some, 1),
            f"{statistics.median(ratios('processor_s', some)):.1f}")) + " |")
    starts = [run["start_mm"] for run in full]
    focal = max(abs(run["focal_percent"]) for run in full)
    return "\n".join(lines) + (
        f"\n\nOdometry: {min(starts):.0f} to {max(starts):.0f} mm. Largest focal error {focal:.2f} %, "
        f"memory x {max(ratios('mib', full)):.1f}.")


def draw(runs, path):
    import matplotlib
    matplotlib.use("Agg")
    from matplotlib import pyplot
    figure, axis = pyplot.subplots(figsize=(7, 3.6))
    for fault in list(FAULTS)[1:]:
        medians = [statistics.median(run["scaled_mm"] for run in runs if run["site"] == SITES[0] and
                                     run["fault"] == fault and run["size"] == size) for size in SIZES]
        axis.semilogx(SIZES, medians, "o-", label=fault)
    axis.axhline(statistics.median(run["scaled_mm"] for run in runs if run["fault"] == "none"), color="gray",
                 linestyle=":", label="none")
    axis.set(xlabel="size of the fault", ylabel="RMSE, scale aligned, mm", xticks=SIZES,
             xticklabels=["half", "full", "double"])
    axis.set_ylim(bottom=0)
    axis.minorticks_off()
    axis.grid(True, alpha=0.3)
    axis.legend(fontsize=7)
    figure.tight_layout()
    figure.savefig(path, dpi=90)


def main():
    options = scan_options(__doc__.splitlines()[0], "31,32,33")
    cases = [(site, seed, fault, 1.0) for seed in options.seeds for site in SITES for fault in FAULTS]
    cases += [(SITES[0], seed, fault, size) for seed in options.seeds[:1] for fault in list(FAULTS)[1:]
              for size in (SIZES[0], SIZES[2])]
    runs = [run(options.graspmap, options.folder, *case, options.threads) for case in cases]
    text = table_of(runs)
    print(text)
    if options.page:
        draw(runs, options.page.parent / "faults.png")
        put_into_page(options.page, "faults", text + "\n\n![Error against the size of the fault](faults.png)")


if __name__ == "__main__":
    main()
