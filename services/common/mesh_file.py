"""Reader of triangle meshes in STL, OBJ and glTF files; only the corners are used, so no dependency is needed."""

from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np

from lapwing.dynamics.input_file import read_bytes
from lapwing.services.common import gltf_file

SUFFIXES = (".stl", ".obj", *gltf_file.SUFFIXES)
LARGEST = 20_000_000  # [byte] largest file
MOST = 20_000  # triangles: 0.3 MB in the run configuration, and smooth in a browser
_HEAD = 84  # [byte] header of a binary STL file; its last four bytes are the number of triangles
_TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


class Mesh(NamedTuple):
    """A triangle mesh."""

    vertices: np.ndarray  # (n, 3) float32 [m]
    faces: np.ndarray  # (m, 3) uint16: rows of `vertices`


def read(path: Path) -> Mesh:
    """Return the triangles of a file; equal corners become one vertex.

    Raises:
        ValueError: the file is invalid; the message does not contain its name.
        OSError: the file cannot be read.
    """
    if path.stat().st_size > LARGEST:
        raise ValueError(f"{path.stat().st_size / 1e6:.0f} MB; expected at most {LARGEST / 1e6:.0f} MB")
    data = read_bytes(path)
    suffix = path.suffix.lower()
    corners = (
        gltf_file.corners_of(data) if suffix in gltf_file.SUFFIXES else _obj(data) if suffix == ".obj" else _stl(data)
    )
    if not len(corners):
        raise ValueError("contains no triangles")
    if len(corners) > MOST:
        raise ValueError(f"{len(corners)} triangles; expected at most {MOST} (decimate it in Blender or MeshLab)")
    if not np.isfinite(corners).all():
        raise ValueError("a coordinate is not finite")
    vertices, faces = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
    return Mesh(vertices, faces.reshape(-1, 3).astype(np.uint16))


def _stl(data: bytes) -> np.ndarray:
    """Return the triangle corners of a binary or ASCII STL file, shape (m, 3, 3)."""
    count = int.from_bytes(data[_HEAD - 4 : _HEAD], "little")
    if len(data) >= _HEAD and len(data) == _HEAD + count * _TRIANGLE.itemsize:  # also if it begins with "solid"
        return np.frombuffer(data, _TRIANGLE, count, _HEAD)["corners"].copy()
    words = data.split()
    if not words or words[0].lower() != b"solid":
        raise ValueError(
            "not an STL file: its length does not match its number of triangles, nor does it start with solid"
        )
    rows = [words[k + 1 : k + 4] for k, word in enumerate(words) if word.lower() == b"vertex"]
    return _numbers(rows, "vertex").reshape(-1, 3, 3)


def _obj(data: bytes) -> np.ndarray:
    """Return the triangle corners of an OBJ file, shape (m, 3, 3); polygons are split into triangles."""
    vertices: list[list[bytes]] = []
    faces: list[tuple[int, int, int]] = []
    for number, line in enumerate(data.splitlines(), 1):
        key, *words = line.split() or [b""]
        if key == b"v":
            vertices.append(words[:3])
        elif key == b"f":
            try:
                numbers = [int(word.partition(b"/")[0]) for word in words]
            except ValueError:
                raise ValueError(f"line {number}: a face has an invalid vertex number") from None
            corners = [k - 1 if k > 0 else len(vertices) + k for k in numbers]  # negative: counted from the last
            if len(corners) < 3 or not all(0 <= k < len(vertices) for k in corners):
                raise ValueError(f"line {number}: a face has fewer than three vertices, or an undefined one")
            faces += [(corners[0], b, c) for b, c in pairwise(corners[1:])]
    return _numbers(vertices, "v")[np.array(faces, int).reshape(-1, 3)]


def _numbers(rows: list[list[bytes]], key: str) -> np.ndarray:
    try:
        points = np.array(rows, np.float32).reshape(-1, 3)
    except ValueError:
        raise ValueError(f"a {key} is not three numbers") from None
    if key == "vertex" and len(points) % 3:
        raise ValueError("a triangle has fewer than three corners")
    return points
