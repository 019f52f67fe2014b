#!/usr/bin/python3
"""Writes, from the tables of the libraries, the types of each stage's options to _options.pyi, for
type checkers, and the fields of its results to _fields.py.

stage_types.py FOLDER: folder that contains _core and gets the files.
"""

import importlib.util
import pathlib
import sys

OPTIONS_HEAD = '''"""The options of each stage, as its keyword arguments. Made by stage_types.py."""

from typing import Literal, TypedDict
'''

FIELDS_HEAD = '''"""The numbers and texts that each stage returns. Made by stage_types.py."""

import dataclasses
'''


def load_core(folder):
    """Returns the extension module without its package, which the tables do not need."""
    file = next(folder.glob("_core.*.so"))
    spec = importlib.util.spec_from_file_location("_core", file)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def class_name(stage):
    """Returns, for example, "ReadPoses" for "read_poses"."""
    return "".join(word.capitalize() for word in stage.split("_"))


def field(one, kind, more=""):
    """A field of a class with its documentation."""
    description = one["description"].replace("\\", "\\\\").replace('"', "'")
    return f'    {one["key"]}: {kind}\n    """{description}{more}"""\n'


def options_class(stage, options):
    """The TypedDict of a stage's options."""
    text = f"\n\nclass {class_name(stage)}Options(TypedDict, total=False):\n"
    for one in options:
        kind = one["type"]
        if one["choices"]:
            kind = f"Literal[{', '.join(repr(choice) for choice in one['choices'])}]"
        text += field(one, kind, f" [{one['default']}]")
    return text


def fields_class(stage, results):
    """The data class of a stage's results; "" if it has none."""
    if not results:
        return ""
    text = f"\n\n@dataclasses.dataclass(frozen=True, repr=False)\nclass {class_name(stage)}Fields:\n"
    return text + "".join(field(one, one["type"]) for one in results)


def main():
    folder = pathlib.Path(sys.argv[1])
    core = load_core(folder)
    options = OPTIONS_HEAD
    fields = FIELDS_HEAD
    for stage in core.stages():
        options += options_class(stage, core.options(stage))
        fields += fields_class(stage, core.results(stage))
    (folder / "_options.pyi").write_text(options, encoding="utf-8")
    (folder / "_fields.py").write_text(fields, encoding="utf-8")


if __name__ == "__main__":
    main()
