"""Graspability maps for robots that climb with spined grippers, on NumPy arrays.

Each function is a stage of the command line of the same name, with the same options by the same
names, units and bounds: as keyword arguments (``voxel_size_m=0.01``), or in a dict `options`, in which
a dict is a section as in YAML (``{"gripper": {"opening_angle_deg": 80}}``). Keyword arguments are
stronger. ``options("score")`` lists them.

Lengths are meters. Where a cloud is expected, an array (N, 3) of positions is accepted; where a mesh
is expected, a pair of vertices (V, 3) and triangles (T, 3). An argument of a wrong type, shape or
value, an unknown and a missing one is an `Error` whose `field` names it.

Arrays of clouds, meshes, frames and poses are read-only views of their memory and keep it alive.
Results do not depend on the number of threads, and are those of the command line to the bit.

Long calls let other Python threads run. They take `threads` (0: all processors) and
``progress(stage, done, total)``, which is called at most ten times a second, from any thread; an
exception that it raises ends the call.

Examples in docstrings assume ``import graspmap`` and ``import numpy as np``; their scan.db is that of
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
