"""Uses of every command with an input file, and the kinds of broken input for each."""
from dataclasses import dataclass


@dataclass
class Use:
    name: str
    words: list    # {x}: the broken input, {good}: the folder of good inputs; outputs without a folder
    kinds: tuple   # kinds of broken input
    main: bool     # also in the short run
    example: str   # good input to replace the broken one


def use(words, kinds, example, main=False):
    words = words.split()
    name = " ".join(word.replace("{x}", "X").replace("{good}/", "") for word in words)
    return Use(name, words, tuple(kinds.split()), main, example)


SMALL = "--width 160 --height 120"
SCORE = "--voxel-size 0.02 --curvature-radius 0"

USES = [
    use("info {x}", "cloud map mesh scan tiles footholds", "terrain.pcd", main=True),
    use("info {x} --json", "cloud map mesh scan tiles footholds", "mesh.ply"),
    use("info {x} --verify", "scan", "scan.db", main=True),
    use("info --verify {x}", "tiles", "map.tiles", main=True),
    use("convert {x} -o out.csv", "cloud map footholds", "terrain.pcd", main=True),
    use("convert {x} -o out.vtp", "cloud map", "terrain.pcd"),
    use("convert {x} -o out.ply --encoding ascii", "cloud map mesh", "terrain.pcd"),
    use("convert {x} -o out.obj", "mesh", "mesh.ply", main=True),
    use("convert {x} -o out.glb", "mesh", "mesh.ply"),
    use("convert {x} -o out.kitti", "poses", "poses.tum", main=True),
    use("convert {x} -o out.g2o", "poses", "poses.tum"),
    use("convert {x} -o out.toro", "poses", "poses.tum"),
    use("simulate scene --scene {x} --spacing 0.05 -o out.pcd", "scene", "scene.yaml", main=True),
    use("simulate scene --scene {x} --mesh --edge-length 0.2 --chord-error 0.02 -o out.ply", "scene", "scene.yaml"),
    use("simulate scene --config {x} -o out.pcd", "scenario", "terrain.yaml"),
    use("simulate site --site {x} --edge-length 0.2 -o out", "site", "site.yaml", main=True),
    use("simulate terrain --size 1 --spacing 0.1 --config {x} -o out", "scenario", "terrain.yaml"),
    use("simulate scan {x} --camera {good}/camera.yaml --frames 2 -o out.db", "mesh", "mesh.ply"),
    use("simulate scan {good}/mesh.ply --camera {x} --frames 2 -o out.db", "camera", "camera.yaml", main=True),
    use("simulate cameras {x} --rig {good}/rig.yaml -o out", "mesh", "mesh.ply"),
    use("simulate cameras {good}/mesh.ply --rig {x} -o out", "rig", "rig.yaml", main=True),
    use("convert {x} -o out", "scan", "scan.db", main=True),
    use("convert {x} --strict -o out", "scan", "scan.db"),
    use("convert {x} -o out --bundler bundler --colmap model", "scan", "scan.db"),
    use("convert {good}/scan.db -o out --bundler bundler --poses {x}", "poses", "poses.tum"),
    use("convert {good}/scan.db -o out --colmap model --transform {x}", "transform", "transform.txt", main=True),
    use("refine {x} --feature-cache off --write-database copy.db --links links.g2o -o out.tum", "scan", "scan.db", main=True),
    use("fuse {x} -o out.ply", "scan", "scan.db", main=True),
    use("fuse {x} --strict --stereo --poses ground-truth -o out.ply", "scan", "scan.db"),
    use("fuse {good}/scan.db --poses {x} -o out.ply", "poses", "poses.tum"),
    use("fuse {x} -o out.pcd", "rig-folder", "rig", main=True),
    use("fuse {x} --rig {good}/rig.yaml --strict --normals -o out.pcd", "rig-folder", "rig"),
    use("fuse {good}/rig --rig {x} -o out.pcd", "rig", "rig.yaml"),
    use("mesh {x} --cell-size 0.05 -o out.ply", "cloud", "terrain.pcd"),
    use("texture {x} --scan {good}/scan.db --poses ground-truth --texture-size 256 -o out.glb", "mesh", "mesh.ply"),
    use("texture {good}/mesh.ply --scan {x} --poses ground-truth --texture-size 256 -o out.obj", "scan", "scan.db"),
    use("texture {good}/mesh.ply --scan {good}/scan.db --poses {x} --frame ground-truth --texture-size 256 -o out.obj", "poses", "poses.tum"),
    use("crop {x} --box=-0.2,-0.2,-1,0.2,0.2,1 -o out.ply", "mesh cloud map", "mesh.ply"),
    use("crop {x} --size 0.3x0.3 -o out.ply", "mesh cloud", "mesh.ply"),
    use("crop {good}/mesh.ply --polygon {x} -o out.ply", "polygon", "polygon.csv", main=True),
    use("resample {x} --count 300 -o out.pcd", "mesh", "mesh.ply", main=True),
    use("compare --edges {x} -o out.csv", "mesh cloud", "mesh.ply"),
    use("compare --edges {good}/terrain.pcd --truth {x} -o out.csv", "mesh", "mesh.ply", main=True),
    use("compare {x} {good}/mesh.ply -o out.pcd", "mesh cloud", "terrain.pcd"),
    use("compare {good}/terrain.pcd {x} -o out.pcd", "mesh cloud", "mesh.ply"),
    use("compare {good}/terrain.pcd {good}/mesh.ply --transform {x} -o out.pcd", "transform", "transform.txt"),
    use("calibrate {good}/pictures {x} -o out.yaml", "board", "pictures/board_0.png", main=True),
    use(f"score {{x}} {SCORE} -o out.pcd", "cloud", "terrain.pcd", main=True),
    use("score {x} --method thesis --voxel-size 0.03 -o out.vtp", "cloud", "terrain.pcd"),
    use(f"score {{x}} {SCORE} --plane none --interpolation -o out.csv", "cloud", "terrain.pcd"),
    use(f"score {{x}} {SCORE} --tile-size 0.2 --max-points-in-memory 1000 --force -o out.tiles", "cloud", "terrain.pcd", main=True),
    use(f"score {{x}} {SCORE} --plane none -o out.pcd", "dem", "dem.tif", main=True),
    use(f"score {{x}} {SCORE} --tile-size 0.2 --force -o out.tiles", "dem", "dem.tif"),
    use("convert {x} -o out.ply", "dem", "dem.tif", main=True),
    use("convert {x} -o out.tif", "map tiles", "map.pcd"),
    use("score {good}/terrain.pcd --config {x} -o out.pcd", "scenario", "scenario.yaml", main=True),
    use(f"score {{good}}/terrain.pcd {SCORE} --gripper {{x}} -o out.pcd", "gripper", "gripper.yaml", main=True),
    use("mask --gripper {x} -o out.txt", "gripper urdf", "gripper.yaml", main=True),
    use("convert {x} -o out.pcd", "tiles", "map.tiles", main=True),
    use("convert {x} -o out.vtp", "map", "map.pcd"),
    use("grasp {x} --points {good}/points.csv --trials 1 --draws 1 --max-distance 10 --prefix t_ -o out.csv", "mesh", "mesh.ply", main=True),
    use("grasp {good}/mesh.ply --points {x} --trials 1 --draws 1 --max-distance 10 --prefix t_ -o out.csv", "points", "points.csv", main=True),
    use("grasp {good}/mesh.ply --points {good}/points.csv --gripper {x} --trials 1 --draws 1 --max-distance 10 --prefix t_ -o out.csv", "gripper", "gripper.yaml"),
    use("lookup {x} {good}/points.csv -o out.csv", "map tiles", "map.pcd", main=True),
    use("lookup {good}/map.pcd {x} -o out.csv", "points lookup", "points.csv", main=True),
    use("lookup {good}/map.pcd {good}/points.csv --visible {x} -o out.csv", "cloud", "terrain.pcd"),
    use("evaluate {x} --bootstrap 10 -o out", "lookup", "lookup.csv", main=True),
    use("analyze {x} --no-images -o out", "map", "map.pcd"),
    use("analyze {good}/map.pcd --against {x} --no-images -o out", "map", "map.pcd"),
    use("footholds {x} --border --no-graspable-only -o out.csv", "map", "map.pcd"),
    use("analyze {x} {good}/map.pcd --pairs -o out", "map", "map.pcd"),
    use("analyze {good}/map.pcd --expected {x} -o out", "expected", "expected.csv", main=True),
    use(f"render {{x}} {SMALL} -o out.png", "cloud map mesh tiles", "map.pcd"),
    use(f"render {{good}}/map.pcd --points {{x}} --verdict graspable {SMALL} -o out.png", "points", "points.csv"),
    use("render {x} {good}/map.pcd --cell-width 160 -o out.png", "picture map tiles", "picture.png"),
    use("report {x} -o out.html", "run-folder", "run", main=True),
    use("convert -o out {x}", "bag", "rig.bag", main=True),
    use("convert {x} --topic /merged_pcd -o out.pcd", "bag", "map.bag"),
    use("info --json {x}", "bag", "rig.bag", main=True),
    use("convert {x} -o out.bag", "map rig-folder", "map.pcd"),
    use("convert {good}/map.pcd --terrain {x} -o out.bag", "cloud", "terrain.pcd"),
    use("convert {good}/map.pcd --footholds {x} -o out.bag", "footholds", "footholds.csv", main=True),
    use("convert {good}/rig.bag --rig {x} -o out", "rig", "rig.yaml"),
]
