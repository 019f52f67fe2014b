"""Stages of the commands on arrays."""

from __future__ import annotations

import json
import math
from typing import TYPE_CHECKING, Any, Callable, Iterable, Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _core
from ._core import Poses, Scan
from ._files import CloudLike, MeshLike, Options, merged
from ._results import (EvaluateResult, FootholdsResult, FuseResult, GraspResult, LookupResult,
                       MeshResult, NormalsResult, RefineResult, ResampleResult, ScoreResult)

if TYPE_CHECKING:
    from typing import Unpack

    from . import _options

_Progress = Callable[[str, int, int], None] | None


def options(stage: str) -> list[dict[str, Any]]:
    """Lists the options of a stage.

    Parameters
    ----------
    stage : str
        Name of the stage's function, for example "score".

    Returns
    -------
    list of dict
        Entry of each option: key, type, default, choices, description.

    Raises
    ------
    Error
        If no function with this name takes options.

    Examples
    --------
    >>> [option["key"] for option in graspmap.options("resample")]
    ['radius_m', 'count', 'seed']
    """
    return _core.options(stage)


def refine(scan: Scan, *, known_lengths: Sequence[str] = (), board: str | None = None,
           options: Options = None, progress: _Progress = None, threads: int = 0,
           **values: Unpack[_options.RefineOptions]) -> RefineResult:
    """Refines the poses of a scan: loop closures, pose graph, bundle adjustment, depth.

    Parameters
    ----------
    scan : Scan
        Scan with images, depth and cameras.
    known_lengths : sequence of str
        Measured distances between two points, each given by the node id and a pixel of the node's
        image: "NODE:X:Y-NODE:X:Y=METERS", as --known-length.
    board : str, optional
        Static chessboard in the scene: numbers of inner corners and side of a square,
        "COLUMNSxROWS:METERS", as --board.
    options : mapping, optional
        Options by name; keyword arguments take precedence.
    progress : callable, optional
        Function of (stage, done, total).
    threads : int
        Number of threads; 0: all processors.
    **values
        Options, see Other Parameters.

    Returns
    -------
    RefineResult
        Refined poses and a report of each stage:

    Raises
    ------
    Error
        If an argument is wrong or the scan cannot be used.

    Examples
    --------
    >>> scan = graspmap.open_scan("scan.db")
    >>> refined = graspmap.refine(scan, rounds=0, bundle=False, icp="off", max_features=50)
    >>> len(refined.poses), refined.stages[0]["name"]
    (24, 'start: odometry')
    """
    return RefineResult(
        **_core.refine(scan, known_lengths, board, merged(options, values), progress, threads))


def fuse(scan: Scan, poses: Poses | None = None, *, options: Options = None,
         progress: _Progress = None, threads: int = 0,
         **values: Unpack[_options.FuseOptions]) -> FuseResult:
    """Fuses the depth images of a scan into one cloud with normals and colors.

    Parameters
    ----------
    scan : Scan
        Scan with depth images and cameras.
    poses : Poses, optional
        Poses of the frames, for example `RefineResult.poses`. Default: ``scan.poses()``.
    options : mapping, optional
        Options by name; keyword arguments take precedence.
    progress : callable, optional
        Function of (stage, done, total).
    threads : int
        Number of threads; 0: all processors.
    **values
        Options, see Other Parameters.

    Returns
    -------
    FuseResult
        Cloud in the world frame of the poses:

    Raises
    ------
    Error
        If an argument is wrong or no frame can be used.

    Examples
    --------
    >>> scan = graspmap.open_scan("scan.db")
    >>> start = scan.poses()
    >>> two = graspmap.Poses(start.nodes[:2], start.world_from_base[:2])
    >>> fused = graspmap.fuse(scan, two, voxel_size_m=0.05, registration_rounds=0)
    >>> fused.frames, len(fused.cloud) == fused.points
    (2, True)
    """
    return FuseResult(**_core.fuse(scan, poses, merged(options, values), progress, threads))


def estimate_normals(cloud: CloudLike, *, options: Options = None, threads: int = 0,
                     **values: Unpack[_options.EstimateNormalsOptions]) -> NormalsResult:
    """Estimates the normals of a cloud by planes through each point's neighbors.

    Parameters
    ----------
    cloud : Cloud or array_like, shape (N, 3)
        Points, m; normals are ignored.
    options : mapping, optional
        Options by name; keyword arguments take precedence.
    threads : int
        Number of threads; 0: all processors.
    **values
        Options, see Other Parameters.

    Returns
    -------
    NormalsResult
        Cloud with normals:

    Raises
    ------
    Error
        If an argument is wrong or the points are too few.

    Examples
    --------
    >>> x, y = np.meshgrid(np.arange(20) * 0.01, np.arange(20) * 0.01)
    >>> plane = np.stack([x, y, 0 * x], axis=-1).reshape(-1, 3)
    >>> estimated = graspmap.estimate_normals(plane)
    >>> np.abs(estimated.cloud.normals[0]).round(6)
    array([0., 0., 1.], dtype=float32)
    """
    return NormalsResult(**_core.estimate_normals(cloud, merged(options, values), threads))


def mesh(cloud: CloudLike, *, options: Options = None, progress: _Progress = None,
         threads: int = 0, **values: Unpack[_options.MeshOptions]) -> MeshResult:
    """Reconstructs a surface from a cloud with normals and cleans it.

    The command `graspmap mesh` estimates missing normals; here, call `estimate_normals` first.

    Parameters
    ----------
    cloud : Cloud
        Points, m, with unit normals that point out of the ground.
    options : mapping, optional
        Options by name; keyword arguments take precedence.
    progress : callable, optional
        Function of (stage, done, total).
    threads : int
        Number of threads; 0: all processors.
    **values
        Options, see Other Parameters.

    Returns
    -------
    MeshResult
        Clean surface:

    Raises
    ------
    Error
        If an argument is wrong, the cloud has no normals, or no surface is found.

    Examples
    --------
    >>> x, y = np.meshgrid(np.arange(20) * 0.01, np.arange(20) * 0.01)
    >>> plane = np.stack([x, y, 0 * x], axis=-1).reshape(-1, 3)
    >>> cloud = graspmap.Cloud(plane, normals=np.tile([0, 0, 1], (400, 1)))
    >>> round(graspmap.mesh(cloud).area_m2, 6)
    0.04
    """
    return MeshResult(**_core.mesh(cloud, merged(options, values), progress, threads))


def resample(mesh: MeshLike, *, options: Options = None,  # pylint: disable=redefined-outer-name
             progress: _Progress = None, threads: int = 0,
             **values: Unpack[_options.ResampleOptions]) -> ResampleResult:
    """Samples a surface evenly (Poisson disk), with normals, colors and fields.

    Parameters
    ----------
    mesh : Mesh or pair of array_like, shapes (V, 3) and (T, 3)
        Surface: a Mesh, or vertices, m, and triangles.
    options : mapping, optional
        Options by name; keyword arguments take precedence.
    progress : callable, optional
        Function of (stage, done, total).
    threads : int
        Number of threads; 0: all processors.
    **values
        Options, see Other Parameters.

    Returns
    -------
    ResampleResult
        Samples:

    Raises
    ------
    Error
        If an argument is wrong or the surface has no area.

    Examples
    --------
    >>> vertices = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    >>> triangles = [[0, 1, 2], [0, 2, 3]]
    >>> sampled = graspmap.resample((vertices, triangles), radius_m=0.1)
    >>> bool(sampled.smallest_distance_m >= 0.1), round(sampled.area_m2, 6)
    (True, 1.0)
    """
    return ResampleResult(**_core.resample(mesh, merged(options, values), progress, threads))


def score(terrain: CloudLike, *, scenario: str | None = None, up: ArrayLike | None = None,
          options: Options = None, progress: _Progress = None, threads: int = 0,
          **values: Unpack[_options.ScoreOptions]) -> ScoreResult:
    """Computes the graspability map of a terrain.

    Parameters
    ----------
    terrain : Cloud or array_like, shape (N, 3)
        Points of the ground, m.
    scenario : str, optional
        Parameter set: a name in data/scenarios, or a file, as --config; options take precedence.
    up : array_like, shape (3,), optional
        Direction in the cloud's frame that points out of the ground. Default: as --up auto, by the
        viewpoint, the normals or the z axis.
    options : mapping, optional
        Options by name; keyword arguments take precedence.
    progress : callable, optional
        Function of (stage, done, total).
    threads : int
        Number of threads; 0: all processors.
    **values
        Options, see Other Parameters.

    Returns
    -------
    ScoreResult
        Graspability map:

    Raises
    ------
    Error
        If an argument is wrong or the terrain has too few points.

    Examples
    --------
    >>> x, y = np.meshgrid(np.arange(20) * 0.01, np.arange(20) * 0.01)
    >>> ground = np.stack([x, y, 0 * x], axis=-1).reshape(-1, 3)
    >>> scored = graspmap.score(ground, voxel_size_m=0.01)
    >>> scored.scored_voxels, scored.map.fields["score"].shape, scored.up_source
    (400, (400,), 'frame_z')
    """
    return ScoreResult(
        **_core.score(terrain, scenario, up, merged(options, values), progress, threads))


def grasp(mesh: MeshLike, points: ArrayLike, *,  # pylint: disable=redefined-outer-name
          surface_error: float | str | None = None, more_loads_n: Sequence[float] = (),
          sequential: bool = False, pull_limits: bool = False, options: Options = None,
          progress: _Progress = None, threads: int = 0,
          **values: Unpack[_options.GraspOptions]) -> GraspResult:
    """Tests a gripper's hold on a surface by simulation.

    Parameters
    ----------
    mesh : Mesh or pair of array_like, shapes (V, 3) and (T, 3)
        Surface, z up: a Mesh, or vertices, m, and triangles.
    points : array_like, shape (N, 3)
        Locations on the surface, m.
    surface_error : float or 'mesh', optional
        Standard deviation of the surface's error, m; 'mesh': the vertex field expected_error of
        `mesh`. Default: the surface is exact.
    more_loads_n : sequence of float
        Additional loads to test, N; their results are in `GraspResult.columns`.
    sequential : bool
        True to end the trials at a location as soon as it is certain whether most hold.
    pull_limits : bool
        True to compute the pull that 90 % of the trials hold, in each of 17 directions.
    options : mapping, optional
        Options by name; keyword arguments take precedence.
    progress : callable, optional
        Function of (stage, done, total).
    threads : int
        Number of threads; 0: all processors.
    **values
        Options, see Other Parameters.

    Returns
    -------
    GraspResult
        Hold probabilities and forces at the N locations:

    Raises
    ------
    Error
        If an argument is wrong or a location is not on the surface.

    Examples
    --------
    >>> vertices = [[0, 0, 0], [0.3, 0, 0], [0.3, 0.3, 0], [0, 0.3, 0]]
    >>> plate = graspmap.Mesh(vertices, [[0, 1, 2], [0, 2, 3]])
    >>> tested = graspmap.grasp(plate, [[0.15, 0.15, 0]], trials=2, draws=2)
    >>> tested.holds, tested.trials
    (array([False]), array([4]))
    """
    return GraspResult(**_core.grasp(mesh, points, surface_error, more_loads_n, sequential,
                                     pull_limits, merged(options, values), progress, threads))


def lookup(map: CloudLike, points: ArrayLike, *,  # pylint: disable=redefined-builtin
           options: Options = None, threads: int = 0,
           **values: Unpack[_options.LookupOptions]) -> LookupResult:
    """Looks up the values of a map at points.

    Parameters
    ----------
    map : Cloud or array_like, shape (M, 3)
        Map points, m, with their fields.
    points : array_like, shape (N, 3)
        Points in the map's frame, m.
    options : mapping, optional
        Options by name; keyword arguments take precedence.
    threads : int
        Number of threads; 0: all processors.
    **values
        Options, see Other Parameters.

    Returns
    -------
    LookupResult
        Values of each field at the N points:

    Raises
    ------
    Error
        If an argument is wrong or the map is empty.

    Examples
    --------
    >>> map = graspmap.Cloud([[0, 0, 0], [1, 0, 0]], fields={"score": [0.25, 0.75]})
    >>> graspmap.lookup(map, [[0.01, 0, 0], [0.5, 0, 0]]).values["score"]
    array([0.25,  nan])
    """
    return LookupResult(**_core.lookup(map, points, merged(options, values), threads))


def footholds(map: CloudLike, *,  # pylint: disable=redefined-builtin
              up: ArrayLike = (0.0, 0.0, 1.0), options: Options = None, threads: int = 0,
              **values: Unpack[_options.FootholdsOptions]) -> FootholdsResult:
    """Selects the best locations of a map, at least `separation_m` apart.

    Parameters
    ----------
    map : Cloud
        Map points, m, with the fields of `ScoreResult.map`.
    up : array_like, shape (3,)
        Direction in the map's frame that points out of the ground. Default: z, as for maps in the
        terrain frame.
    options : mapping, optional
        Options by name; keyword arguments take precedence.
    threads : int
        Number of threads; 0: all processors.
    **values
        Options, see Other Parameters.

    Returns
    -------
    FootholdsResult
        Locations, best first:

    Raises
    ------
    Error
        If an argument is wrong or the map has no scores.

    Examples
    --------
    >>> x, y = np.meshgrid(np.arange(20) * 0.01, np.arange(20) * 0.01)
    >>> ground = np.stack([x, y, 0 * x], axis=-1).reshape(-1, 3)
    >>> map = graspmap.score(ground, voxel_size_m=0.01).map
    >>> best = graspmap.footholds(map, graspable_only=False, border=True, separation_m=1)
    >>> best.candidates, len(best.cloud)
    (400, 1)
    """
    return FootholdsResult(**_core.footholds(map, up, merged(options, values), threads))


def _cell(value: Any) -> str:
    if value is None or (isinstance(value, (float, np.floating)) and math.isnan(value)):
        return ""
    if isinstance(value, (bool, np.bool_)):
        return "1" if value else "0"
    return str(value)


def _cells(column: Any) -> Any:
    """Texts of a column. Returns other types unchanged, which the extension module rejects."""
    if isinstance(column, str) or not isinstance(column, Iterable) or getattr(
            column, "ndim", 1) != 1:
        return column
    return [_cell(value) for value in column]


def evaluate(table: Mapping[str, Sequence[Any]], *, scores: Sequence[str] = (),
             options: Options = None, threads: int = 0,
             **values: Unpack[_options.EvaluateOptions]) -> EvaluateResult:
    """Evaluates columns of scores against the labels in a table: ROC curves, areas, rates.

    Parameters
    ----------
    table : mapping of array_like, shape (N,)
        Columns by name: a dict, or a data frame of pandas. None, NaN and "" are missing values.
    scores : sequence of str
        Columns to evaluate. Default: all numeric columns that are not ids, positions or lengths.
    options : mapping, optional
        Options by name; keyword arguments take precedence.
    threads : int
        Number of threads; 0: all processors.
    **values
        Options, see Other Parameters.

    Returns
    -------
    EvaluateResult
        Areas and curves of each column:

    Raises
    ------
    Error
        If an argument is wrong, or a column is missing or contains other values.

    Examples
    --------
    >>> table = {"graspable": [1, 0, 1, 0], "score": [0.9, 0.1, 0.4, 0.6]}
    >>> graspmap.evaluate(table).areas
    {'score': 0.75}
    """
    columns = table
    if hasattr(table, "keys"):
        columns = {str(name): _cells(table[name]) for name in table}
    found = _core.evaluate(columns, scores, merged(options, values), threads)
    return EvaluateResult(summary=json.loads(found["summary_json"]), **found)


def render(shown: CloudLike | MeshLike, *, markers: ArrayLike | None = None,
           labels: Sequence[str] = (), zero_plane_m: float | None = None,
           terrain_from_scene: ArrayLike | None = None, camera_position: ArrayLike | None = None,
           camera_target: ArrayLike | None = None, options: Options = None,
           **values: Unpack[_options.RenderOptions]) -> NDArray[np.uint8]:
    """Draws a cloud, a mesh or a map, without a screen.

    Parameters
    ----------
    shown : Cloud, Mesh, array_like of shape (N, 3), or pair of shapes (V, 3) and (T, 3)
        Cloud or map, m; or surface: a Mesh, or vertices, m, and triangles.
    markers : array_like, shape (M, 3), optional
        Locations to mark, in the frame of `shown`, m.
    labels : sequence of str
        Labels of the markers, one label per marker.
    zero_plane_m : float, optional
        Height in the terrain frame below which ground is white, m, e.g. `ScoreResult.zero_plane_m`.
    terrain_from_scene : array_like, shape (4, 4), optional
        Rigid transform from the frame of `shown` to the terrain frame, m. Default: identity.
    camera_position : array_like, shape (3,), optional
        Position of the camera with view="camera", m.
    camera_target : array_like, shape (3,), optional
        Point that the camera faces with view="camera", m.
    options : mapping, optional
        Options by name; keyword arguments take precedence.
    **values
        Options, see Other Parameters.

    Returns
    -------
    array, shape (height_px, width_px, 3), uint8
        Red, green and blue.

    Raises
    ------
    Error
        If an argument is wrong or there is nothing to draw.

    Examples
    --------
    >>> image = graspmap.render([[0, 0, 0], [1, 0, 0], [0, 1, 0]], width_px=64, height_px=48)
    >>> image.shape, image.dtype
    ((48, 64, 3), dtype('uint8'))
    """
    return _core.render(shown, markers, labels, zero_plane_m, terrain_from_scene, camera_position,
                        camera_target, merged(options, values))


def to_png(image: NDArray[np.uint8]) -> bytes:
    """Encodes an image as a PNG file.

    Parameters
    ----------
    image : array_like of uint8, shape (height, width, 3)
        Red, green and blue.

    Returns
    -------
    bytes
        Content of the file.

    Raises
    ------
    Error
        If the image has a wrong shape or type.

    Examples
    --------
    >>> graspmap.to_png(np.zeros((4, 6, 3), np.uint8))[1:4]
    b'PNG'
    """
    return _core.to_png(image)
