#!/usr/bin/python3
"""Writes the docstrings of the classes in _core.pyi as C++ constants, from which the extension module
takes them.

class_documentation.py STUB HEADER
"""

import ast
import pathlib
import sys

HEAD = """// Docstrings of the classes of _core.pyi. Made by class_documentation.py.
#pragma once

namespace graspmap_python::documentation {
"""


def docstrings(tree):
    """Yields a name such as cloud or cloud_positions and its docstring."""
    for node in tree.body:
        if not isinstance(node, ast.ClassDef):
            continue
        name = node.name.lower()
        yield name, ast.get_docstring(node)
        for member in node.body:
            if isinstance(member, ast.FunctionDef) and member.name != "__init__":
                yield f"{name}_{member.name.strip('_')}", ast.get_docstring(member)


def main():
    stub, header = map(pathlib.Path, sys.argv[1:])
    text = HEAD
    for name, documentation in docstrings(ast.parse(stub.read_text(encoding="utf-8"))):
        if not documentation:
            sys.exit(f"{stub}: {name} has no docstring")
        text += f'inline constexpr const char* {name} = R"numpydoc({documentation}\n)numpydoc";\n'
    text += "}  // namespace graspmap_python::documentation\n"
    if not header.exists() or header.read_text(encoding="utf-8") != text:
        header.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
