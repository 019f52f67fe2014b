"""Types and documentation of the extension module. class_documentation.py passes the docstrings of
the classes to the C++ sources, which use them at run time."""

from os import PathLike
from typing import Any, Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

class Cloud:
    """Cloud of points; a map is a cloud of its voxels.

    A cloud is immutable; its arrays are read-only views of its memory. ``cloud[index]`` returns a new
    cloud of the points at a slice, N truth values or K indices.

    Parameters
    ----------
    positions : array_like, shape (N, 3)
        Positions, m: finite numbers.
    normals : array_like, shape (N, 3), optional
        Unit normals, stored as float32. A normal that is zero or NaN is unknown.
    colors : array_like of uint8, shape (N, 3), optional
        Red, green and blue.
    fields : dict of array_like, shape (N,), optional
        Values of each field by name. Files store the numbers with the array's type.
    viewpoint : array_like, shape (4, 4), optional
        Pose of the sensor: rigid transform cloud_from_sensor, m. Default: identity (unknown).

    Raises
    ------
    Error
        If an array has a wrong shape, length or type; its `field` names the parameter.

    Examples
    --------
    >>> cloud = graspmap.Cloud([[0, 0, 0], [1, 0, 2]], fields={"score": [0.25, 0.75]})
    >>> len(cloud)
    2
    >>> cloud[cloud.fields["score"] > 0.5].positions
    array([[1., 0., 2.]])
    """
    def __init__(self, positions: ArrayLike, normals: ArrayLike | None = None,
                 colors: ArrayLike | None = None, fields: dict[str, Any] = ...,
                 viewpoint: ArrayLike | None = None) -> None: ...
    @property
    def positions(self) -> NDArray[np.float64]:
        """Positions, m: array (N, 3) of float64."""
    @property
    def normals(self) -> NDArray[np.float32] | None:
        """Unit normals: array (N, 3) of float32, or None."""
    @property
    def colors(self) -> NDArray[np.uint8] | None:
        """Red, green and blue: array (N, 3) of uint8, or None."""
    @property
    def fields(self) -> dict[str, NDArray[np.float64]]:
        """Values of each field by name: dict of arrays (N,) of float64."""
    @property
    def field_types(self) -> dict[str, str]:
        """Type of each field's numbers in files, by name, for example 'float32'."""
    @property
    def viewpoint(self) -> NDArray[np.float64]:
        """Rigid transform cloud_from_sensor, m: array (4, 4) of float64; identity if unknown."""
    def transformed(self, target_from_source: ArrayLike) -> Cloud:
        """Moves the cloud by a rigid transform.

        Parameters
        ----------
        target_from_source : array_like, shape (4, 4)
            Rigid transform, m.

        Returns
        -------
        Cloud
            Moved points with rotated normals.

        Raises
        ------
        Error
            If the matrix is not a rigid transform.

        Examples
        --------
        >>> lift = np.eye(4)
        >>> lift[2, 3] = 0.5
        >>> graspmap.Cloud([[0, 0, 0]]).transformed(lift).positions
        array([[0. , 0. , 0.5]])
        """
    def __getitem__(self, index: slice | ArrayLike) -> Cloud:
        """Returns a new cloud of the points at a slice, N truth values or K indices."""
    def __len__(self) -> int:
        """Number of points."""

class Mesh:
    """Triangle mesh.

    A mesh is immutable; its arrays are read-only views of its memory.

    Parameters
    ----------
    vertices : array_like, shape (V, 3)
        Positions, m: finite numbers.
    triangles : array_like of int, shape (T, 3)
        Indices of vertices, counterclockwise seen from outside.
    vertex_normals : array_like, shape (V, 3), optional
        Unit normals, stored as float32.
    vertex_colors : array_like of uint8, shape (V, 3), optional
        Red, green and blue.
    vertex_fields : dict of array_like, shape (V,), optional
        Values of each field by name.
    face_fields : dict of array_like, shape (T,), optional
        Values of each field by name.

    Raises
    ------
    Error
        If an array has a wrong shape, length or type, or an index is not below V.

    Examples
    --------
    >>> mesh = graspmap.Mesh([[0, 0, 0], [2, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    >>> mesh.area_m2
    1.0
    """
    def __init__(self, vertices: ArrayLike, triangles: ArrayLike,
                 vertex_normals: ArrayLike | None = None, vertex_colors: ArrayLike | None = None,
                 vertex_fields: dict[str, Any] = ..., face_fields: dict[str, Any] = ...) -> None: ...
    @property
    def vertices(self) -> NDArray[np.float64]:
        """Positions, m: array (V, 3) of float64."""
    @property
    def triangles(self) -> NDArray[np.uint32]:
        """Indices of vertices, counterclockwise seen from outside: array (T, 3) of uint32."""
    @property
    def vertex_normals(self) -> NDArray[np.float32] | None:
        """Unit normals: array (V, 3) of float32, or None."""
    @property
    def vertex_colors(self) -> NDArray[np.uint8] | None:
        """Red, green and blue: array (V, 3) of uint8, or None."""
    @property
    def vertex_fields(self) -> dict[str, NDArray[np.float64]]:
        """Values of each field by name: dict of arrays (V,) of float64."""
    @property
    def face_fields(self) -> dict[str, NDArray[np.float64]]:
        """Values of each field by name: dict of arrays (T,) of float64."""
    @property
    def area_m2(self) -> float:
        """Area of the triangles, m2."""

class Camera:
    """Pinhole camera, from `Frame.cameras`.

    A point (x, y, z) in the optical frame (x right, y down, z forward) has the pixel coordinates
    u = fx * x/z + cx and v = fy * y/z + cy, where OpenCV's distortion was applied to x/z and y/z.

    Examples
    --------
    >>> scan = graspmap.open_scan("scan.db")
    >>> camera = scan.frame(scan.nodes[0]).cameras[0]
    >>> camera.width, camera.height, camera.distortion_model
    (512, 424, 'none')
    """
    @property
    def width(self) -> int:
        """Width of the image, pixels."""
    @property
    def height(self) -> int:
        """Height of the image, pixels."""
    @property
    def fx(self) -> float:
        """Focal length along x, pixels."""
    @property
    def fy(self) -> float:
        """Focal length along y, pixels."""
    @property
    def cx(self) -> float:
        """Principal point along x, pixels."""
    @property
    def cy(self) -> float:
        """Principal point along y, pixels."""
    @property
    def distortion_model(self) -> str:
        """Model of the distortion: 'none', 'radial_tangential' or 'equidistant'."""
    @property
    def distortion(self) -> list[float]:
        """Coefficients of the distortion in OpenCV's order."""
    @property
    def base_from_camera(self) -> NDArray[np.float64]:
        """Rigid transform from the optical frame to the robot's base, m: array (4, 4) of float64."""

class Frame:
    """Images of one node of a scan, from `Scan.frame`.

    Images of several cameras are side by side in one array, in the order of `cameras`.

    Examples
    --------
    >>> scan = graspmap.open_scan("scan.db")
    >>> frame = scan.frame(scan.nodes[0])
    >>> frame.color.shape, frame.depth.shape
    ((424, 512, 3), (424, 512))
    """
    @property
    def node(self) -> int:
        """Id of the node."""
    @property
    def stamp_s(self) -> float:
        """Time of the images, s."""
    @property
    def cameras(self) -> list[Camera]:
        """Cameras in the order of their images."""
    @property
    def color(self) -> NDArray[np.uint8] | None:
        """Red, green and blue: array (height, width, 3) of uint8, or None."""
    @property
    def depth(self) -> NDArray[np.float32] | None:
        """Depth along the optical axis, m, 0 where nothing was measured: array (height, width) of
        float32, or None."""
    @property
    def right(self) -> NDArray[np.uint8] | None:
        """Right image of a stereo pair: array (height, width) of uint8, or None."""

class Poses:
    """Poses of a scan's nodes; a node is one recorded frame.

    Parameters
    ----------
    nodes : array_like of int, shape (N,)
        Ids of the nodes.
    world_from_base : array_like, shape (N, 4, 4)
        Rigid transforms from the robot's base to the world, m.
    stamps_s : array_like, shape (N,), optional
        Time stamps, s. Default: 0 (unknown).

    Raises
    ------
    Error
        If an array has a wrong shape or type, or a matrix is not a rigid transform.

    Examples
    --------
    >>> poses = graspmap.Poses([1, 2], [np.eye(4), np.eye(4)])
    >>> poses.nodes
    array([1, 2], dtype=int32)
    """
    def __init__(self, nodes: ArrayLike, world_from_base: ArrayLike,
                 stamps_s: ArrayLike | None = None) -> None: ...
    @property
    def nodes(self) -> NDArray[np.int32]:
        """Ids of the nodes, 0 if unknown: array (N,) of int32."""
    @property
    def stamps_s(self) -> NDArray[np.float64]:
        """Time stamps, s, 0 if unknown: array (N,) of float64."""
    @property
    def world_from_base(self) -> NDArray[np.float64]:
        """Rigid transforms from the robot's base to the world, m: array (N, 4, 4) of float64."""
    def __len__(self) -> int:
        """Number of poses."""

class Scan:
    """Recorded scan, from `open_scan`. Frames are read one by one.

    Examples
    --------
    >>> scan = graspmap.open_scan("scan.db")
    >>> len(scan), scan.pose_sources
    (24, ['odometry', 'ground-truth'])
    """
    @property
    def path(self) -> str:
        """Path of the database or folder."""
    @property
    def warnings(self) -> list[str]:
        """Warnings about parts of the scan that could not be read when it was opened."""
    @property
    def nodes(self) -> NDArray[np.int32]:
        """Ids of the nodes, ascending: array (N,) of int32."""
    @property
    def stamps_s(self) -> NDArray[np.float64]:
        """Time stamps of the nodes, s: array (N,) of float64."""
    @property
    def pose_sources(self) -> list[str]:
        """Sources of poses that the scan has: 'optimized', 'odometry', 'ground-truth'."""
    def poses(self, source: str = "auto") -> Poses:
        """Poses that the scan contains.

        Parameters
        ----------
        source : {'auto', 'optimized', 'odometry', 'ground-truth'}
            Source of the poses; 'auto': the first of the other sources that the scan has.

        Returns
        -------
        Poses
            Poses of the nodes that have one.

        Raises
        ------
        Error
            If the scan has no poses of this source.

        Examples
        --------
        >>> len(graspmap.open_scan("scan.db").poses("odometry"))
        24
        """
    def frame(self, node: int, color: bool = True, depth: bool = True) -> Frame:
        """Decodes the images of a node.

        Parameters
        ----------
        node : int
            Id of the node, one of `nodes`.
        color : bool
            True to decode the color image.
        depth : bool
            True to decode the depth image.

        Returns
        -------
        Frame
            Cameras and images. A missing image, or one that was not decoded, is None.

        Raises
        ------
        Error
            If the scan has no such node, or an image is damaged.

        Examples
        --------
        >>> scan = graspmap.open_scan("scan.db")
        >>> frame = scan.frame(scan.nodes[0], color=False)
        >>> frame.color is None, frame.depth.dtype
        (True, dtype('float32'))
        """
    def __len__(self) -> int:
        """Number of nodes."""

# Functions that _stages.py and _files.py call. Stages return the fields of their results as a dict.
_Path = str | PathLike[str]
_Progress = Callable[[str, int, int], None] | None
_Cloud = Cloud | ArrayLike
_Mesh = Mesh | tuple[ArrayLike, ArrayLike]

def options(stage: str) -> list[dict[str, Any]]: ...
def results(stage: str) -> list[dict[str, Any]]: ...
def stages() -> list[str]: ...
def check_names(parameters: list[str], others: list[str], missing: list[str]) -> None: ...
def open_scan(path: _Path, calibration: _Path | None) -> Scan: ...
def read_poses(path: _Path, scan: Scan | None, options: dict[str, Any]) -> Poses: ...
def write_poses(path: _Path, poses: Poses, nodes: bool) -> None: ...
def read_cloud(path: _Path) -> Cloud: ...
def write_cloud(path: _Path, cloud: _Cloud) -> None: ...
def read_mesh(path: _Path) -> Mesh: ...
def write_mesh(path: _Path, mesh: _Mesh) -> None: ...
def read_manifest(path: _Path) -> str | None: ...
def refine(scan: Scan, known_lengths: list[str], board: str | None, options: dict[str, Any],
           progress: _Progress, threads: int) -> dict[str, Any]: ...
def fuse(scan: Scan, poses: Poses | None, options: dict[str, Any], progress: _Progress,
         threads: int) -> dict[str, Any]: ...
def estimate_normals(cloud: _Cloud, options: dict[str, Any], threads: int) -> dict[str, Any]: ...
def mesh(cloud: _Cloud, options: dict[str, Any], progress: _Progress,
         threads: int) -> dict[str, Any]: ...
def resample(mesh: _Mesh, options: dict[str, Any], progress: _Progress,
             threads: int) -> dict[str, Any]: ...
def score(terrain: _Cloud, scenario: str | None, up: ArrayLike | None, options: dict[str, Any],
          progress: _Progress, threads: int) -> dict[str, Any]: ...
def grasp(mesh: _Mesh, points: ArrayLike, surface_error: float | str | None,
          more_loads_n: list[float], sequential: bool, pull_limits: bool, options: dict[str, Any],
          progress: _Progress, threads: int) -> dict[str, Any]: ...
def lookup(map: _Cloud, points: ArrayLike, options: dict[str, Any],
           threads: int) -> dict[str, Any]: ...
def footholds(map: _Cloud, up: ArrayLike, options: dict[str, Any],
              threads: int) -> dict[str, Any]: ...
def evaluate(table: dict[str, list[str]], scores: list[str], options: dict[str, Any],
             threads: int) -> dict[str, Any]: ...
def render(shown: _Cloud | _Mesh, markers: ArrayLike | None, labels: list[str],
           zero_plane_m: float | None, terrain_from_scene: ArrayLike | None,
           camera_position: ArrayLike | None, camera_target: ArrayLike | None,
           options: dict[str, Any]) -> NDArray[np.uint8]: ...
def to_png(image: NDArray[np.uint8]) -> bytes: ...
