"""Scans, poses, clouds, meshes and manifests in files."""

from __future__ import annotations

import json
from os import PathLike
from typing import TYPE_CHECKING, Any, Mapping

from numpy.typing import ArrayLike

from . import _core
from ._core import Cloud, Mesh, Poses, Scan

if TYPE_CHECKING:
    from typing import Unpack

    from . import _options

Path = str | PathLike[str]
CloudLike = Cloud | ArrayLike
MeshLike = Mesh | tuple[ArrayLike, ArrayLike]
Options = Mapping[str, Any] | None


def merged(options: Options, values: Mapping[str, Any]) -> Any:
    """Returns one dict of both; `values` take precedence. The extension module rejects other types."""
    if options is None or isinstance(options, Mapping):
        return {**(options or {}), **values}
    return options


def open_scan(path: Path, calibration: Path | None = None) -> Scan:
    """Opens a scan: a database of RTAB-Map, or a folder in the layout of the TUM RGB-D benchmark.

    Images are decoded later, by `Scan.frame`.

    Parameters
    ----------
    path : path
        Database or folder.
    calibration : path, optional
        Calibration file from `graspmap refine --write-calibration`. Default: as stored in the scan.

    Returns
    -------
    Scan
        Nodes, poses and frames of the scan.

    Raises
    ------
    Error
        If the file is missing, damaged or not a scan.

    Examples
    --------
    >>> scan = graspmap.open_scan("scan.db")
    >>> len(scan)
    24
    """
    return _core.open_scan(path, calibration)


def read_poses(path: Path, scan: Scan | None = None, *, options: Options = None,
               **values: Unpack[_options.ReadPosesOptions]) -> Poses:
    """Reads poses from a file: TUM, KITTI, g2o, TORO, or a COLMAP model of `scan`.

    Parameters
    ----------
    path : path
        File of poses, or folder of a COLMAP model.
    scan : Scan, optional
        Scan to whose nodes the poses are assigned, as by `graspmap fuse --poses FILE`. Default: node
        ids and times are from the file, or 0 if the file has none.
    options : mapping, optional
        Options by name; keyword arguments take precedence.
    **values
        Options, see Other Parameters.

    Returns
    -------
    Poses
        N poses of the robot's base, m.

    Raises
    ------
    Error
        If the file is missing or damaged, or does not fit the scan.

    Examples
    --------
    >>> graspmap.write_poses("one.tum", graspmap.Poses([7], [np.eye(4)]), nodes=True)
    >>> graspmap.read_poses("one.tum").nodes
    array([7], dtype=int32)
    """
    return _core.read_poses(path, scan, merged(options, values))


def write_poses(path: Path, poses: Poses, *, nodes: bool = False) -> None:
    """Writes poses to a file without a manifest. After an error, there is no incomplete file.

    Parameters
    ----------
    path : path
        File with the extension .tum, .kitti, .g2o or .toro.
    poses : Poses
        Poses to write.
    nodes : bool
        True to write the node ids as the ninth column of a .tum file.

    Raises
    ------
    Error
        If the extension is unknown, the file cannot be written, or a manifest is beside it.

    Examples
    --------
    >>> graspmap.write_poses("poses.kitti", graspmap.Poses([1], [np.eye(4)]))
    """
    _core.write_poses(path, poses, nodes)


def read_cloud(path: Path) -> Cloud:
    """Reads a cloud or a map; drops points that are not finite.

    Parameters
    ----------
    path : path
        File with the extension .pcd, .ply or .csv.

    Returns
    -------
    Cloud
        Points with the normals, colors and fields of the file.

    Raises
    ------
    Error
        If the file is missing, damaged or of another format.

    Examples
    --------
    >>> graspmap.write_cloud("points.ply", [[0, 0, 0], [1, 0, 2]])
    >>> graspmap.read_cloud("points.ply").positions
    array([[0., 0., 0.],
           [1., 0., 2.]])
    """
    return _core.read_cloud(path)


def write_cloud(path: Path, cloud: CloudLike) -> None:
    """Writes a cloud or a map to a file, whole or not at all, without a manifest.

    Parameters
    ----------
    path : path
        File with the extension .pcd, .ply, .vtp or .csv.
    cloud : Cloud or array_like, shape (N, 3)
        Points, m.

    Raises
    ------
    Error
        If the extension is unknown, the file cannot be written, or a manifest is beside it.

    Examples
    --------
    >>> graspmap.write_cloud("points.pcd", [[0, 0, 0], [1, 0, 2]])
    """
    _core.write_cloud(path, cloud)


def read_mesh(path: Path) -> Mesh:
    """Reads a triangle mesh.

    Parameters
    ----------
    path : path
        File with the extension .ply, .obj, .stl, .off or .glb.

    Returns
    -------
    Mesh
        Vertices and triangles with the normals, colors and fields of the file.

    Raises
    ------
    Error
        If the file is missing, damaged or of another format.

    Examples
    --------
    >>> graspmap.write_mesh("one.ply", ([[0, 0, 0], [2, 0, 0], [0, 1, 0]], [[0, 1, 2]]))
    >>> graspmap.read_mesh("one.ply").triangles
    array([[0, 1, 2]], dtype=uint32)
    """
    return _core.read_mesh(path)


def write_mesh(path: Path, mesh: MeshLike) -> None:
    """Writes a mesh to a file, whole or not at all, without a manifest.

    Parameters
    ----------
    path : path
        File with the extension .ply, .vtp, .obj, .stl, .off or .glb.
    mesh : Mesh or pair of array_like, shapes (V, 3) and (T, 3)
        Surface: a Mesh, or vertices, m, and triangles.

    Raises
    ------
    Error
        If the extension is unknown, the file cannot be written, or a manifest is beside it.

    Examples
    --------
    >>> graspmap.write_mesh("one.obj", ([[0, 0, 0], [2, 0, 0], [0, 1, 0]], [[0, 1, 2]]))
    """
    _core.write_mesh(path, mesh)


def read_manifest(path: Path) -> dict[str, Any] | None:
    """Reads the manifest beside an output of a command.

    Parameters
    ----------
    path : path
        Output of a command, whose manifest is PATH.json.

    Returns
    -------
    dict or None
        Content of the manifest; None if PATH.json does not exist.

    Raises
    ------
    Error
        If the manifest is damaged.

    Examples
    --------
    >>> graspmap.read_manifest("scan.db")["command"]
    'simulate scan'
    """
    text = _core.read_manifest(path)
    return None if text is None else json.loads(text)
