"""Code shared by the tests of the Python module: its location, and commands as a reference.

Each test program is called with the build folder and, where it asks for one, the folder of the
manual's example, which holds a scan and what the commands made of it.
"""

import pathlib
import subprocess
import sys
import tempfile

BUILD = pathlib.Path(sys.argv[1]).resolve()
EXAMPLE = pathlib.Path(sys.argv[2]).resolve() if len(sys.argv) > 2 else None
SOURCE = pathlib.Path(__file__).resolve().parent.parent.parent
sys.path.insert(0, str(BUILD / "python"))


def graspmap_command(*words, folder):
    """Runs a command of graspmap in the folder."""
    return subprocess.run([str(BUILD / "graspmap"), *map(str, words)], cwd=folder, check=True,
                          stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def scratch_folder(case):
    """A folder that is removed after the unittest case."""
    folder = tempfile.TemporaryDirectory()
    case.addCleanup(folder.cleanup)
    return pathlib.Path(folder.name)


def main():
    import unittest
    unittest.main(argv=sys.argv[:1] + sys.argv[3:], verbosity=2)
