"""Graspability maps for robots that climb with spined grippers, on NumPy arrays.

Each function is a stage of the command with the same name, and has the same options with the same
names, units and bounds: as keyword arguments (``voxel_size_m=0.01``), or in a dict `options`, in which
a dict is a section as in YAML (``{"gripper": {"opening_angle_deg": 80}}``). Keyword arguments take
precedence. ``options("score")`` lists the options of `score`.

Lengths are in meters. A cloud may be given as an array (N, 3) of positions, a mesh as a pair of
vertices (V, 3) and triangles (T, 3). An argument that is unknown, missing, or of a wrong type, shape
or value raises an `Error` whose `field` names the argument.

Arrays of clouds, meshes, frames and poses are read-only views of their memory and keep it alive.
Results do not depend on the number of threads, and are identical to those of the command line.

Long calls let other Python threads run. Their parameters are `threads` (0: all processors) and
``progress(stage, done, total)``, a function that is called at most ten times a second, from any
thread. If it raises an exception, the call ends with this exception.

Examples in docstrings assume ``import graspmap`` and ``import numpy as np``. The file scan.db is from
the manual.
"""

from inspect import isfunction as _isfunction

from . import _arguments, _documentation, _files, _results, _stages
from ._core import Camera, Cloud, Frame, Mesh, Poses, Scan
from ._error import Error
from ._files import (open_scan, read_cloud, read_manifest, read_mesh, read_poses, write_cloud,
                     write_mesh, write_poses)
from ._results import (EvaluateResult, FootholdsResult, FuseResult, GraspResult, LookupResult,
                       MeshResult, NormalsResult, RefineResult, ResampleResult, Result, ScoreResult)
from ._stages import (estimate_normals, evaluate, footholds, fuse, grasp, lookup, mesh, options,
                      refine, render, resample, score, to_png)

__all__ = [
    "Camera", "Cloud", "Error", "EvaluateResult", "FootholdsResult", "Frame", "FuseResult",
    "GraspResult", "LookupResult", "Mesh", "MeshResult", "NormalsResult", "Poses", "RefineResult",
    "ResampleResult", "Result", "Scan", "ScoreResult", "estimate_normals", "evaluate", "footholds",
    "fuse", "grasp", "lookup", "mesh", "open_scan", "options", "read_cloud", "read_manifest",
    "read_mesh", "read_poses", "refine", "render", "resample", "score", "to_png", "write_cloud",
    "write_mesh", "write_poses"
]


def __dir__() -> list[str]:
    return sorted(__all__)


_documentation.complete(_files, _stages, _results)
for _name in __all__:
    if _isfunction(globals()[_name]):
        globals()[_name] = _arguments.checked(globals()[_name])
    globals()[_name].__module__ = __name__
