"""Results of the stages: objects, in addition to the numbers and texts that the libraries describe."""

import dataclasses
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from . import _fields
from ._core import Cloud, Mesh, Poses


class Result:
    """Result of a stage with named fields.

    Examples
    --------
    >>> square = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]]
    >>> sampled = graspmap.resample(square, radius_m=0.5)
    >>> sampled.as_dict()["area_m2"] == sampled.area_m2
    True
    """

    def as_dict(self) -> dict[str, Any]:
        """Fields by name.

        Returns
        -------
        dict
            {name: value}; arrays are not copied.
        """
        return {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}

    def __repr__(self) -> str:
        def short(value: Any) -> str:
            if isinstance(value, np.ndarray):
                return f"array of shape {value.shape}"
            if isinstance(value, (Cloud, Poses)):
                return f"{type(value).__name__} of {len(value)}"
            text = repr(value)
            return text if len(text) <= 60 else text[:60] + "..."

        lines = [f"  {name} = {short(value)}" for name, value in self.as_dict().items()]
        return type(self).__name__ + "(\n" + ",\n".join(lines) + ")"


@dataclasses.dataclass(frozen=True, repr=False)
class RefineResult(_fields.RefineFields, Result):
    """Refined poses and a report of each stage, from `refine`.

    Attributes
    ----------
    poses : Poses
        Refined poses.
    nodes_without_pose : list of int
        Ids of the nodes that are not connected to the largest component of the pose graph.
    nodes_without_links : list of int
        Ids of the nodes without links in the pose graph, whose poses are therefore not refined.
    skipped : list of (int, str)
        Nodes whose images could not be used, each with the reason.
    stages : list of dict
        Entry of each stage: name, rejected (True if its poses were not used), seconds, figures (dict of
        metrics); held_out_matches and held_out_surfaces (costs before and after the stage of
        observations that it does not use); if the scan has true poses, trajectory_rmse_m and
        trajectory_rotation_error_deg.
    findings : list of str
        Findings about the sensor, such as calibration errors, one sentence each.
    warnings : list of str
        Warnings of the refinement.
    """

    poses: Poses
    nodes_without_pose: list[int]
    nodes_without_links: list[int]
    skipped: list[tuple[int, str]]
    stages: list[dict[str, Any]]
    findings: list[str]
    warnings: list[str]


@dataclasses.dataclass(frozen=True, repr=False)
class FuseResult(_fields.FuseFields, Result):
    """Cloud of all frames of a scan, from `fuse`.

    Attributes
    ----------
    cloud : Cloud
        Points in the world frame of the poses, m, with unit normals towards the cameras, colors if a
        frame has them, and the fields views and expected_error (one standard deviation along the
        normal, m).
    poses : Poses
        Poses with which the frames were fused, after registration.
    skipped : list of (int, str)
        Nodes whose images could not be used, each with the reason.
    timings_s : dict of float
        Time of each step, s.
    """

    cloud: Cloud
    poses: Poses
    skipped: list[tuple[int, str]]
    timings_s: dict[str, float]


@dataclasses.dataclass(frozen=True, repr=False)
class NormalsResult(Result):
    """Cloud with normals, from `estimate_normals`.

    Attributes
    ----------
    cloud : Cloud
        The cloud with N unit normals; an undefined normal is zero.
    undefined : int
        Number of normals that are zero.
    oriented_by : str
        Criterion that determined to which side of the surface the normals point.
    """

    cloud: Cloud
    undefined: int
    oriented_by: str


@dataclasses.dataclass(frozen=True, repr=False)
class MeshResult(_fields.MeshFields, Result):
    """Clean surface, from `mesh`.

    Attributes
    ----------
    mesh : Mesh
        Surface with vertex normals and the face field filled: 1 on triangles that close holes.
    holes_filled : int
        Number of filled holes; equals filled_holes.
    timings_s : dict of float
        Time of each step, s.
    """

    mesh: Mesh
    holes_filled: int
    timings_s: dict[str, float]


@dataclasses.dataclass(frozen=True, repr=False)
class ResampleResult(_fields.ResampleFields, Result):
    """Poisson-disk samples of a surface, from `resample`.

    Attributes
    ----------
    cloud : Cloud
        Samples with the normals, colors and fields of the surface.
    count_reached : bool
        False if a number of samples was requested and not reached.
    timings_s : dict of float
        Time of each step, s.
    """

    cloud: Cloud
    count_reached: bool
    timings_s: dict[str, float]


@dataclasses.dataclass(frozen=True, repr=False)
class ScoreResult(_fields.ScoreFields, Result):
    """Graspability map, from `score`.

    Attributes
    ----------
    map : Cloud
        A point at the center of each scored voxel, m, in the frame `frame`, with the fields score
        (0 to 1), graspable, border, i, j, k and others (FORMATS.md).
    frame : {'terrain', 'input'}
        Frame of the map's points.
    terrain_from_input : array, shape (4, 4), float64
        Rigid transform from the frame of the input to the terrain frame, m.
    zero_plane_m : float or None
        Minimum z of graspable voxels in the terrain frame, m; None: no minimum.
    voxel_size_m : float
        Side of the voxels, m.
    obstacle_voxels : int
        Number of voxels that are obstacles or unreachable; 0 if obstacles are not evaluated.
    timings_s : dict of float
        Time of each step, s.
    """

    map: Cloud
    frame: Literal["terrain", "input"]
    terrain_from_input: NDArray[np.float64]
    zero_plane_m: float | None
    voxel_size_m: float
    obstacle_voxels: int
    timings_s: dict[str, float]


@dataclasses.dataclass(frozen=True, repr=False)
class GraspResult(Result):
    """Simulated grasps at N locations, from `grasp`.

    Attributes
    ----------
    holds : array, shape (N,), bool
        True if hold_probability >= 0.5.
    hold_probability : array, shape (N,), float64
        Share of the trials that hold the load.
    hold_low, hold_high : array, shape (N,), float64
        Limits of Wilson's 95 % interval of the probability.
    force_n : array, shape (N, 3), float64
        Quantiles 0.1, 0.5 and 0.9 over the trials of the holding force in the weakest direction, N.
    force_range_n : array, shape (N, 2), float64
        Quantiles 0.05 and 0.95 of the same force, N.
    trial_spread : array, shape (N,), float64
        Standard deviation of ln(force) between trials of one parameter set.
    parameter_spread : array, shape (N,), float64
        Standard deviation of ln(force) between parameter sets.
    best_force_n : array, shape (N, 3), float64
        As force_n, but with the best distribution of the load over the spines, N.
    unseen : array, shape (N,), float64
        Mean fraction of the ground below the fingers that is unmeasured or too inaccurate.
    trials : array, shape (N,), int64
        Number of trials.
    directions : list of str
        Names of the 17 directions of the pulls.
    pull_limits_n : array, shape (N, 17), float64, or None
        Pull that 90 % of the trials hold in each of `directions`, N; None without `pull_limits`.
    columns : dict of list of str
        Result columns of the table that `graspmap grasp` writes: texts of the N cells by name.
    """

    holds: NDArray[np.bool_]
    hold_probability: NDArray[np.float64]
    hold_low: NDArray[np.float64]
    hold_high: NDArray[np.float64]
    force_n: NDArray[np.float64]
    force_range_n: NDArray[np.float64]
    trial_spread: NDArray[np.float64]
    parameter_spread: NDArray[np.float64]
    best_force_n: NDArray[np.float64]
    unseen: NDArray[np.float64]
    trials: NDArray[np.int64]
    directions: list[str]
    pull_limits_n: NDArray[np.float64] | None
    columns: dict[str, list[str]]


@dataclasses.dataclass(frozen=True, repr=False)
class LookupResult(Result):
    """Values of a map at N points, from `lookup`.

    Attributes
    ----------
    found : array, shape (N,), bool
        True if the map has a value at the point.
    distance_m : array, shape (N,), float64
        Distance to the nearest map point, m, even if found is False.
    map_point : array, shape (N,), int64
        Index of the map point with the values; of the nearest one if the values are means or not found.
    values : dict of array, shape (N,), float64
        Values of each field by name; NaN where found is False.
    """

    found: NDArray[np.bool_]
    distance_m: NDArray[np.float64]
    map_point: NDArray[np.int64]
    values: dict[str, NDArray[np.float64]]


@dataclasses.dataclass(frozen=True, repr=False)
class FootholdsResult(_fields.FootholdsFields, Result):
    """K best locations of a map, best first, from `footholds`.

    Attributes
    ----------
    cloud : Cloud
        Locations with normals, the fields of the map, and the fields approach_x, approach_y, approach_z
        (unit vector of the gripper's motion), slope_deg, k1, k2 (principal curvatures, 1/m), mean_score
        and graspable_points (of the neighborhood).
    map_point : array, shape (K,), int64
        Index of each location in the map.
    """

    cloud: Cloud
    map_point: NDArray[np.int64]


@dataclasses.dataclass(frozen=True, repr=False)
class EvaluateResult(Result):
    """Evaluation of scores against labels, from `evaluate`.

    Attributes
    ----------
    areas : dict of float or None
        Area under the ROC curve of each score column, by trapezoids; None unless both labels occur.
    summary : dict
        Content of summary.json of the command.
    summary_json : str
        Text of summary.json of the command.
    roc, rates, accuracy : dict of list of str
        Tables roc.csv, rates.csv and accuracy.csv of the command, by column.
    """

    areas: dict[str, float | None]
    summary: dict[str, Any]
    summary_json: str
    roc: dict[str, list[str]]
    rates: dict[str, list[str]]
    accuracy: dict[str, list[str]]
