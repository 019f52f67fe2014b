"""What the stages return: objects, and the numbers and texts that the libraries describe."""

import dataclasses
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from . import _fields
from ._core import Cloud, Mesh, Poses


class Result:
    """Named fields; `as_dict()` gives them as a dict."""

    def as_dict(self) -> dict[str, Any]:
        """{name of the field: value}; arrays are not copied."""
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
    """Refined poses and how they were found."""

    poses: Poses
    nodes_without_pose: list[int]
    nodes_without_links: list[int]
    skipped: list[tuple[int, str]]  # node and reason
    # Of each stage: name, rejected, seconds, figures; held_out_matches and held_out_surfaces
    # (before, after); trajectory_rmse_m and trajectory_rotation_error_deg of a scan with true poses.
    stages: list[dict[str, Any]]
    findings: list[str]  # about the sensor
    warnings: list[str]


@dataclasses.dataclass(frozen=True, repr=False)
class FuseResult(_fields.FuseFields, Result):
    """One cloud of all frames."""

    # World frame of the poses, m; unit normals towards the cameras; colors if a frame has them;
    # fields `views` and `expected_error` (m, one standard deviation along the normal).
    cloud: Cloud
    poses: Poses  # that the frames were fused by
    skipped: list[tuple[int, str]]  # node and reason
    timings_s: dict[str, float]


@dataclasses.dataclass(frozen=True, repr=False)
class NormalsResult(Result):
    """A cloud with normals."""

    cloud: Cloud
    undefined: int  # normals that are zero
    oriented_by: Literal["view_fields", "viewpoint", "spanning_tree"] | str


@dataclasses.dataclass(frozen=True, repr=False)
class MeshResult(_fields.MeshFields, Result):
    """A clean surface."""

    mesh: Mesh  # vertex normals; face field `filled`: 1 on triangles that close holes
    holes_filled: int  # as filled_holes
    timings_s: dict[str, float]


@dataclasses.dataclass(frozen=True, repr=False)
class ResampleResult(_fields.ResampleFields, Result):
    """Poisson-disk samples."""

    cloud: Cloud
    count_reached: bool
    timings_s: dict[str, float]


@dataclasses.dataclass(frozen=True, repr=False)
class ScoreResult(_fields.ScoreFields, Result):
    """A graspability map."""

    # A point for each voxel, at its center, with the fields score (0..1), graspable, border, i, j, k
    # and others (FORMATS.md); in the frame `frame`.
    map: Cloud
    frame: Literal["terrain", "input"]
    terrain_from_input: NDArray[np.float64]  # 4 x 4
    zero_plane_m: float | None  # None: no zero plane
    voxel_size_m: float
    obstacle_voxels: int
    timings_s: dict[str, float]


@dataclasses.dataclass(frozen=True, repr=False)
class GraspResult(Result):
    """The virtual field test of N locations."""

    holds: NDArray[np.bool_]  # (N,): hold_probability >= 0.5
    hold_probability: NDArray[np.float64]  # (N,)
    hold_low: NDArray[np.float64]  # (N,): Wilson's interval of 95 %
    hold_high: NDArray[np.float64]
    force_n: NDArray[np.float64]  # (N, 3): quantiles 0.1, 0.5, 0.9 of the trials, N
    force_range_n: NDArray[np.float64]  # (N, 2): quantiles 0.05 and 0.95, N
    # (N,): standard deviations of ln(force), between trials of one parameter set and between sets
    trial_spread: NDArray[np.float64]
    parameter_spread: NDArray[np.float64]
    best_force_n: NDArray[np.float64]  # (N, 3): the same with the best sharing of the load
    unseen: NDArray[np.float64]  # (N,): share of unseen ground under the fingers
    trials: NDArray[np.int64]  # (N,)
    directions: list[str]  # of the pulls
    pull_limits_n: NDArray[np.float64] | None  # (N, 17): what nine of ten trials hold, N
    columns: dict[str, list[str]]  # as `graspmap grasp` writes them


@dataclasses.dataclass(frozen=True, repr=False)
class LookupResult(Result):
    """The map at N points."""

    found: NDArray[np.bool_]  # (N,)
    distance_m: NDArray[np.float64]  # (N,): to the nearest map point, found or not
    map_point: NDArray[np.int64]  # (N,): index of the map point that the values are of
    values: dict[str, NDArray[np.float64]]  # (N,) of each field; NaN where nothing was found


@dataclasses.dataclass(frozen=True, repr=False)
class FootholdsResult(_fields.FootholdsFields, Result):
    """The best places of a map, best first."""

    # With normals, and the fields approach_x, approach_y, approach_z, slope_deg, k1, k2 (1/m),
    # mean_score, graspable_points beside the map's own.
    cloud: Cloud
    map_point: NDArray[np.int64]  # index of each in the map


@dataclasses.dataclass(frozen=True, repr=False)
class EvaluateResult(Result):
    """ROC evaluation of columns of scores."""

    areas: dict[str, float | None]  # under the curve, by trapezoids; None without both classes
    summary: dict[str, Any]
    summary_json: str  # summary.json of the command
    roc: dict[str, list[str]]  # roc.csv, rates.csv and accuracy.csv of the command
    rates: dict[str, list[str]]
    accuracy: dict[str, list[str]]


for _name, _value in list(globals().items()):
    if isinstance(_value, type) and issubclass(_value, Result):
        _value.__module__ = "graspmap"
