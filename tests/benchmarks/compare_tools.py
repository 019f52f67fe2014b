#!/usr/bin/python3
"""Compares graspmap with MeshLab, Open3D and CloudCompare as Debian packages them, in one run.

usage: compare_tools.py [samples|surface] BUILD_FOLDER DATA_FOLDER [--count N] [--repeat N]

samples: Poisson-disk samples of scans/site_ground_truth_mesh.ply.
surface: Poisson reconstruction of the fused cloud of scans/site_full.db with true poses.

Prints a Markdown table: wall time, processor time and memory of each program as a command, including
reading and writing its files (minimum of the repeats), and the quality of its output by sample_quality
or `graspmap compare`. Programs that are not installed are reported and omitted.
"""

import argparse
import json
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import time

PYTHON = "/usr/bin/python3"  # Debian's Python, which finds python3-open3d

MESHLAB_SAMPLES = """<!DOCTYPE FilterScript>
<FilterScript>
 <filter name="Poisson-disk Sampling">
  <Param name="SampleNum" type="RichInt" value="{count}"/>
  <Param name="Radius" type="RichAbsPerc" value="0" min="0" max="100"/>
  <Param name="MontecarloRate" type="RichInt" value="20"/>
  <Param name="SaveMontecarlo" type="RichBool" value="false"/>
  <Param name="ApproximateGeodesicDistance" type="RichBool" value="false"/>
  <Param name="Subsample" type="RichBool" value="false"/>
  <Param name="RefineFlag" type="RichBool" value="false"/>
  <Param name="RefineMesh" type="RichMesh" value="0"/>
  <Param name="BestSampleFlag" type="RichBool" value="true"/>
  <Param name="BestSamplePool" type="RichInt" value="10"/>
  <Param name="ExactNumFlag" type="RichBool" value="{exact}"/>
  <Param name="RadiusVariance" type="RichFloat" value="1"/>
 </filter>
</FilterScript>
"""

MESHLAB_SURFACE = """<!DOCTYPE FilterScript>
<FilterScript>
 <filter name="Surface Reconstruction: Screened Poisson">
  <Param name="visibleLayer" type="RichBool" value="false"/>
  <Param name="depth" type="RichInt" value="{depth}"/>
  <Param name="fullDepth" type="RichInt" value="5"/>
  <Param name="cgDepth" type="RichInt" value="0"/>
  <Param name="scale" type="RichFloat" value="1.1"/>
  <Param name="samplesPerNode" type="RichFloat" value="1.5"/>
  <Param name="pointWeight" type="RichFloat" value="4"/>
  <Param name="iters" type="RichInt" value="8"/>
  <Param name="confidence" type="RichBool" value="false"/>
  <Param name="preClean" type="RichBool" value="false"/>
 </filter>
</FilterScript>
"""

OPEN3D_SAMPLES = """
import sys, open3d as o3d
mesh = o3d.io.read_triangle_mesh(sys.argv[1])
mesh.compute_vertex_normals()
cloud = mesh.sample_points_poisson_disk(int(sys.argv[3]))
o3d.io.write_point_cloud(sys.argv[2], cloud)
"""

# Trimming as in Open3D's tutorial: removes the share of vertices of the lowest density.
OPEN3D_SURFACE = """
import sys, numpy, open3d as o3d
cloud = o3d.io.read_point_cloud(sys.argv[1])
mesh, densities = o3d.geometry.TriangleMesh.create_from_point_cloud_poisson(
    cloud, depth=int(sys.argv[3]))
share = float(sys.argv[4])
if share > 0:
    densities = numpy.asarray(densities)
    mesh.remove_vertices_by_mask(densities < numpy.quantile(densities, share))
o3d.io.write_triangle_mesh(sys.argv[2], mesh)
"""

SITE_BOX = "-1.5,-1.5,-0.5,1.5,1.5,2"  # box of the true mesh
MESH_FROM_TRUTH = "0,0,0,0,0,-90"


class Display:
    """Starts a virtual screen for programs that require one; does nothing without Xvfb."""

    def __enter__(self):
        self.server = None
        if shutil.which("Xvfb"):
            read, write = os.pipe()
            self.server = subprocess.Popen(
                ["Xvfb", "-displayfd", str(write), "-screen", "0", "1024x768x24"],
                pass_fds=[write], stderr=subprocess.DEVNULL)
            os.close(write)
            with os.fdopen(read) as number:
                os.environ["DISPLAY"] = ":" + number.readline().strip()
        return self

    def __exit__(self, *_):
        if self.server:
            self.server.terminate()
            self.server.wait()


def measured(words, output, repeat):
    """Returns (wall s, processor s, MB) of a command; None, with its output on stderr, if it fails."""
    best = None
    for _ in range(repeat):
        output.unlink(missing_ok=True)
        with tempfile.TemporaryFile() as log:
            start = time.monotonic()
            process = subprocess.Popen(words, stdin=subprocess.DEVNULL, stdout=log, stderr=log)
            _, status, usage = os.wait4(process.pid, 0)
            wall = time.monotonic() - start
            process.returncode = os.waitstatus_to_exitcode(status)
            if process.returncode != 0 or not output.exists():
                log.seek(0)
                tail = log.read().decode(errors="replace").strip().splitlines()[-1:]
                print("failed:", " ".join(map(str, words)), *tail, file=sys.stderr)
                return None
        run = (wall, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024)
        best = run if best is None or run[0] < best[0] else best
    return best


def has_open3d():
    return os.path.exists(PYTHON) and subprocess.run(
        [PYTHON, "-c", "import open3d"], stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL).returncode == 0


def installed():
    tools = {
        "MeshLab": bool(shutil.which("meshlabserver") and shutil.which("Xvfb")),
        "Open3D": has_open3d(),
        "CloudCompare": bool(shutil.which("CloudCompare") and shutil.which("Xvfb")),
    }
    for name, found in tools.items():
        if not found:
            print(f"not installed, left out: {name}", file=sys.stderr)
    return tools


def json_of(words):
    return json.loads(subprocess.run(words, check=True, capture_output=True, text=True).stdout)


def row(*cells):
    print("| " + " | ".join(str(cell) for cell in cells) + " |", flush=True)


def cost(run):
    return f"{run[0]:.2f}", f"{run[1]:.2f}", f"{run[2]:.0f}"


def compare_samples(options, folder, tools):
    mesh = options.data / "scans/site_ground_truth_mesh.ply"
    count = options.count
    ours = folder / "graspmap.pcd"
    theirs = folder / "theirs.ply"
    graspmap = [options.build / "graspmap", "resample", mesh, "-o", ours, "--quiet"]
    runs = [(f"graspmap, {threads} thread{'s' * (threads > 1)}", ours,
             graspmap + ["--count", str(count), "--threads", str(threads)]) for threads in (1, 2)]
    if tools["MeshLab"]:
        for exact in ("false", "true"):
            script = folder / f"samples_{exact}.mlx"
            script.write_text(MESHLAB_SAMPLES.format(count=count, exact=exact))
            name = "MeshLab" + (", exact number" if exact == "true" else "")
            runs.append((name, theirs, ["meshlabserver", "-i", mesh, "-o", theirs, "-l", "x",
                                        "-m", "vn", "-s", script]))
    if tools["Open3D"]:
        runs.append(("Open3D", theirs, [PYTHON, "-c", OPEN3D_SAMPLES, mesh, theirs, str(count)]))

    row("program", "wall s", "processor s", "MB", "points", "relative radius",
        "largest hole / smallest distance")
    row(*["---"] * 7)

    def evaluate(name, output, words):
        run = measured(words, output, options.repeat)
        if run is None:
            row(name, *["failed"] + [""] * 5)
            return None
        quality = json_of([options.build / "benchmarks/sample_quality", mesh, output])
        row(name, *cost(run), quality["points"], f"{quality['relative_radius']:.3f}",
            f"{quality['largest_hole_m'] / quality['smallest_distance_m']:.3f}")
        return quality

    qualities = [evaluate(*run) for run in runs]
    if tools["CloudCompare"] and qualities[0]:
        # CloudCompare has no Poisson-disk sampling of meshes. Downsampling of dense random samples is the
        # closest equivalent.
        radius = qualities[0]["smallest_distance_m"]
        evaluate("CloudCompare, 20 N random samples downsampled to our radius", theirs,
              ["CloudCompare", "-SILENT", "-AUTO_SAVE", "OFF", "-C_EXPORT_FMT", "PLY", "-O", mesh,
               "-SAMPLE_MESH", "POINTS", str(20 * count), "-SS", "SPATIAL", f"{radius:.9f}",
               "-CLEAR_MESHES", "-SAVE_CLOUDS", "FILE", theirs])


def compare_surfaces(options, folder, tools):
    graspmap = options.build / "graspmap"
    truth = options.data / "scans/site_ground_truth_mesh.ply"
    cloud = folder / "cloud.ply"
    subprocess.run([graspmap, "fuse", options.data / "scans/site_full.db", "-o", cloud, "--poses",
                    "ground-truth", "--frame", "ground-truth", "--quiet"], check=True)
    surface = folder / "surface.ply"
    runs = []
    if subprocess.run([graspmap, "mesh", "--help"], stdout=subprocess.DEVNULL,
                      stderr=subprocess.DEVNULL).returncode == 0:
        for cell in ("0.01", "0.0075"):
            runs.append((f"graspmap, {1e3 * float(cell):g} mm", folder / "graspmap.ply",
                         [graspmap, "mesh", cloud, "-o", folder / "graspmap.ply", "--cell-size",
                          cell, "--quiet"]))
    # Cells of 1.5 and 0.75 cm.
    for depth in (8, 9):
        if tools["MeshLab"]:
            script = folder / f"surface_{depth}.mlx"
            script.write_text(MESHLAB_SURFACE.format(depth=depth))
            runs.append((f"MeshLab, depth {depth}", surface,
                         ["meshlabserver", "-i", cloud, "-o", surface, "-l", "x", "-s", script]))
        if tools["Open3D"]:
            for share in (0, 0.05):
                name = f"Open3D, depth {depth}" + (f", trimmed by {share:g}" if share else "")
                runs.append((name, surface, [PYTHON, "-c", OPEN3D_SURFACE, cloud, surface,
                                             str(depth), str(share)]))
    if tools["CloudCompare"]:
        print("left out: CloudCompare has no Poisson reconstruction on its command line",
              file=sys.stderr)

    row("program", "wall s", "processor s", "MB", "RMSE mm", "median mm", "95 % mm",
        "truth within 1 cm %")
    row(*["---"] * 8)
    samples = folder / "samples.ply"
    for name, output, words in runs:
        run = measured(words, output, options.repeat)
        if run is None:
            row(name, *["failed"] + [""] * 6)
            continue
        subprocess.run([graspmap, "resample", output, "-o", samples, "--radius", "0.006",
                        "--quiet"], check=True)
        result = json_of([graspmap, "compare", samples, truth, "--json", "--transform",
                          MESH_FROM_TRUTH, "--box", SITE_BOX])
        row(name, *cost(run), f"{1e3 * result['rmse_m']:.2f}", f"{1e3 * result['median_m']:.2f}",
            f"{1e3 * result['p95_m']:.2f}", f"{100 * result['completeness']:.2f}")


def main():
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", nargs="?", choices=["samples", "surface"])
    parser.add_argument("build", type=pathlib.Path)
    parser.add_argument("data", type=pathlib.Path)
    parser.add_argument("--count", type=int, default=73000)
    parser.add_argument("--repeat", type=int, default=3)
    options = parser.parse_args()
    options.build = options.build.resolve()
    options.data = options.data.resolve()
    tools = installed()
    with Display(), tempfile.TemporaryDirectory() as name:
        os.environ.setdefault("XDG_RUNTIME_DIR", name)
        os.chdir(name)  # MeshLab writes its cache into the current folder
        load = os.getloadavg()[0]
        print(f"{os.cpu_count()} processors, load {load:.1f} at the start, least of "
              f"{options.repeat}\n")
        if options.what in (None, "samples"):
            compare_samples(options, pathlib.Path(name), tools)
            print()
        if options.what in (None, "surface"):
            compare_surfaces(options, pathlib.Path(name), tools)


if __name__ == "__main__":
    main()
