#!/usr/bin/python3
"""Clouds, meshes and poses as arrays; options, errors, progress and threads of the Python module.

arrays_test.py BUILD_FOLDER
"""

import gc
import inspect
import pathlib
import pickle
import threading
import time
import unittest

import support

import graspmap
import numpy as np


def plain(count=61, spacing_m=0.01):
    """A level grid of points with a round hill, z up, with normals."""
    x, y = np.meshgrid(np.arange(count) * spacing_m, np.arange(count) * spacing_m)
    middle = 0.5 * count * spacing_m
    z = 0.05 * np.exp(-((x - middle)**2 + (y - middle)**2) / 0.005)
    positions = np.stack([x, y, z], axis=-1).reshape(-1, 3)
    return graspmap.Cloud(positions, normals=np.tile([0, 0, 1], (len(positions), 1)))


def square(side_m=0.3):
    """Two level triangles."""
    return graspmap.Mesh([[0, 0, 0], [side_m, 0, 0], [side_m, side_m, 0], [0, side_m, 0]],
                         [[0, 1, 2], [0, 2, 3]])


class Arrays(unittest.TestCase):
    def test_cloud_keeps_what_it_is_given(self):
        positions = np.array([[0, 1, 2], [3, 4, 5.5]])
        colors = np.array([[1, 2, 3], [4, 5, 6]], np.uint8)
        cloud = graspmap.Cloud(positions, normals=np.float32([[0, 0, 1], [1, 0, 0]]), colors=colors,
                               fields={"score": np.float32([0.5, np.nan]), "i": np.int32([7, -8])})
        np.testing.assert_array_equal(cloud.positions, positions)
        np.testing.assert_array_equal(cloud.normals, [[0, 0, 1], [1, 0, 0]])
        np.testing.assert_array_equal(cloud.colors, colors)
        np.testing.assert_array_equal(cloud.fields["score"], [0.5, np.nan])
        np.testing.assert_array_equal(cloud.fields["i"], [7, -8])
        self.assertEqual(cloud.field_types, {"score": "float32", "i": "int32"})
        self.assertIsNone(graspmap.Cloud(positions).normals)
        self.assertEqual(len(graspmap.Cloud(np.zeros((0, 3)))), 0)

    def test_views_share_memory_and_outlive_their_owner(self):
        cloud = plain()
        first, second = cloud.positions, cloud.positions
        self.assertTrue(np.shares_memory(first, second))
        self.assertFalse(first.flags.owndata)
        expected = first.copy()
        del cloud, second
        gc.collect()
        plain()
        np.testing.assert_array_equal(first, expected)
        with self.assertRaises(ValueError):
            first[0, 0] = 1.0

    def test_arrays_of_any_layout(self):
        wide = np.arange(24, dtype=np.float32).reshape(4, 6)
        cloud = graspmap.Cloud(wide[::2, ::2])
        np.testing.assert_array_equal(cloud.positions, wide[::2, ::2])
        cloud = graspmap.Cloud(np.asfortranarray(wide[:, :3]))
        np.testing.assert_array_equal(cloud.positions, wide[:, :3])

    def test_selection(self):
        cloud = plain()
        high = cloud.positions[:, 2] > 0.01
        np.testing.assert_array_equal(cloud[high].positions, cloud.positions[high])
        np.testing.assert_array_equal(cloud[[3, -1]].positions, cloud.positions[[3, -1]])
        np.testing.assert_array_equal(cloud[5:50:7].positions, cloud.positions[5:50:7])
        with self.assertRaises(IndexError):
            cloud[[len(cloud)]]
        with self.assertRaises(graspmap.Error) as raised:
            cloud[high[1:]]
        self.assertEqual((raised.exception.field, raised.exception.bound), ("index", str(len(cloud))))

    def test_transform(self):
        turn = np.array([[0, -1, 0, 1], [1, 0, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1.0]])
        cloud = plain().transformed(turn)
        expected = plain().positions @ turn[:3, :3].T + turn[:3, 3]
        np.testing.assert_allclose(cloud.positions, expected, atol=1e-12)

    def test_poses(self):
        matrices = np.tile(np.eye(4), (3, 1, 1))
        matrices[:, 0, 3] = [1, 2, 3]
        matrices[1, :3, :3] = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]
        poses = graspmap.Poses([4, 5, 9], matrices, stamps_s=[0.5, 1.5, 2.5])
        np.testing.assert_array_equal(poses.nodes, [4, 5, 9])
        np.testing.assert_array_equal(poses.stamps_s, [0.5, 1.5, 2.5])
        np.testing.assert_array_equal(poses.world_from_base, matrices)
        file = support.scratch_folder(self) / "poses.tum"
        graspmap.write_poses(file, poses, nodes=True)
        again = graspmap.read_poses(file)
        np.testing.assert_array_equal(again.nodes, poses.nodes)
        np.testing.assert_allclose(again.world_from_base, matrices, atol=1e-9)

    def test_files(self):
        folder = support.scratch_folder(self)
        cloud = plain()
        graspmap.write_cloud(folder / "cloud.pcd", cloud)
        again = graspmap.read_cloud(str(folder / "cloud.pcd"))
        np.testing.assert_allclose(again.positions, cloud.positions, atol=1e-6)
        graspmap.write_mesh(folder / "mesh.ply", square())
        mesh = graspmap.read_mesh(folder / "mesh.ply")
        np.testing.assert_array_equal(mesh.triangles, [[0, 1, 2], [0, 2, 3]])
        self.assertAlmostEqual(mesh.area_m2, 0.09, places=6)
        self.assertEqual(sorted(path.name for path in folder.iterdir()), ["cloud.pcd", "mesh.ply"])

    def test_an_output_of_a_command_is_not_overwritten(self):
        folder = support.scratch_folder(self)
        graspmap.write_mesh(folder / "mesh.ply", square())
        support.graspmap_command("resample", "mesh.ply", "-o", "cloud.ply", folder=folder)
        self.assertEqual(graspmap.read_manifest(folder / "cloud.ply")["command"], "resample")
        self.assertIsNone(graspmap.read_manifest(folder / "mesh.ply"))
        with self.assertRaises(graspmap.Error) as raised:
            graspmap.write_cloud(folder / "cloud.ply", plain())
        self.assertEqual((raised.exception.file, raised.exception.kind),
                         (str(folder / "cloud.ply.json"), "bad_input"))


class Errors(unittest.TestCase):
    def error(self, function, *arguments, **values):
        with self.assertRaises(graspmap.Error) as raised:
            function(*arguments, **values)
        return raised.exception

    def test_wrong_arrays(self):
        for given, value in [(np.zeros((3, 4)), "(3, 4)"), (np.zeros(3), "(3,)"),
                             (np.zeros((2, 3), complex), "complex128"),
                             (np.array([["a", "b", "c"]]), "<U1")]:
            error = self.error(graspmap.Cloud, given)
            self.assertEqual(error.field, "positions")
            self.assertIn(value, error.value)
            self.assertIn("(N, 3)", error.bound)
        error = self.error(graspmap.Cloud, [[0, 0, 0], [0, np.nan, 0]])
        self.assertEqual(error.field, "positions, row 1")
        points = np.zeros((2, 3))
        self.assertEqual(self.error(graspmap.Cloud, points, colors=[[0.5, 0, 0]] * 2).field, "colors")
        error = self.error(graspmap.Cloud, points, fields={"score": ["a", "b"]})
        self.assertEqual(error.field, "field score")
        error = self.error(graspmap.Cloud, points, normals=np.zeros((3, 3)))
        self.assertEqual((error.field, error.value), ("normals", "3 values long"))
        self.assertEqual(self.error(graspmap.Mesh, points, [[0, 1, -1]]).field, "triangles")
        error = self.error(graspmap.Mesh, points, [[0, 1, 2]])
        self.assertEqual((error.field, error.value, error.bound), ("vertex of triangle 0", "2", "< 2"))
        self.assertEqual(self.error(plain().transformed, 2 * np.eye(4)).field, "target_from_source")
        error = self.error(graspmap.Poses, [1, 2], np.eye(4)[None])
        self.assertEqual(error.field, "world_from_base")
        self.assertEqual(self.error(graspmap.to_png, np.zeros((3, 3), np.uint8)).field, "image")

    def test_options_are_checked_as_on_the_command_line(self):
        error = self.error(graspmap.resample, square(), radius_m=-1.0)
        self.assertEqual((error.field, error.value, error.bound, error.kind),
                         ("radius_m", "-1", "> 0", "bad_input"))
        error = self.error(graspmap.resample, square(), radus_m=1.0)
        self.assertEqual(error.field, "radus_m")
        self.assertIn("radius_m", error.reason)
        self.assertEqual(self.error(graspmap.resample, square(), radius_m=[1]).field, "radius_m")
        error = self.error(graspmap.score, plain(), method="none")
        self.assertEqual((error.field, error.value), ("method", "none"))
        self.assertEqual(self.error(graspmap.score, plain(), gripper="ropebot").value, "ropebot")
        self.assertEqual(
            self.error(graspmap.score, plain(), options={"gripper": {"opening_angle_deg": 500}}).field,
            "opening_angle_deg")
        self.assertEqual(self.error(graspmap.options, "scores").field, "stage")
        self.assertEqual(self.error(graspmap.resample, square(), threads=5000).field, "threads")

    def test_files_that_are_none(self):
        error = self.error(graspmap.read_cloud, "none.pcd")
        self.assertEqual((error.file, error.kind), ("none.pcd", "bad_input"))
        for function, name in [(graspmap.read_mesh, "none.ply"), (graspmap.open_scan, "none.db")]:
            error = self.error(function, name)
            self.assertEqual((error.file, error.field, error.kind), (name, "", "bad_input"))
        error = self.error(graspmap.write_cloud, "cloud.txt", plain())
        self.assertEqual((error.file, error.field, error.value, error.bound),
                         ("cloud.txt", "extension", ".txt", ".pcd, .ply, .csv or .vtp"))
        error = self.error(graspmap.write_cloud, "no/such/folder/cloud.pcd", plain())
        self.assertEqual((error.file, error.kind), ("no/such/folder/cloud.pcd", "bad_input"))
        self.assertIn("no/such/folder", error.reason)

    def test_an_error_can_be_pickled(self):
        error = pickle.loads(pickle.dumps(self.error(graspmap.read_cloud, "none.pcd")))
        self.assertEqual(error.file, "none.pcd")

    def test_wrong_data(self):
        empty = graspmap.Cloud(np.zeros((0, 3)))
        for function, arguments, about in [
                (graspmap.score, [empty], "points"),
                (graspmap.lookup, [empty, [[0, 0, 0]]], "points"),
                (graspmap.mesh, [graspmap.Cloud(plain().positions)], "normals")]:
            error = self.error(function, *arguments)
            self.assertIn(about, error.field)
            self.assertEqual(error.kind, "bad_input")
        error = self.error(graspmap.grasp, square(), [[9, 9, 9]])
        self.assertEqual((error.field, error.value), ("location 1", "9,9,9"))
        error = self.error(graspmap.grasp, square(), [[0.1, 0.1, 0]], surface_error="much")
        self.assertEqual((error.field, error.value), ("surface_error", "'much'"))
        error = self.error(graspmap.evaluate, {"graspable": [1, 0], "score": [0.5]})
        self.assertEqual((error.field, error.value, error.bound), ("column score", "1", "2"))
        table = {"graspable": [1, 0], "score": [0.5, 0.1]}
        self.assertEqual(self.error(graspmap.evaluate, table, label="verdict").field,
                         "column 'verdict'")
        error = self.error(graspmap.render, plain(), markers=[[0, 0, 0]], labels=["a", "b"])
        self.assertEqual((error.field, error.value, error.bound), ("labels", "2", "1"))


def table_of_labels():
    return {"graspable": [1, 0, 1, 0], "score": [0.9, 0.1, 0.4, 0.6]}


def poses():
    return graspmap.Poses([1], [np.eye(4)])


class Arguments(unittest.TestCase):
    """Arguments of other types and shapes than the documented ones."""

    # Values of the parameters without default.
    GIVEN = {"stage": "score", "path": "none", "scan": None, "poses": poses(), "cloud": plain(9),
             "mesh": square(), "terrain": plain(9), "points": [[0.15, 0.15, 0]], "map": plain(9),
             "table": table_of_labels(), "shown": plain(9), "image": np.zeros((2, 2, 3), np.uint8),
             "positions": np.zeros((1, 3)), "vertices": np.zeros((3, 3)), "triangles": [[0, 1, 2]],
             "nodes": [1], "world_from_base": [np.eye(4)], "target_from_source": np.eye(4),
             "index": [0]}

    def functions(self):
        for name in graspmap.__all__:
            value = getattr(graspmap, name)
            if inspect.isfunction(value):
                parameters = inspect.signature(value).parameters
                yield value, {one: parameter.default for one, parameter in parameters.items()
                              if parameter.kind != parameter.VAR_KEYWORD}
        required = inspect.Parameter.empty
        yield graspmap.Cloud, {"positions": required, "normals": None, "colors": None, "fields": {},
                               "viewpoint": None}
        yield graspmap.Mesh, {"vertices": required, "triangles": required, "vertex_normals": None,
                              "vertex_colors": None, "vertex_fields": {}, "face_fields": {}}
        yield graspmap.Poses, {"nodes": required, "world_from_base": required, "stamps_s": None}
        yield plain(9).transformed, {"target_from_source": required}
        yield plain(9).__getitem__, {"index": required}

    def test_each_parameter_is_named(self):
        """Arguments before it are right, or absent where that needs a scan."""
        count = 0
        for function, parameters in self.functions():
            given = {name: self.GIVEN[name] for name, default in parameters.items()
                     if default is inspect.Parameter.empty}
            if "scan" in given:  # its own error comes first
                parameters = {"scan": None}
            for name in parameters:
                for wrong in (object(), graspmap.read_cloud):
                    if name == "progress" and callable(wrong):
                        continue
                    with self.subTest(function=function.__name__, parameter=name):
                        with self.assertRaises(graspmap.Error) as raised:
                            function(**given | {name: wrong})
                        self.assertEqual((raised.exception.field, raised.exception.kind),
                                         (name, "bad_input"))
                        self.assertIn(type(wrong).__name__, raised.exception.value)
                        self.assertTrue(raised.exception.bound)
                        count += 1
        self.assertGreater(count, 150)

    def test_unknown_parameters_are_named(self):
        """Also one that replaces a required one; the parameters of the function are the bound."""
        for function, parameters in self.functions():
            given = {name: self.GIVEN[name] for name, default in parameters.items()
                     if default is inspect.Parameter.empty}
            if inspect.isfunction(function) and "values" in inspect.signature(function).parameters:
                continue  # an unknown option, which the stage names
            for arguments in (given, {}):
                with self.subTest(function=function.__name__, arguments=list(arguments)):
                    with self.assertRaises(graspmap.Error) as raised:
                        function(**arguments | {"nonsense": 1})
                    error = raised.exception
                    self.assertEqual((error.field, error.kind), ("nonsense", "bad_input"))
                    self.assertEqual(error.bound, " ".join(["one of", *parameters]))
        self.assertEqual(self.field_of_error(graspmap.Cloud, position=np.zeros((1, 3))), "position")
        self.assertEqual(self.field_of_error(graspmap.score, plain(9), voxel_sise_m=1),
                         "voxel_sise_m")

    def test_missing_arguments_are_named(self):
        count = 0
        for function, parameters in self.functions():
            given = {name: self.GIVEN[name] for name, default in parameters.items()
                     if default is inspect.Parameter.empty}
            for name in given:
                with self.subTest(function=function.__name__, parameter=name):
                    others = {one: value for one, value in given.items() if one != name}
                    self.assertEqual(self.field_of_error(function, **others), name)
                    count += 1
        self.assertGreater(count, 30)

    def field_of_error(self, function, *arguments, **values):
        with self.assertRaises(graspmap.Error) as raised:
            function(*arguments, **values)
        return raised.exception.field

    def test_wrong_shapes_and_types(self):
        ragged = [[0, 0, 0], [1, 1]]
        for wrong in (np.zeros((4, 2)), np.zeros((3, 3, 3)), np.zeros(3), [], ragged, "terrain.pcd",
                      5, None, {}, square(), np.zeros((2, 3), bool), np.zeros((2, 3), complex)):
            for function, name in [(graspmap.score, "terrain"), (graspmap.mesh, "cloud"),
                                   (graspmap.estimate_normals, "cloud"), (graspmap.footholds, "map")]:
                self.assertEqual(self.field_of_error(function, wrong), name)
        self.assertEqual(self.field_of_error(graspmap.score, [[0, 0, 0], [0, np.nan, 0]]),
                         "terrain, row 1")
        vertices, triangles = square().vertices, square().triangles
        for wrong, field in [(vertices, "mesh"), ((vertices,), "mesh"), (plain(9), "mesh"),
                             ((vertices, triangles, triangles), "mesh"), ((vertices, 5), "mesh"),
                             ((vertices[:, :2], triangles), "mesh: vertices"),
                             ((vertices, triangles[:, :2]), "mesh: triangles"),
                             ((vertices, triangles + 0.5), "mesh: triangles"),
                             ((vertices, [[0, 1, -1]]), "mesh: triangles"),
                             ((vertices, [[0, 1, 2], [0, 1, 4]]), "mesh: vertex of triangle 1"),
                             ((vertices + np.inf, triangles), "mesh: vertices, row 0")]:
            self.assertEqual(self.field_of_error(graspmap.resample, wrong), field)
        self.assertEqual(self.field_of_error(graspmap.grasp, square(), [[0, 0, 0]],
                                             more_loads_n=[5, "6"]), "more_loads_n, item 1")
        self.assertEqual(self.field_of_error(graspmap.render, plain(9), labels="ab",
                                             markers=[[0, 0, 0]] * 2), "labels")
        for threads in (-1, 1.5, "2"):
            self.assertEqual(self.field_of_error(graspmap.score, plain(9), threads=threads), "threads")
        self.assertEqual(self.field_of_error(graspmap.evaluate, table_of_labels() | {"score": [1]}),
                         "column score")
        for wrong in (5, "abcd", None, np.zeros((4, 1))):
            with self.assertRaises(graspmap.Error) as raised:
                graspmap.evaluate({"score": wrong, "graspable": [1]})
            self.assertEqual(raised.exception.field, "column score")
            self.assertEqual(raised.exception.bound, "values of shape (N,)")

    def test_array_as_cloud(self):
        cloud = graspmap.Cloud(plain(21).positions)
        for array in (cloud.positions, cloud.positions.tolist(), np.asfortranarray(cloud.positions)):
            for function in (graspmap.score, graspmap.estimate_normals):
                by_array, by_cloud = function(array), function(cloud)
                name = "map" if function is graspmap.score else "cloud"
                made, expected = getattr(by_array, name), getattr(by_cloud, name)
                np.testing.assert_array_equal(made.positions, expected.positions)
                for field, values in expected.fields.items():
                    np.testing.assert_array_equal(made.fields[field], values)
        whole = graspmap.lookup(np.int32([[0, 0, 0], [5, 0, 0]]), np.float32([[4.99, 0, 0]]))
        self.assertEqual(whole.map_point[0], 1)
        folder = support.scratch_folder(self)
        graspmap.write_cloud(folder / "array.ply", cloud.positions)
        graspmap.write_cloud(folder / "cloud.ply", cloud)
        self.assertEqual((folder / "array.ply").read_bytes(), (folder / "cloud.ply").read_bytes())
        size = {"width_px": 32, "height_px": 32}
        np.testing.assert_array_equal(graspmap.render(cloud.positions, **size),
                                      graspmap.render(cloud, **size))
        two = [[0, 0, 0], [1, 1, 0]]  # two points, not vertices and triangles
        np.testing.assert_array_equal(graspmap.render(two, **size),
                                      graspmap.render(graspmap.Cloud(two), **size))

    def test_vertices_and_triangles_as_mesh(self):
        mesh = square(0.5)
        for pair in ((mesh.vertices, mesh.triangles), [mesh.vertices.tolist(), mesh.triangles.tolist()],
                     (np.float32(mesh.vertices), np.int64(mesh.triangles))):
            made, expected = (graspmap.resample(one, radius_m=0.05) for one in (pair, mesh))
            np.testing.assert_array_equal(made.cloud.positions, expected.cloud.positions)
        pair = mesh.vertices, mesh.triangles
        made, expected = (graspmap.grasp(one, [[0.15, 0.15, 0]], trials=2, draws=2)
                          for one in (pair, mesh))
        self.assertEqual(made.columns, expected.columns)
        folder = support.scratch_folder(self)
        graspmap.write_mesh(folder / "pair.ply", pair)
        graspmap.write_mesh(folder / "mesh.ply", mesh)
        self.assertEqual((folder / "pair.ply").read_bytes(), (folder / "mesh.ply").read_bytes())
        size = {"width_px": 32, "height_px": 32}
        np.testing.assert_array_equal(graspmap.render(pair, **size), graspmap.render(mesh, **size))

    def test_other_accepted_types(self):
        """Types that are not the documented ones, but are converted without loss."""
        folder = support.scratch_folder(self)
        graspmap.write_cloud(str(folder / "cloud.ply"), plain(9))
        self.assertEqual(len(graspmap.read_cloud(pathlib.PurePosixPath(folder / "cloud.ply"))), 81)
        spot = np.array([[0.15, 0.15, 0]])
        made = [graspmap.grasp(square(), spot, trials=2, draws=2, more_loads_n=loads, threads=threads,
                               sequential=sequential).columns
                for loads, threads, sequential in [([5.0], 1, False), ((5,), np.int64(1), np.False_),
                                                   (np.array([5]), np.uint8(1), 0),
                                                   (iter([5.0]), 1, False)]]
        self.assertEqual(made[0], made[1])
        self.assertEqual(made[0], made[2])
        self.assertEqual(made[0], made[3])
        self.assertEqual(len(plain(9)[[]]), 0)
        areas = graspmap.evaluate(table_of_labels(), scores=(name for name in ["score"])).areas
        self.assertEqual(areas, {"score": 0.75})


class Options(unittest.TestCase):
    def test_keywords_and_dicts_set_the_same(self):
        by_keyword = graspmap.resample(square(), radius_m=0.02, seed=7)
        by_dict = graspmap.resample(square(), options={"radius_m": 0.02, "seed": np.int64(7)})
        other = graspmap.resample(square(), options={"radius_m": 0.02, "seed": 8}, seed=9)
        np.testing.assert_array_equal(by_keyword.cloud.positions, by_dict.cloud.positions)
        self.assertEqual(by_keyword.radius_m, 0.02)
        self.assertFalse(np.array_equal(by_keyword.cloud.positions, other.cloud.positions))
        nine = graspmap.resample(square(), radius_m=0.02, seed=9)
        np.testing.assert_array_equal(other.cloud.positions, nine.cloud.positions)

    def test_are_those_of_the_commands(self):
        """Each key of a stage is one that --print-config of its command prints with this default."""
        for stage in ("refine", "fuse", "mesh", "resample", "score", "grasp", "lookup", "evaluate",
                      "footholds", "render"):
            printed = support.graspmap_command(stage, "--print-config", folder="/").stdout
            defaults = {}
            for line in printed.splitlines():
                key, _, rest = line.partition(":")
                defaults[key] = rest.partition("  #")[0].strip().strip('"')
            for option in graspmap.options(stage):
                self.assertEqual(defaults.get(option["key"]), option["default"], option["key"])

    def test_overrides_of_a_gripper(self):
        spot = [[0.15, 0.15, 0.0]]
        held = [graspmap.grasp(square(), spot, trials=2, draws=2, options={"gripper": measures})
                for measures in ({}, {"opening_angle_deg": 40})]
        self.assertEqual([result.trials[0] for result in held], [4, 4])
        self.assertNotEqual(held[0].columns, held[1].columns)
        with self.assertRaises(graspmap.Error) as raised:
            graspmap.grasp(square(), spot, options={"gripper": {"opening_angle": 40}})
        self.assertEqual(raised.exception.field, "opening_angle")


class Progress(unittest.TestCase):
    def test_is_told_and_the_result_is_the_same(self):
        calls = []
        told = graspmap.score(plain(), progress=lambda *words: calls.append(words))
        quiet = graspmap.score(plain(), threads=1)
        self.assertTrue(calls)
        for stage, done, total in calls:
            self.assertTrue(stage)
            self.assertGreaterEqual(done, 0)
            self.assertTrue(total == 0 or done <= total)
        for name, values in told.map.fields.items():
            np.testing.assert_array_equal(values, quiet.map.fields[name])

    def test_what_it_raises_ends_the_call(self):
        def interrupt(*_):
            raise KeyboardInterrupt
        with self.assertRaises(KeyboardInterrupt):
            graspmap.score(plain(), progress=interrupt)
        self.assertGreater(graspmap.score(plain()).occupied_voxels, 0)

    def test_other_threads_run_meanwhile(self):
        """A thread of Python counts while the main one is within a call."""
        counts = []
        stop = threading.Event()

        def count():
            while not stop.wait(0.001):
                counts.append(time.monotonic())

        counter = threading.Thread(target=count)
        counter.start()
        begin = time.monotonic()
        graspmap.resample(square(1.0), radius_m=0.003)
        end = time.monotonic()
        stop.set()
        counter.join()
        self.assertGreater(sum(begin < at < end for at in counts), 1)


class Results(unittest.TestCase):
    def test_named_fields_are_those_of_the_dict(self):
        result = graspmap.resample(square(), radius_m=0.05)
        self.assertEqual(set(result.as_dict()), {
            "cloud", "points", "radius_m", "area_m2", "smallest_distance_m", "relative_radius",
            "radii_tried", "count_reached", "timings_s"})
        self.assertIs(result.as_dict()["cloud"], result.cloud)
        self.assertIn("radius_m = 0.05", repr(result))

    def test_closed_forms(self):
        result = graspmap.resample(square(), radius_m=0.05)
        self.assertAlmostEqual(result.area_m2, 0.09)
        points = result.cloud.positions
        distances = np.linalg.norm(points[:, None] - points[None], axis=-1)
        self.assertGreaterEqual(distances[np.triu_indices(len(points), 1)].min(), 0.05)
        map_ = graspmap.Cloud([[0, 0, 0], [1, 0, 0]], fields={"score": [0.25, 0.75]})
        found = graspmap.lookup(map_, [[0.01, 0, 0], [0.5, 0, 0], [1, 0.02, 0]])
        np.testing.assert_array_equal(found.found, [True, False, True])
        np.testing.assert_allclose(found.distance_m, [0.01, 0.5, 0.02])
        np.testing.assert_array_equal(found.map_point[[0, 2]], [0, 1])
        np.testing.assert_array_equal(found.values["score"], [0.25, np.nan, 0.75])
        table = {"graspable": [True, False, 1, 0], "score": np.array([0.9, 0.1, 0.4, 0.6])}
        self.assertEqual(graspmap.evaluate(table).areas, {"score": 0.75})
        table["score"][3] = np.nan
        self.assertEqual(graspmap.evaluate(table, bootstrap=0).areas, {"score": 1.0})

    def test_a_map_of_a_plane_and_its_footholds(self):
        scored = graspmap.score(plain(), plane="none", method="corrected", threads=1)
        np.testing.assert_array_equal(scored.terrain_from_input, np.eye(4))
        self.assertEqual(scored.voxel_size_m, 0.01)
        self.assertIsNone(scored.plane_rmse_m)
        voxels = np.stack([scored.map.fields[axis] for axis in "ijk"], axis=-1)
        centers = np.array(scored.lattice_origin_m) + 0.01 * (voxels + 0.5)
        np.testing.assert_allclose(scored.map.positions, centers, atol=1e-9)
        best = graspmap.footholds(scored.map, graspable_only=False, border=True, separation_m=0.2)
        np.testing.assert_array_equal(best.cloud.positions, scored.map.positions[best.map_point])
        scores = scored.map.fields["score"]
        self.assertEqual(best.cloud.fields["score"][0], scores.max())

    def test_normals_of_a_plane(self):
        made = graspmap.estimate_normals(graspmap.Cloud(plain(20).positions * [1, 1, 0]))
        np.testing.assert_allclose(np.abs(made.cloud.normals[:, 2]), 1.0, atol=1e-6)
        self.assertEqual(made.undefined, 0)


if __name__ == "__main__":
    support.main()
