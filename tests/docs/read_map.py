#!/usr/bin/python3
"""Reads a graspability map, its manifest and optionally its tile store according to tools/FORMATS.md, and
checks that page: read_map.py MAP.pcd [STORE.tiles]. Uses only the standard library."""

import hashlib
import json
import math
import pathlib
import struct
import sys

LETTERS = {("F", 4): "f", ("F", 8): "d", ("U", 1): "B", ("U", 2): "H", ("U", 4): "I",
           ("I", 1): "b", ("I", 2): "h", ("I", 4): "i"}
COLORS = ((0.9, (0, 100, 0)), (0.8, (34, 170, 34)), (0.7, (154, 205, 50)), (0.6, (255, 235, 0)),
          (0.5, (255, 200, 110)), (0.4, (255, 140, 0)), (-math.inf, (214, 24, 24)))


def read_pcd(path):
    """Returns the records of a binary PCD file as dictionaries."""
    data = path.read_bytes()
    end = data.index(b"DATA binary\n") + len(b"DATA binary\n")
    header = dict(line.split(" ", 1) for line in data[:end].decode().splitlines()
                  if not line.startswith("#"))
    names = header["FIELDS"].split()
    letters = [LETTERS[kind, int(size)]
               for kind, size in zip(header["TYPE"].split(), header["SIZE"].split())]
    record = struct.Struct("<" + "".join(letters))
    assert len(data) - end == record.size * int(header["POINTS"]), "as many bytes as records"
    return [dict(zip(names, values)) for values in record.iter_unpack(data[end:])]


def read_manifest(path):
    return json.loads(path.with_name(path.name + ".json").read_text(encoding="utf-8"))


def matched_of(point, threshold):
    """Returns the score of method `corrected` from its counts, before the factor falling_share."""
    share = point["gsv"] / point["ssv"]
    if point["ssv"] <= threshold and share >= 0.6:
        share -= (threshold - point["ssv"]) / threshold
    return max(0.0, share)


def check_map(points, manifest):
    parameters, results = manifest["parameters"], manifest["results"]
    origin, size = results["lattice_origin_m"], parameters["voxel_size_m"]
    plane = parameters["zero_plane_m"]
    lowest = float("-inf") if plane == "auto" else plane
    assert [(p["i"], p["j"], p["k"]) for p in points] == sorted({(p["i"], p["j"], p["k"])
                                                                for p in points}), "ascending"
    for point in points:
        for axis, index, start in zip("xyz", "ijk", origin):
            assert abs(point[axis] - (start + size * (point[index] + 0.5))) < 1e-5, "center"
        matched = matched_of(point, parameters["solid_voxel_threshold"])
        azimuths = 16 * point["falling_share"]
        assert azimuths == int(azimuths) and 0 <= azimuths <= 16, "falling_share"
        assert abs(point["score"] - matched * point["falling_share"]) < 1e-6, "score"
        above = point["z"] >= lowest
        color = next(c for least, c in COLORS if point["score"] >= least - 1e-6) if above else (255,) * 3
        assert (point["rgb"] >> 16 & 255, point["rgb"] >> 8 & 255, point["rgb"] & 255) == color
        holds = above and point["score"] >= parameters["graspability_threshold"]
        if parameters["curvature_radius_m"] > 0:
            holds = holds and point["convex"] == 1
        assert point["graspable"] == int(holds), "graspable"
    assert results["scored_voxels"] == len(points)
    assert results["border_voxels"] == sum(p["border"] for p in points)
    assert results["graspable_voxels"] == sum(p["graspable"] for p in points)


def check_inputs(manifest, folder):
    """Returns the number of inputs in the folder. Checks their bytes against the manifest."""
    found = 0
    for one in manifest["inputs"]:
        path = folder / one["path"]
        if path.is_file():
            data = path.read_bytes()
            assert hashlib.sha256(data).hexdigest() == one["sha256"] and len(data) == one["bytes"]
            found += 1
    return found


def read_store(store):
    """Returns all points of a tile store. Checks each tile against the index and its journal."""
    index = json.loads((store / "index.json").read_text(encoding="utf-8"))
    assert index["format"] == "graspmap tile store" and index["version"] == 1
    journal = [json.loads(line) for path in sorted((store / "progress").glob("*_of_*.jsonl"))
               for line in path.read_text(encoding="utf-8").splitlines()]
    done = {(one["i"], one["j"]): one["sha256"] for one in journal if one["key"] == index["key"]}
    points = []
    for tile in index["tiles"]:
        if tile["voxels"] == 0:
            continue
        data = (store / tile["file"]).read_bytes()
        assert hashlib.sha256(data).hexdigest() == tile["sha256"] == done[tile["i"], tile["j"]]
        own = read_pcd(store / tile["file"])
        width = index["tile_voxels"]
        assert {(p["i"] // width, p["j"] // width) for p in own} == {(tile["i"], tile["j"])}
        assert len(own) == tile["voxels"] and len(data) == tile["bytes"]
        for axis, index_name in enumerate("ijk"):
            assert tile["min"][axis] == min(p[index_name] for p in own)
            assert tile["max"][axis] == max(p[index_name] for p in own)
        points += own
    return sorted(points, key=lambda p: (p["i"], p["j"], p["k"])), len(index["tiles"])


def main():
    path = pathlib.Path(sys.argv[1])
    points, manifest = read_pcd(path), read_manifest(path)
    check_map(points, manifest)
    inputs = check_inputs(manifest, path.parent)
    print(f"{len(points)} voxels of {manifest['parameters']['voxel_size_m']} m, "
          f"{sum(p['graspable'] for p in points)} can be held; {inputs} inputs unchanged")
    if len(sys.argv) > 2:
        stored, tiles = read_store(pathlib.Path(sys.argv[2]))
        assert stored == points, "the tiles together are the map"
        print(f"{tiles} tiles, together the same voxels")


if __name__ == "__main__":
    main()
