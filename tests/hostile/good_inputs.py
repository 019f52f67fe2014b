"""Small valid inputs of every kind, written by graspmap."""
import math
import pathlib
import shutil
import struct
import subprocess
import zlib

SCENE = """shapes:
  - {shape: plane, name: ground, size_x_m: 0.6, size_y_m: 0.6}
  - {shape: sphere, name: hemisphere, radius_m: 0.1, x_m: 0.1, y_m: -0.1}
"""
SITE = """seed: 1
ground: {size_x_m: 2, size_y_m: 2, relief_m: 0.01, texture: soil}
layout: {site_size_m: 1.5, free_square_m: 0, gap_m: 0.01}
field_points: {count: 3, min_height_m: 0.05, radius_m: 0.04}
rocks:
  - {name: R01, height_m: 0.3, overhang_deg: 12, ledges: 1, cleft_m: 0}
  - {name: C01, shape: cobble, height_m: 0.15}
"""
CAMERA = """image_width: 80
image_height: 60
camera_matrix: [80, 0, 39.5, 0, 80, 29.5, 0, 0, 1]
"""
RIG = """depth_scale_m: 0.001
near_m: 0.05
far_m: 1.5
cameras:
  - name: front
    image_width: 48
    image_height: 32
    camera_matrix: [30, 0, 23.5, 0, 30, 15.5, 0, 0, 1]
    position_m: [0.02, 0, 0]
    roll_pitch_yaw_deg: [0, 60, 0]
  - name: rear
    image_width: 48
    image_height: 32
    camera_matrix: [30, 0, 23.5, 0, 30, 15.5, 0, 0, 1]
    position_m: [-0.02, 0, 0]
    roll_pitch_yaw_deg: [0, 60, 180]
"""
SCENARIO = """method: corrected
gripper: scar-e
voxel_size_m: 0.02
curvature_radius_m: 0
"""
TERRAIN = "seed: 2\n"
POINTS = """place,x,y,z,graspable
A,0.1,-0.1,0.1,1
B,-0.1,0.1,0,0
C,0.05,-0.1,0.09,1
D,-0.2,0.2,0,0
"""
EXPECTED = """region,x,y,z,to_x,to_y,to_z,radius,graspable,why
top,0.1,-0.1,0.1,,,,0.04,1,top
flat,-0.2,0.2,0,,,,0.04,0,ground
"""
POLYGON = "x,y\n-0.2,-0.2\n0.2,-0.2\n0.2,0.2\n-0.2,0.2\n"
TRANSFORM = "1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n"

TEXTS = {
    "scene.yaml": SCENE, "site.yaml": SITE, "camera.yaml": CAMERA, "rig.yaml": RIG,
    "scenario.yaml": SCENARIO, "terrain.yaml": TERRAIN,
    "points.csv": POINTS,
    "expected.csv": EXPECTED, "polygon.csv": POLYGON, "transform.txt": TRANSFORM,
}

SCORE = ["score", "terrain.pcd", "--config", "scenario.yaml"]

# Commands in order; each may read the outputs of earlier ones.
COMMANDS = [
    ["simulate", "scene", "--scene", "scene.yaml", "--spacing", "0.02", "-o", "terrain.pcd"],
    ["simulate", "scene", "--scene", "scene.yaml", "--mesh", "--edge-length", "0.1",
     "--chord-error", "0.01", "-o", "mesh.ply"],
    ["convert", "terrain.pcd", "-o", "ascii.pcd", "--encoding", "ascii"],
    ["convert", "terrain.pcd", "-o", "compressed.pcd", "--encoding", "binary_compressed"],
    ["convert", "terrain.pcd", "-o", "cloud.ply"],
    ["convert", "terrain.pcd", "-o", "cloud.csv"],
    ["convert", "mesh.ply", "-o", "mesh.obj"],
    ["convert", "mesh.ply", "-o", "mesh.stl"],
    ["convert", "mesh.ply", "-o", "mesh.off"],
    ["convert", "mesh.ply", "-o", "mesh.glb"],
    ["simulate", "cameras", "mesh.ply", "--rig", "rig.yaml", "-o", "rig"],
    ["convert", "rig", "-o", "rig.bag"],
    ["convert", "rig", "-o", "rig.mcap"],
    ["convert", "rig", "-o", "rig_bag"],
    ["simulate", "scan", "mesh.ply", "--camera", "camera.yaml", "--frames", "5", "-o", "scan.db"],
    ["convert", "scan.db", "-o", "frames"],
    ["convert", "scan.db", "-o", "scan.colmap", "--colmap", "poses.colmap"],
    ["refine", "scan.db", "--feature-cache", "off", "-o", "poses.tum"],
    ["convert", "poses.tum", "-o", "poses.kitti"],
    ["convert", "poses.tum", "-o", "poses.g2o"],
    ["convert", "poses.tum", "-o", "poses.toro"],
    SCORE + ["-o", "map.pcd"],
    ["convert", "map.pcd", "-o", "dem.tif"],
    SCORE + ["--tile-size", "0.2", "-o", "map.tiles"],
    ["footholds", "map.pcd", "--border", "--no-graspable-only", "-o", "footholds.csv"],
    ["lookup", "map.pcd", "points.csv", "-o", "lookup.csv"],
    ["convert", "map.pcd", "--terrain", "terrain.pcd", "--footholds", "footholds.csv", "-o", "map.bag"],
]


def png(width, height, rows, depth=8, color=0):
    """Returns a PNG of `rows`, each the bytes of a row of pixels."""
    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
    data = b"".join(b"\0" + row for row in rows)
    return (b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, depth, color, 0, 0, 0))
            + chunk(b"IDAT", zlib.compress(data, 9)) + chunk(b"IEND", b""))


def board(turn, lean):
    """Returns an image of a chessboard of 8 x 6 inner corners, 160 x 120 pixels."""
    c, s, d = math.cos(turn), math.sin(turn), math.cos(lean)
    rows = []
    for v in range(120):
        row = bytearray()
        for u in range(160):
            # Intersection of the pixel's ray with the board's plane, which is rotated about y.
            x, y = (u - 79.5) / 150, (v - 59.5) / 150
            scale = 0.32 * d / (d - x * math.sin(lean))
            px, py = scale * x / d, scale * y
            a, b = (c * px + s * py) / 0.03 + 3.5, (c * py - s * px) / 0.03 + 2.5
            inside = -1 <= a < 8 and -1 <= b < 6
            row.append(20 if inside and (math.floor(a) + math.floor(b)) % 2 == 0 else 235)
        rows.append(bytes(row))
    return png(160, 120, rows)


def make(folder, graspmap, source):
    """Writes the inputs into `folder`; exits if one fails."""
    folder = pathlib.Path(folder)
    folder.mkdir()
    for name, text in TEXTS.items():
        (folder / name).write_text(text)
    shutil.copy(source / "data/grippers/scar-e.yaml", folder / "gripper.yaml")
    for name in ("hubrobo-urdf.yaml", "hubrobo.urdf"):
        shutil.copy(source / "data/grippers" / name, folder)
    (folder / "pictures").mkdir()
    for n in range(4):
        (folder / "pictures" / f"board_{n}.png").write_bytes(board(0.1 * n - 0.15, 0.25 * n - 0.35))
    (folder / "picture.png").write_bytes(png(40, 30, [bytes(range(r, r + 40)) for r in range(30)]))
    for words in COMMANDS:
        run = subprocess.run([graspmap] + words, cwd=folder, capture_output=True, text=True, check=False)
        if run.returncode != 0:
            raise SystemExit(f"graspmap {' '.join(words)}: {run.stderr}")
    (folder / "run").mkdir()
    for name in ("map.pcd", "map.pcd.json", "lookup.csv", "picture.png"):
        shutil.copy(folder / name, folder / "run" / name)
    (folder / "terrain").mkdir()
    shutil.copy(folder / "terrain.pcd", folder / "terrain" / "piece.pcd")
