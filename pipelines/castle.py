#!/usr/bin/python3
"""Converts the RealSense sequence of ViSP's test data (Debian: visp-images-data) to a scan.

usage: castle.py CASTEL_FOLDER OUT_FOLDER

Writes OUT/scan, a folder of frames with two cameras, and the ground truth of the model castle: its
planes (OUT/planes.obj) and their pose (OUT/map_from_planes.txt). Needs pnmtopng (Debian: netpbm).
"""

import math
import pathlib
import re
import struct
import subprocess
import sys

DEPTH_UNIT_M = 0.000125  # depth unit of the SR300
# Rotation from the optical frame to the base frame (x forward, z up).
BASE_FROM_OPTICAL = [[0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, 0], [0, 0, 0, 1]]


def times(a, b):
    return [[sum(a[i][k] * b[k][j] for k in range(4)) for j in range(4)] for i in range(4)]


def inverse(pose):
    """Returns the inverse of a rigid motion."""
    rotation = [[pose[j][i] for j in range(3)] for i in range(3)]
    shift = [-sum(rotation[i][k] * pose[k][3] for k in range(3)) for i in range(3)]
    return [rotation[i] + [shift[i]] for i in range(3)] + [[0, 0, 0, 1]]


def rigid(shift, turn):
    """Returns the rigid motion of a translation and a rotation vector."""
    angle = math.hypot(*turn)
    x, y, z = (value / angle for value in turn)
    cross = [[0, -z, y], [z, 0, -x], [-y, x, 0]]
    squared = [[sum(cross[i][k] * cross[k][j] for k in range(3)) for j in range(3)] for i in range(3)]
    return [[(i == j) + math.sin(angle) * cross[i][j] + (1 - math.cos(angle)) * squared[i][j]
             for j in range(3)] + [shift[i]] for i in range(3)] + [[0, 0, 0, 1]]


def write_png(pnm, path):
    path.write_bytes(subprocess.run(["pnmtopng", "-quiet"], input=pnm, stdout=subprocess.PIPE,
                                    check=True).stdout)


def write_camera(path, xml, base_from_camera):
    fx, fy, cx, cy = (re.search(rf"<{key}>(.*?)</{key}>", xml.read_text())[1]
                      for key in ("px", "py", "u0", "v0"))
    pose = ", ".join(repr(value) for row in base_from_camera[:3] for value in row)
    path.write_text(f"""%YAML:1.0
---
image_width: 640
image_height: 480
camera_matrix: !!opencv-matrix
  {{rows: 3, cols: 3, dt: d, data: [{fx}, 0, {cx}, 0, {fy}, {cy}, 0, 0, 1]}}
local_transform: !!opencv-matrix
  {{rows: 3, cols: 4, dt: d, data: [{pose}]}}
""")


def write_scan(source, scan):
    lists = {"rgb": [], "depth": []}
    for folder in lists:
        (scan / folder).mkdir(parents=True, exist_ok=True)
    for number, depth in enumerate(sorted(source.glob("castel/depth_image_*.bin"))):
        height, width = struct.unpack("<II", depth.read_bytes()[:8])
        units = struct.unpack(f"<{height * width}H", depth.read_bytes()[8:])
        write_png(b"P5\n%d %d\n65535\n" % (width, height) + struct.pack(f">{height * width}H", *units),
                  scan / f"depth/{number:04}.png")
        picture = depth.with_name(f"image_{number:04}.pgm")
        write_png(picture.read_bytes(), scan / f"rgb/{number:04}.png")
        for folder, lines in lists.items():
            lines.append(f"{number / 30:.6f} {folder}/{number:04}.png\n")
    for folder, lines in lists.items():
        (scan / f"{folder}.txt").write_text("".join(lines))
    numbers = list(map(float, (source / "depth_M_color.txt").read_text().split()))
    depth_from_color = [numbers[4 * row:4 * row + 4] for row in range(4)]
    write_camera(scan / "calibration.yaml", source / "chateau.xml", BASE_FROM_OPTICAL)
    write_camera(scan / "depth_camera.yaml", source / "chateau_depth.xml",
                 times(BASE_FROM_OPTICAL, inverse(depth_from_color)))
    (scan / "scan.yaml").write_text(
        f"depth_unit_m: {DEPTH_UNIT_M}\ndepth_calibration: depth_camera.yaml\n")


def planes_of(cao):
    """Returns the vertices and faces of a ViSP model file: lists, each after its number of lines."""
    lines = [line.split("#")[0].split() for line in cao.read_text().splitlines()]
    lines = [line for line in lines if line and line != ["V1"]]
    blocks = []
    while lines and len(blocks) < 4:  # points, segments, faces of segments, faces of points
        count = int(lines[0][0])
        blocks.append(lines[1:1 + count])
        lines = lines[1 + count:]
    points, _, _, faces = blocks
    return points, [list(map(int, face[1:1 + int(face[0])])) for face in faces]


def write_planes(source, out):
    text, first = "", 1
    for cao in sorted(source.glob("chateau_parts/*.cao")):
        points, faces = planes_of(cao)
        text += "".join("v " + " ".join(point[:3]) + "\n" for point in points)
        text += "".join("f " + " ".join(str(first + n) for n in face) + "\n" for face in faces)
        first += len(points)
    (out / "planes.obj").write_text(text)
    start = list(map(float, (source / "chateau.0.pos").read_text().split()))
    pose = times(BASE_FROM_OPTICAL, rigid(start[:3], start[3:]))
    (out / "map_from_planes.txt").write_text(
        "".join(" ".join(f"{value:.9f}" for value in row) + "\n" for row in pose))


if __name__ == "__main__":
    source, out = map(pathlib.Path, sys.argv[1:])
    write_scan(source, out / "scan")
    write_planes(source, out)
