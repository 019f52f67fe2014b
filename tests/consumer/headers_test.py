#!/usr/bin/python3
"""Every installed header compiles alone, and includes nothing but the standard library, Eigen and this
project.

headers_test.py BUILD_FOLDER SOURCE_FOLDER EIGEN_INCLUDE_FOLDER COMPILER

A compiler takes up to a second for the standard library and Eigen in each header. Therefore they are
precompiled once (without Eigen for headers that do not need it, which loads faster), and each header is
compiled after them to find missing includes of this project. Missing includes of the standard library
and Eigen are found by comparing the used names of std:: and Eigen:: with the includes of the header and
of the project's headers that it includes.
"""

import pathlib
import re
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor

INCLUDE = re.compile(r'^\s*#\s*include\s*[<"]([^>"]+)[>"]', re.MULTILINE)
COMMENT_OR_TEXT = re.compile(r'//[^\n]*|/\*.*?\*/|"(?:\\.|[^"\\\n])*"', re.DOTALL)
NAME = re.compile(r"\bstd::(\w+)")
# Headers that define names of a different spelling. One of them suffices.
HEADERS = {
    "cmath": "atan2 cos floor log sin sqrt",
    "chrono": "chrono",
    "cstdio": "FILE",
    "cstdint": "int8_t int16_t int32_t int64_t uint8_t uint16_t uint32_t uint64_t",
    "cstdlib": "abs",
    "cstring": "memcpy",
    "algorithm": "clamp copy find_if lower_bound max min nth_element",
    "bit": "bit_cast",
    "exception": "exception",
    "fstream": "ofstream",
    "functional": "function less",
    "iterator": "iterator_traits",
    "limits": "numeric_limits",
    "memory": "allocator shared_ptr unique_ptr",
    "mutex": "recursive_mutex unique_lock lock_guard",
    "new": "bad_alloc",
    "numeric": "iota",
    "optional": "nullopt",
    "stdexcept": "runtime_error",
    "string": "basic_string char_traits to_string",
    "type_traits": "is_arithmetic_v is_convertible_v is_integral_v is_same_v is_trivially_copyable_v",
    "utility": "in_range",
    "variant": "monostate",
}
DEFINED_IN = {name: {header} for header, names in HEADERS.items() for name in names.split()}
# The standard allows many headers to define these names. These headers do in every library.
CONTAINERS = {"array", "deque", "list", "map", "set", "span", "string", "string_view", "vector"}
DEFINED_IN |= {name: CONTAINERS | {"cstddef", "cstring"} for name in ("size_t", "ptrdiff_t", "byte")}
DEFINED_IN |= {name: CONTAINERS | {"algorithm", "functional", "memory", "optional", "tuple", "utility",
                                   "variant"} for name in ("pair", "move", "swap")}
DEFINED_IN["ostream"] = {"ostream", "iosfwd", "fstream", "iostream", "sstream"}
DEFINED_IN["exception"] |= {"stdexcept", "new"}


def needed(name):
    return DEFINED_IN.get(name, {name})  # std::vector is in <vector>


def headers_below(header, includes):
    """Returns the header and all headers of this project that it includes, directly or indirectly."""
    below, open_ones = set(), {header}
    while open_ones:
        below |= open_ones
        open_ones = {path for one in open_ones for path in includes[one] if path in includes} - below
    return below


def included(header, includes):
    """Returns all headers that the header includes, directly or through headers of this project."""
    return {name for one in headers_below(header, includes) for name in includes[one]}


def chains(includes):
    """Divides the headers into lists, in each of which a header follows the headers it includes.

    Each list is compiled at once and finds the same faults as one compilation per header, because a header
    follows only headers that it includes.
    """
    below = {header: headers_below(header, includes) for header in includes}
    left = dict.fromkeys(sorted(includes, key=lambda header: (-len(below[header]), header)))
    while left:
        chain = [next(iter(left))]
        while True:
            del left[chain[-1]]
            following = [name for name in left if name in below[chain[-1]]]
            if not following:
                break
            chain.append(following[0])
        yield chain[::-1]


def shows_eigen(names):
    return any(name.startswith("Eigen/") for name in names)


def faults_of(header, there, code):
    """Yields names of the standard library and Eigen that the header uses without including them."""
    for name in sorted(set(NAME.findall(code))):
        if not needed(name) & there:
            yield f"{header}: std::{name} without <{'> or <'.join(sorted(needed(name)))}>"
    if "Eigen::" in code and not shows_eigen(there):
        yield f"{header}: Eigen:: without <Eigen/...>"


def main(build, source, eigen, compiler):
    faults = []
    with tempfile.TemporaryDirectory() as scratch:
        scratch = pathlib.Path(scratch)
        subprocess.run(["cmake", "--install", build, "--prefix", scratch], check=True,
                       stdout=subprocess.DEVNULL)
        root = scratch / "include" / "graspmap"
        texts = {str(path.relative_to(root)): path.read_text(encoding="utf-8")
                 for path in sorted(root.rglob("*.h"))}
        assert len(texts) >= 50, f"only {len(texts)} headers are installed"
        includes = {header: set(INCLUDE.findall(text)) for header, text in texts.items()}
        standard = set()
        for header, names in includes.items():
            for name in sorted(names - set(texts)):
                if re.fullmatch(r"[a-z_]+", name):
                    standard.add(name)
                elif not name.startswith("Eigen/"):
                    faults.append(f"{header}: shows {name}, a header of another library")
            faults += faults_of(header, included(header, includes), COMMENT_OR_TEXT.sub(" ", texts[header]))

        flags = ["-std=c++20", "-O0", "-Wall", "-Wextra", "-Werror", "-I", source, "-isystem", eigen]
        standard_only, with_eigen = scratch / "standard.h", scratch / "eigen.h"
        lines = "".join(f"#include <{name}>\n" for name in sorted(standard))
        standard_only.write_text(lines)
        with_eigen.write_text(lines + "#include <Eigen/Geometry>\n")

        def precompile(first):
            subprocess.run([compiler, *flags, "-x", "c++-header", first, "-o", f"{first}.gch"], check=True)

        def compile_chain(chain):
            unit = scratch / (chain[-1].replace("/", "_") + ".cc")
            unit.write_text("".join(f'#include "{header}"\n' for header in chain))
            first = with_eigen if shows_eigen(included(chain[-1], includes)) else standard_only
            done = subprocess.run([compiler, *flags, "-Winvalid-pch", "-include", first, "-fsyntax-only", unit],
                                  stderr=subprocess.PIPE, text=True, check=False)
            return [] if done.returncode == 0 else [f"one of {', '.join(chain)} does not compile alone:\n{done.stderr}"]

        with ThreadPoolExecutor(2) as threads:
            list(threads.map(precompile, (standard_only, with_eigen)))
            for found in threads.map(compile_chain, chains(includes)):
                faults += found
    print("\n".join(faults) or f"{len(texts)} headers compile alone")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
