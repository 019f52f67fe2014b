#!/usr/bin/python3
"""Writes _options.pyi, the types of each stage's options, from the tables of the libraries.

option_types.py FOLDER: that of _core, in which the file is written.
"""

import importlib.util
import pathlib
import sys

HEAD = '''"""The options of each stage, as its keyword arguments. Made by option_types.py."""

from typing import Literal, TypedDict
'''


def load_core(folder):
    """The extension module alone: the package is not needed for its tables."""
    file = next(folder.glob("_core.*.so"))
    spec = importlib.util.spec_from_file_location("_core", file)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def type_of(option):
    """Python's type of one option."""
    if option["choices"]:
        return f"Literal[{', '.join(repr(choice) for choice in option['choices'])}]"
    return option["type"]


def main():
    folder = pathlib.Path(sys.argv[1])
    core = load_core(folder)
    text = HEAD
    for stage in core.stages():
        name = "".join(word.capitalize() for word in stage.split("_"))
        text += f"\n\nclass {name}Options(TypedDict, total=False):\n"
        for option in core.options(stage):
            text += f"    {option['key']}: {type_of(option)}\n"
            description = option["description"].replace("\\", "\\\\").replace('"', "'")
            text += f'    """{description} [{option["default"]}]"""\n'
    (folder / "_options.pyi").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
