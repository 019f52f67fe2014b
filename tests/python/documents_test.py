#!/usr/bin/python3
"""The page of the Python module, its script and the examples of its docstrings run as they are; the
docstrings and the stubs name what there is.

documents_test.py BUILD_FOLDER EXAMPLE_FOLDER
"""

import ast
import dataclasses
import doctest
import inspect
import os
import re
import shutil
import subprocess
import sys
import unittest

import support

sys.path.insert(0, str(support.SOURCE / "tests/docs"))

import graspmap
import numpy as np
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
        self.assertEqual(len(shown), 6)
        for code, output in shown:
            program = "\n".join(line for _, line in code.lines)
            with self.subTest(program.splitlines()[0]):
                self.assertEqual(self.run_python("-c", program).splitlines(),
                                 [line for _, line in output.lines])

    def test_script_draws_its_map(self):
        self.run_python(str(PYTHON / "examples/scan_to_map.py"), "scan.db", "map.png", "0.03")
        self.assertGreater((self.folder / "map.png").stat().st_size, 10_000)


def sections(documentation):
    """{title: lines} of a docstring by the numpydoc standard; the text before them is ""."""
    found = {"": []}
    title = ""
    lines = inspect.cleandoc(documentation).splitlines()
    if re.match(r"\w+\(self: .*\) -> ", lines[0]):  # pybind11's signature of a method
        del lines[:2]
    for line, following in zip(lines, lines[1:] + [""]):
        if line and following == "-" * len(line):
            title = line
            assert title not in found, title
            found[title] = []
        elif not (title and line == "-" * len(title)):
            found[title].append(line)
    return found


def entries(lines, indent=0):
    """{name: type} of the entries "name : type" of a section, each with a description below."""
    found = {}
    for line, following in zip(lines, lines[1:]):
        match = re.fullmatch(r" {%d}(\*{0,2}\w[\w, *]*?)(?: : (\S.*))?" % indent, line)
        if match:
            assert re.match(r" {%d}\S" % (indent + 4), following), line
            found.update(dict.fromkeys(match[1].split(", "), match[2]))
    return found


def documented():
    """Yields each object of the interface with its name; methods too, but no properties."""
    for name in graspmap.__all__:
        value = getattr(graspmap, name)
        yield name, value
        for member, method in vars(value).items() if isinstance(value, type) else ():
            if not member.startswith("_") and callable(method):
                yield f"{name}.{member}", getattr(value, member)


class Docstrings(unittest.TestCase):
    ORDER = ["", "Parameters", "Attributes", "Returns", "Other Parameters", "Raises", "Examples"]

    def setUp(self):
        self.folder = support.scratch_folder(self)
        for name in ("scan.db", "scan.db.json"):
            shutil.copy(support.EXAMPLE / name, self.folder)
        self.addCleanup(os.chdir, os.getcwd())
        os.chdir(self.folder)

    def test_examples(self):
        """Each function and each class has one, or is the class of a result of a function."""
        parser = doctest.DocTestParser()
        runner = doctest.DocTestRunner(verbose=False)
        for name, value in documented():
            test = parser.get_doctest(inspect.getdoc(value), {"graspmap": graspmap, "np": np}, name,
                                      None, None)
            is_exempt = name.endswith("Result") and name != "Result" or name == "Result.as_dict"
            self.assertEqual(not test.examples, is_exempt, name)
            with self.subTest(name):
                report = []
                self.assertEqual(runner.run(test, out=report.append).failed, 0, "".join(report))

    def test_sections(self):
        for name, value in documented():
            with self.subTest(name):
                found = sections(inspect.getdoc(value))
                self.assertTrue(found[""][0].endswith("."), "the first line is a sentence")
                self.assertEqual(list(found), [one for one in self.ORDER if one in found])
                if not isinstance(value, type) and name != "Result.as_dict":
                    self.assertIn("Raises", found)
                    self.assertIn("Error", entries(found["Raises"]))

    def test_parameters(self):
        """Parameters of the signature, in its order, with their types."""
        for name, value in documented():
            if not inspect.isfunction(value) or name == "Result.as_dict":
                continue
            with self.subTest(name):
                found = sections(inspect.getdoc(value))
                parameters = inspect.signature(value).parameters
                names = [f"**{one}" if one == "values" else one for one in parameters]
                described = entries(found["Parameters"])
                self.assertEqual(list(described), names)
                self.assertTrue(all(kind for one, kind in described.items() if one[0] != "*"))
                for one in ("points", "up", "markers", "camera_position", "terrain_from_scene"):
                    self.assertIn("shape (", described.get(one, "shape ("))
                returns = inspect.signature(value).return_annotation
                self.assertEqual("Returns" in found, returns != "None")

    def test_parameters_of_classes(self):
        """Parameters of the stub's constructors and methods."""
        tree = ast.parse((PYTHON / "graspmap/_core.pyi").read_text(encoding="utf-8"))
        count = 0
        for kind in (node for node in tree.body if isinstance(node, ast.ClassDef)):
            for method in (node for node in kind.body if isinstance(node, ast.FunctionDef)):
                names = [one.arg for one in method.args.args[1:]]
                if not names or method.name == "__getitem__":
                    continue
                value = getattr(graspmap, kind.name)
                if method.name != "__init__":
                    value = getattr(value, method.name)
                found = sections(value.__doc__)
                self.assertEqual(list(entries(found["Parameters"])), names, method.name)
                count += 1
        self.assertEqual(count, 6)

    def test_options_and_results(self):
        """Options are Other Parameters; fields of results are attributes and are returned."""
        for stage in _core.stages():
            function = getattr(graspmap, stage)
            found = sections(function.__doc__)
            others = entries(found["Other Parameters"])
            self.assertEqual(list(others), [one["key"] for one in graspmap.options(stage)], stage)
            for option in graspmap.options(stage):
                self.assertIn("default ", others[option["key"]])
                for choice in option["choices"]:
                    self.assertIn(repr(choice), others[option["key"]])
            result = getattr(graspmap, inspect.signature(function).return_annotation, None)
            if not (isinstance(result, type) and issubclass(result, graspmap.Result)):
                continue
            self.assertEqual(found["Returns"][0], result.__name__)
            fields = {field.name for field in dataclasses.fields(result)}
            attributes = entries(sections(result.__doc__)["Attributes"])
            self.assertEqual(set(attributes), fields, stage)
            self.assertEqual(entries(found["Returns"], indent=4), attributes, stage)

    def test_names(self):
        """Names of the module are those of its interface."""
        self.assertEqual(dir(graspmap), sorted(graspmap.__all__))
        public = {name for name in vars(graspmap) if not name.startswith("_")}
        self.assertEqual(public, set(graspmap.__all__))
        self.assertEqual({getattr(graspmap, name).__module__ for name in public}, {"graspmap"})


class Stubs(unittest.TestCase):
    def test_core(self):
        tree = ast.parse((PYTHON / "graspmap/_core.pyi").read_text(encoding="utf-8"))
        functions = {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}
        classes = {node.name: {entry.name for entry in node.body
                               if isinstance(entry, ast.FunctionDef)}
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

    def test_docstrings_of_classes_are_those_of_the_stub(self):
        tree = ast.parse((PYTHON / "graspmap/_core.pyi").read_text(encoding="utf-8"))
        for kind in (node for node in tree.body if isinstance(node, ast.ClassDef)):
            value = getattr(graspmap, kind.name)
            self.assertEqual(inspect.getdoc(value), ast.get_docstring(kind))
            for member in kind.body:
                if isinstance(member, ast.FunctionDef) and member.name != "__init__":
                    text = inspect.getdoc(vars(value)[member.name])
                    self.assertTrue(text.endswith(ast.get_docstring(member)), member.name)


if __name__ == "__main__":
    support.main()
