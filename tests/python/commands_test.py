#!/usr/bin/python3
"""The Python module makes what the commands make, to the byte.

commands_test.py BUILD_FOLDER EXAMPLE_FOLDER: that of the manual, with a scan and the outputs of the
commands in tools/manual/README.md.
"""

import csv
import json
import shutil
import unittest

import support

import graspmap
import numpy as np


def read_csv(path):
    """{column: [text]}."""
    with open(path, encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
    return {name: [row[name] for row in rows] for name in rows[0]}


def read_points(path):
    columns = read_csv(path)
    return np.array([columns[axis] for axis in "xyz"], float).T


class Commands(unittest.TestCase):
    def setUp(self):
        self.folder = support.scratch_folder(self)

    def example(self, name):
        return support.EXAMPLE / name

    def copied(self, *names):
        """Files of the example, with their manifests, in the scratch folder."""
        for name in names:
            for file in (name, f"{name}.json"):
                if self.example(file).exists():
                    shutil.copy(self.example(file), self.folder / file)

    def run_command(self, *words):
        support.graspmap_command(*words, folder=self.folder)

    def assert_same_bytes(self, path, write, made):
        mine = self.folder / f"of_python{path.suffix}"
        write(mine, made)
        self.assertEqual(mine.read_bytes(), path.read_bytes())

    def test_poses(self):
        scan = graspmap.open_scan(self.example("scan.db"))
        self.run_command("refine", self.example("scan.db"), "--rounds", 1, "--no-bundle", "-o",
                         "poses.tum")
        refined = graspmap.refine(scan, rounds=1, bundle=False)
        self.assert_same_bytes(self.folder / "poses.tum", graspmap.write_poses, refined.poses)
        self.assertEqual(refined.stages[0]["name"], "start: odometry")
        self.assertEqual(len(refined.poses), len(scan))

    def test_fused_cloud(self):
        scan = graspmap.open_scan(self.example("scan.db"))
        self.run_command("fuse", self.example("scan.db"), "--poses", self.example("poses.tum"),
                         "--voxel-size", 0.03, "--registration-rounds", 0, "-o", "cloud.ply")
        poses = graspmap.read_poses(self.example("poses.tum"), scan)
        fused = graspmap.fuse(scan, poses, voxel_size_m=0.03, registration_rounds=0)
        self.assert_same_bytes(self.folder / "cloud.ply", graspmap.write_cloud, fused.cloud)
        self.assertEqual(fused.frames, len(scan))

    def test_frames(self):
        """Arrays of a frame are the images that `convert` writes."""
        from matplotlib.image import imread
        self.run_command("convert", self.example("scan.db"), "-o", "frames")
        scan = graspmap.open_scan(self.example("scan.db"))
        node = int(scan.nodes[0])
        frame = scan.frame(node)
        depth = next((self.folder / "frames/depth").glob(f"{node:06}.png"))
        # Whole millimeters.
        np.testing.assert_allclose(1000 * frame.depth, 65535 * imread(depth), atol=0.51)
        color = next((self.folder / "frames/color").glob(f"{node:06}.*"))
        self.assertEqual(frame.color.shape, imread(color).shape)
        self.assertEqual(frame.cameras[0].width, frame.color.shape[1])
        self.assertIsNone(scan.frame(node, depth=False).depth)

    def test_wrong_parameters_of_a_scan(self):
        scan = graspmap.open_scan(self.example("scan.db"))
        for function, names in [
                (graspmap.refine, ("known_lengths", "board", "options", "progress", "threads")),
                (graspmap.fuse, ("poses", "options", "progress", "threads"))]:
            for name in names:
                with self.subTest(function.__name__, parameter=name):
                    with self.assertRaises(graspmap.Error) as raised:
                        function(scan, **{name: object()})
                    self.assertEqual(raised.exception.field, name)
        node = {"node": int(scan.nodes[0])}
        for method, given, name in [(scan.frame, {}, "node"), (scan.frame, node, "color"),
                                    (scan.frame, node, "depth"), (scan.poses, {}, "source")]:
            with self.assertRaises(graspmap.Error) as raised:
                method(**given | {name: object()})
            self.assertEqual(raised.exception.field, name)
        for method, given, name in [(scan.frame, {"nodes": 1}, "nodes"), (scan.frame, {}, "node"),
                                    (scan.poses, {"sources": "auto"}, "sources")]:
            with self.assertRaises(graspmap.Error) as raised:
                method(**given)
            self.assertEqual(raised.exception.field, name)

    def test_surface(self):
        made = graspmap.mesh(graspmap.read_cloud(self.example("cloud.ply")))
        self.assert_same_bytes(self.example("mesh.ply"), graspmap.write_mesh, made.mesh)

    def test_samples(self):
        made = graspmap.resample(graspmap.read_mesh(self.example("site.ply")))
        self.assert_same_bytes(self.example("terrain.pcd"), graspmap.write_cloud, made.cloud)

    def test_map(self):
        terrain = graspmap.read_cloud(self.example("terrain.pcd"))
        scored = graspmap.score(terrain, scenario="artificial_rocks_prescan")
        self.assert_same_bytes(self.example("map.pcd"), graspmap.write_cloud, scored.map)
        manifest = graspmap.read_manifest(self.example("map.pcd"))
        self.assertEqual(scored.graspable_voxels, manifest["results"]["graspable_voxels"])
        self.assertEqual(scored.up_source, manifest["results"]["up_source"])
        matrix = np.reshape(manifest["transforms"]["terrain_from_input"], (3, 4))
        np.testing.assert_array_equal(scored.terrain_from_input[:3], matrix)
        self.assertIsNone(scored.zero_plane_m)
        self.assertEqual(manifest["parameters"]["zero_plane_m"], "auto")
        self.assertIsNone(graspmap.score(terrain, voxel_size_m=0.05).zero_plane_m)

    def test_lookup(self):
        self.copied("map.pcd")
        points = read_points(self.example("site/field_points.csv"))
        shutil.copy(self.example("site/field_points.csv"), self.folder / "points.csv")
        self.run_command("lookup", "map.pcd", "points.csv", "--points-frame", "terrain", "--mode",
                         "mean", "-o", "lookup.csv")
        found = graspmap.lookup(graspmap.read_cloud(self.folder / "map.pcd"), points, mode="mean")
        columns = read_csv(self.folder / "lookup.csv")
        np.testing.assert_array_equal(found.found, np.array(columns["found"], float) == 1)
        np.testing.assert_array_equal(np.float32(found.distance_m),
                                      np.float32(columns["distance_m"]))
        for name, values in found.values.items():
            texts = columns[f"map_{name}"] if f"map_{name}" in columns else columns[name]
            np.testing.assert_array_equal(np.float32(values),
                                          np.float32([text or "nan" for text in texts]), name)

    def test_footholds_and_picture(self):
        self.copied("map.pcd")
        self.run_command("footholds", "map.pcd", "--separation", 0.3, "-o", "footholds.ply")
        map_ = graspmap.read_cloud(self.folder / "map.pcd")
        best = graspmap.footholds(map_, separation_m=0.3)
        self.assert_same_bytes(self.folder / "footholds.ply", graspmap.write_cloud, best.cloud)
        self.run_command("render", "map.pcd", "--width", 400, "--height", 300, "-o", "map.png")
        load_n = graspmap.read_manifest(self.folder / "map.pcd")["parameters"]["load_n"]
        image = graspmap.render(map_, width_px=400, height_px=300, load_n=load_n)
        self.assertEqual(image.shape, (300, 400, 3))
        self.assertEqual(graspmap.to_png(image), (self.folder / "map.png").read_bytes())

    def test_field_test_and_evaluation(self):
        self.copied("site.ply")
        points = read_points(self.example("lookup.csv"))[:6]
        mesh = graspmap.read_mesh(self.example("site/mesh.ply"))
        np.savetxt(self.folder / "points.csv", points, "%.17g", ",", header="x,y,z", comments="")
        self.run_command("grasp", self.example("site/mesh.ply"), "--points", "points.csv", "--trials",
                         4, "--draws", 4, "-o", "grasps.csv")
        tested = graspmap.grasp(mesh, points, trials=4, draws=4)
        written = read_csv(self.folder / "grasps.csv")
        self.assertTrue(tested.columns)
        for name, cells in tested.columns.items():
            self.assertEqual(cells, written[name])
        np.testing.assert_array_equal(np.float32(tested.hold_probability),
                                      np.float32(tested.columns["hold_probability"]))
        table = {"graspable": tested.columns["graspable"][:], "score": np.arange(6) / 8}
        table["graspable"][:2] = ["0", "1"]
        with open(self.folder / "table.csv", "w", encoding="utf-8") as file:
            csv.writer(file).writerows([table, *zip(*table.values())])
        self.run_command("evaluate", "table.csv", "-o", "evaluation")
        evaluated = graspmap.evaluate(table)
        self.assertEqual(evaluated.summary_json,
                         (self.folder / "evaluation/summary.json").read_text(encoding="utf-8"))
        self.assertEqual(evaluated.summary, json.loads(evaluated.summary_json))
        for name in ("roc", "rates", "accuracy"):
            self.assertEqual(getattr(evaluated, name), read_csv(self.folder / f"evaluation/{name}.csv"))


if __name__ == "__main__":
    support.main()
