"""Graspability maps for robots that climb with spined grippers, on NumPy arrays.

Each function is a stage of the command line of the same name, with the same options by the same
names, units and bounds: as keyword arguments (`voxel_size_m=0.01`), or in a dict `options`, in which
a dict is a section as in YAML ({"gripper": {"opening_angle_deg": 80}}); keyword arguments are
stronger. `options("score")` lists them. An option that is unknown or out of its bound is an `Error`
with the fields of the command line's message.

Lengths are meters. Arrays that clouds, meshes, frames and poses show are their own memory, without a
copy, and read-only; they live as long as anyone holds them. Results do not depend on the number of
threads, and are those of the command line to the bit.

Long calls let other Python threads run. They take `threads` (0: all processors) and
`progress(stage, done, total)`, which is called at most ten times a second, from any thread; what it
raises ends the call.
"""

import json as _json
import math as _math
from os import PathLike as _PathLike
from typing import TYPE_CHECKING, Any, Callable, Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _core
from ._core import Camera, Cloud, Frame, Mesh, Poses, Scan
from ._error import Error
from ._results import (EvaluateResult, FootholdsResult, FuseResult, GraspResult, LookupResult,
                       MeshResult, NormalsResult, RefineResult, ResampleResult, Result, ScoreResult)

if TYPE_CHECKING:
    from typing import Unpack

    from . import _options

__all__ = [
    "Camera", "Cloud", "Error", "EvaluateResult", "FootholdsResult", "Frame", "FuseResult",
    "GraspResult", "LookupResult", "Mesh", "MeshResult", "NormalsResult", "Poses", "RefineResult",
    "ResampleResult", "Result", "Scan", "ScoreResult", "estimate_normals", "evaluate", "footholds",
    "fuse", "grasp", "lookup", "mesh", "open_scan", "options", "read_cloud", "read_manifest",
    "read_mesh", "read_poses", "refine", "render", "resample", "score", "to_png", "write_cloud",
    "write_mesh", "write_poses"
]

_Path = str | _PathLike[str]
_Options = Mapping[str, Any] | None
_Progress = Callable[[str, int, int], None] | None


def _merged(options: _Options, values: Mapping[str, Any]) -> dict[str, Any]:
    return {**(options or {}), **values}


def options(stage: str) -> list[dict[str, Any]]:
    """The options of a stage, for example "score": key, type, default, choices, description."""
    return _core.options(stage)


def open_scan(path: _Path, calibration: _Path | None = None) -> Scan:
    """Opens a scan: a database of RTAB-Map, or a folder in the layout of the TUM RGB-D benchmark.

    calibration: a camera as `graspmap refine --write-calibration` wrote it, instead of the stored
    one. Frames are decoded when `Scan.frame` asks for them.
    """
    return _core.open_scan(path, calibration)


def read_poses(path: _Path, scan: Scan | None = None, *, options: _Options = None,
               **values: "Unpack[_options.ReadPosesOptions]") -> Poses:
    """Poses of a file: TUM, KITTI, g2o, TORO, or a COLMAP model of `scan`.

    With a scan they are bound to its nodes as `graspmap fuse --poses FILE` binds them; without, nodes
    and stamps are those of the file, or 0.
    """
    return _core.read_poses(path, scan, _merged(options, values))


def write_poses(path: _Path, poses: Poses, *, nodes: bool = False) -> None:
    """Writes poses as .tum, .kitti, .g2o or .toro. nodes: node as a ninth column of .tum."""
    _core.write_poses(path, poses, nodes)


def read_cloud(path: _Path) -> Cloud:
    """Reads a cloud or a map (.pcd, .ply, .csv); points that are not finite are left out."""
    return _core.read_cloud(path)


def write_cloud(path: _Path, cloud: Cloud) -> None:
    """Writes a cloud or a map (.pcd, .ply, .vtp, .csv), whole or not at all, without a manifest."""
    _core.write_cloud(path, cloud)


def read_mesh(path: _Path) -> Mesh:
    """Reads a triangle mesh (.ply, .obj, .stl, .off, .glb)."""
    return _core.read_mesh(path)


def write_mesh(path: _Path, mesh: Mesh) -> None:  # pylint: disable=redefined-outer-name
    """Writes a mesh (.ply, .vtp, .obj, .stl, .off, .glb), whole or not at all, without a manifest."""
    _core.write_mesh(path, mesh)


def read_manifest(path: _Path) -> dict[str, Any] | None:
    """The manifest beside an output of a command (PATH.json); None if there is none."""
    text = _core.read_manifest(path)
    return None if text is None else _json.loads(text)


def refine(scan: Scan, *, known_lengths: Sequence[str] = (), board: str | None = None,
           options: _Options = None, progress: _Progress = None, threads: int = 0,
           **values: "Unpack[_options.RefineOptions]") -> RefineResult:
    """Refines the poses of a scan: loop closures, pose graph, bundle adjustment, depth.

    known_lengths: "NODE:X:Y-NODE:X:Y=METERS" each, as --known-length.
    board: "COLUMNSxROWS:METERS", as --board.
    """
    return RefineResult(
        **_core.refine(scan, list(known_lengths), board, _merged(options, values), progress,
                       threads))


def fuse(scan: Scan, poses: Poses | None = None, *, options: _Options = None,
         progress: _Progress = None, threads: int = 0,
         **values: "Unpack[_options.FuseOptions]") -> FuseResult:
    """Fuses the depth images of a scan into one oriented, colored cloud.

    poses: of the frames, for example `RefineResult.poses`; None: `scan.poses()`.
    """
    return FuseResult(**_core.fuse(scan, scan.poses() if poses is None else poses,
                                   _merged(options, values), progress, threads))


def estimate_normals(cloud: Cloud, *, options: _Options = None, threads: int = 0,
                     **values: "Unpack[_options.EstimateNormalsOptions]") -> NormalsResult:
    """Normals for a cloud that has none, by planes through each point's neighbors."""
    return NormalsResult(**_core.estimate_normals(cloud, _merged(options, values), threads))


def mesh(cloud: Cloud, *, options: _Options = None, progress: _Progress = None, threads: int = 0,
         **values: "Unpack[_options.MeshOptions]") -> MeshResult:
    """Reconstructs a surface from a cloud with normals and cleans it.

    `graspmap mesh` estimates missing normals; here `estimate_normals` does.
    """
    return MeshResult(**_core.mesh(cloud, _merged(options, values), progress, threads))


def resample(mesh: Mesh, *, options: _Options = None,  # pylint: disable=redefined-outer-name
             progress: _Progress = None, threads: int = 0,
             **values: "Unpack[_options.ResampleOptions]") -> ResampleResult:
    """Samples a surface evenly (Poisson disk), with normals, colors and fields."""
    return ResampleResult(**_core.resample(mesh, _merged(options, values), progress, threads))


def score(terrain: Cloud, *, scenario: str | None = None, up: ArrayLike | None = None,
          options: _Options = None, progress: _Progress = None, threads: int = 0,
          **values: "Unpack[_options.ScoreOptions]") -> ScoreResult:
    """Computes the graspability map of a terrain.

    scenario: name of a scenario or a file, as --config; options are stronger. up: direction (3,) in
    the cloud's frame that points out of the ground; None: found as by `--up auto`.
    """
    return ScoreResult(
        **_core.score(terrain, scenario, up, _merged(options, values), progress, threads))


def grasp(mesh: Mesh, points: ArrayLike, *,  # pylint: disable=redefined-outer-name
          surface_error: float | str | None = None, more_loads_n: Sequence[float] = (),
          sequential: bool = False, pull_limits: bool = False, options: _Options = None,
          progress: _Progress = None, threads: int = 0,
          **values: "Unpack[_options.GraspOptions]") -> GraspResult:
    """Tests a gripper's hold at points (N, 3) of a mesh, z up, by simulation.

    surface_error: of the mesh, m (one standard deviation), or "mesh": its field `expected_error`.
    more_loads_n: further loads with a verdict each. sequential: end a location's test when its
    verdict is clear. pull_limits: also the pull that each of 17 directions holds.
    """
    return GraspResult(**_core.grasp(mesh, points, surface_error, list(more_loads_n), sequential,
                                     pull_limits, _merged(options, values), progress, threads))


def lookup(map: Cloud, points: ArrayLike, *,  # pylint: disable=redefined-builtin
           options: _Options = None, threads: int = 0,
           **values: "Unpack[_options.LookupOptions]") -> LookupResult:
    """Looks up the values of a map at points (N, 3) in the map's frame."""
    return LookupResult(**_core.lookup(map, points, _merged(options, values), threads))


def footholds(map: Cloud, *,  # pylint: disable=redefined-builtin
              up: ArrayLike = (0.0, 0.0, 1.0), options: _Options = None, threads: int = 0,
              **values: "Unpack[_options.FootholdsOptions]") -> FootholdsResult:
    """The best places of a map, best first, none nearer to another than `separation_m`.

    up: outside of the ground in the map's frame; of a map in the terrain frame (0, 0, 1).
    """
    return FootholdsResult(**_core.footholds(map, up, _merged(options, values), threads))


def _cell(value: Any) -> str:
    if value is None or (isinstance(value, (float, np.floating)) and _math.isnan(value)):
        return ""
    if isinstance(value, (bool, np.bool_)):
        return "1" if value else "0"
    return str(value)


def evaluate(table: Mapping[str, Sequence[Any]], *, scores: Sequence[str] = (),
             options: _Options = None, threads: int = 0,
             **values: "Unpack[_options.EvaluateOptions]") -> EvaluateResult:
    """Evaluates columns of scores against the labels in a table: ROC, areas, rates.

    table: columns by name, of one length: lists, arrays, or a data frame of pandas. None, NaN and ""
    are left out. scores: columns to evaluate; none: all that hold scores, as by the command.
    """
    columns = [(str(name), [_cell(value) for value in table[name]]) for name in table]
    found = _core.evaluate(columns, list(scores), _merged(options, values), threads)
    return EvaluateResult(summary=_json.loads(found["summary_json"]), **found)


def render(shown: Cloud | Mesh, *, markers: ArrayLike | None = None, labels: Sequence[str] = (),
           zero_plane_m: float | None = None, terrain_from_scene: ArrayLike | None = None,
           camera_position: ArrayLike | None = None, camera_target: ArrayLike | None = None,
           options: _Options = None,
           **values: "Unpack[_options.RenderOptions]") -> NDArray[np.uint8]:
    """Draws a cloud, a mesh or a map, without a screen: an array (height, width, 3) of uint8.

    markers: places (N, 3) to mark in the frame of what is shown, with their labels. zero_plane_m:
    ground below it is white (`ScoreResult.zero_plane_m`). terrain_from_scene: 4 x 4, for what is not
    in the terrain frame. camera_position, camera_target: with view="camera".
    """
    return _core.render(shown, markers, list(labels), zero_plane_m, terrain_from_scene,
                        camera_position, camera_target, _merged(options, values))


def to_png(image: NDArray[np.uint8]) -> bytes:
    """The bytes of a PNG file of a picture (height, width, 3)."""
    return _core.to_png(image)
