#!/usr/bin/python3
"""The page of the Python module and its script run as they are, and its stubs name what there is.

documents_test.py BUILD_FOLDER EXAMPLE_FOLDER
"""

import ast
import dataclasses
import inspect
import os
import shutil
import subprocess
import sys
import unittest

import support

sys.path.insert(0, str(support.SOURCE / "tests/docs"))

import graspmap
from documents import Document
from graspmap import _core

PYTHON = support.SOURCE / "tools/python"


class Documents(unittest.TestCase):
    def setUp(self):
        self.folder = support.scratch_folder(self)
        for name in ("scan.db", "poses.tum", "terrain.pcd"):
            shutil.copy(support.EXAMPLE / name, self.folder)
        shutil.copytree(support.EXAMPLE / "site", self.folder / "site")

    def run_python(self, *words):
        environment = dict(os.environ, PYTHONPATH=str(support.BUILD / "python"), MPLBACKEND="Agg",
                           PYTHONDONTWRITEBYTECODE="1", MPLCONFIGDIR=str(self.folder))
        return subprocess.run([sys.executable, *words], cwd=self.folder, env=environment, check=True,
                              stdout=subprocess.PIPE, text=True).stdout

    def test_examples_print_what_the_page_shows(self):
        blocks = Document(PYTHON / "README.md").blocks
        shown = [(code, output) for code, output in zip(blocks, blocks[1:])
                 if code.language == "python" and output.language == "text"]
        self.assertEqual(len(shown), 5)
        for code, output in shown:
            program = "\n".join(line for _, line in code.lines)
            with self.subTest(program.splitlines()[0]):
                self.assertEqual(self.run_python("-c", program).splitlines(),
                                 [line for _, line in output.lines])

    def test_script_draws_its_map(self):
        self.run_python(str(PYTHON / "examples/scan_to_map.py"), "scan.db", "map.png", "0.03")
        self.assertGreater((self.folder / "map.png").stat().st_size, 10_000)


class Stubs(unittest.TestCase):
    def test_core(self):
        tree = ast.parse((PYTHON / "graspmap/_core.pyi").read_text(encoding="utf-8"))
        functions = {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}
        classes = {node.name: {entry.name for entry in node.body}
                   for node in tree.body if isinstance(node, ast.ClassDef)}
        there = {name: value for name, value in vars(_core).items() if not name.startswith("__")}
        self.assertEqual(functions | set(classes), set(there))
        for name, members in classes.items():
            public = {member for member in vars(there[name]) if not member.startswith("_")}
            self.assertEqual({member for member in members if not member.startswith("_")}, public)

    def test_options(self):
        text = (support.BUILD / "python/graspmap/_options.pyi").read_text(encoding="utf-8")
        classes = {node.name: [entry.target.id for entry in node.body
                               if isinstance(entry, ast.AnnAssign)]
                   for node in ast.parse(text).body if isinstance(node, ast.ClassDef)}
        stages = _core.stages()
        self.assertEqual(len(classes), len(stages))
        for stage in stages:
            name = "".join(word.capitalize() for word in stage.split("_")) + "Options"
            self.assertEqual(classes[name], [option["key"] for option in graspmap.options(stage)])
            annotation = inspect.signature(getattr(graspmap, stage)).parameters["values"].annotation
            self.assertIn(f"_options.{name}", annotation)

    def test_results(self):
        for stage in _core.stages():
            described = {one["key"]: one for one in _core.results(stage)}
            if not described:
                continue
            name = "Normals" if stage == "estimate_normals" else stage.capitalize()
            fields = {field.name: field for field in
                      dataclasses.fields(getattr(graspmap, name + "Result"))}
            self.assertLessEqual(set(described), set(fields), stage)
            for key, one in described.items():
                self.assertTrue(one["description"], key)
                kind = fields[key].type
                self.assertEqual(kind.__name__ if isinstance(kind, type) else str(kind),
                                 one["type"], key)

    def test_all_is_documented(self):
        for name in graspmap.__all__:
            value = getattr(graspmap, name)
            self.assertTrue(inspect.getdoc(value), name)
        for kind in (graspmap.Cloud, graspmap.Mesh, graspmap.Frame, graspmap.Poses):
            for name, member in vars(kind).items():
                if isinstance(member, property) and name not in ("node", "stamp_s", "cameras",
                                                                 "area_m2"):
                    self.assertTrue(member.__doc__, f"{kind.__name__}.{name}")


if __name__ == "__main__":
    support.main()
