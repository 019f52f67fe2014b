#!/usr/bin/python3
"""Computes the mask of method `corrected` according to section 4 of libgtd/ALGORITHM.md and compares it
with the output of `graspmap mask`: read_mask.py GRIPPER.yaml VOXEL_SIZE_M MASK.txt (no extra void
layers)."""

import math
import pathlib
import re
import sys


def read_gripper(path):
    pairs = re.findall(r"^(\w+): *([\d.]+)", path.read_text(encoding="utf-8"), re.MULTILINE)
    return {key: float(value) for key, value in pairs}


def read_mask(path):
    """Returns (side, layers of lines), the top layer first."""
    lines = path.read_text(encoding="utf-8").splitlines()
    side = int(lines[1].split()[0])
    rows = [line for line in lines[2:] if not line.startswith("z")]
    return side, [rows[n:n + side] for n in range(0, len(rows), side)][::-1]


def tan(degrees):
    return math.tan(math.radians(degrees))


def make_mask(gripper, size):
    palm, height = gripper["palm_diameter_mm"], gripper["closing_height_mm"]
    reach = (gripper["finger_joint_diameter_mm"] / 2 + gripper["finger_length_mm"] +
             gripper["spine_length_mm"])
    top = (palm + gripper["top_solid_margin_mm"]) / 2
    cone = tan(90 - gripper["opening_angle_deg"])
    cone_end = (reach - palm / 2) * cone
    bowl = palm / 2 + height * tan(gripper["closing_angle_deg"]) - gripper["bottom_void_margin_mm"]
    rings = math.floor(reach / size + 1e-9)
    layers = math.ceil(height / size - 1e-9)

    def is_solid(layer, x, y):
        depth, distance = size * layer, size * math.hypot(x - rings, y - rings)
        if layer == layers - 1:
            return distance > bowl
        if depth < cone_end:
            return distance <= top + depth / cone
        t = depth - (height - bowl)
        return distance < reach if t <= 0 else distance > math.sqrt(2 * bowl * t - t * t)

    places = range(2 * rings + 1)
    return len(places), [["".join("01"[is_solid(layer, x, y)] for y in places) for x in places]
                         for layer in range(layers)]


def main():
    side, expected = make_mask(read_gripper(pathlib.Path(sys.argv[1])), 1000 * float(sys.argv[2]))
    read_side, layers = read_mask(pathlib.Path(sys.argv[3]))
    assert side == read_side and expected == layers, "another mask"
    solid = sum(row.count("1") for layer in layers for row in layer)
    print(f"{side} x {side} x {len(layers)} voxels, {solid} solid, as the equations say")


if __name__ == "__main__":
    main()
