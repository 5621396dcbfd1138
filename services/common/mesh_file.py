"""Triangles from STL and OBJ files, as CAD programs and Blender write them.

Read here and not by numpy-stl or trimesh: of both formats nothing but corners is wanted, which is less code than what
would have to be said about a dependency; the tests read the same solid in every form.
"""

from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np

SUFFIXES = (".stl", ".obj")
LARGEST = 20_000_000  # [byte] of a file
MOST = 20_000  # triangles: what a browser turns without a stutter, and a set-up carries (0.3 MB)
_HEAD = 84  # [byte] before the triangles of a binary STL file, the last four of them their count
_TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


class Mesh(NamedTuple):
    """A surface of triangles."""

    vertices: np.ndarray  # (n, 3) float32 [m]
    faces: np.ndarray  # (m, 3) uint16: rows of `vertices`


def read(path: Path) -> Mesh:
    """The triangles of a file; corners at the same place are one vertex.

    Raises:
        ValueError: what is wrong with the file, without its name.
        OSError: it cannot be read.
    """
    if path.stat().st_size > LARGEST:
        raise ValueError(f"{path.stat().st_size / 1e6:.0f} MB; expected at most {LARGEST / 1e6:.0f} MB")
    data = path.read_bytes()
    corners = _obj(data) if path.suffix.lower() == ".obj" else _stl(data)
    if not len(corners):
        raise ValueError("no triangles in it; expected some")
    if len(corners) > MOST:
        raise ValueError(f"{len(corners)} triangles; expected at most {MOST} (decimate it in Blender or MeshLab)")
    if not np.isfinite(corners).all():
        raise ValueError("a coordinate that is no finite number")
    vertices, faces = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
    return Mesh(vertices, faces.reshape(-1, 3).astype(np.uint16))


def _stl(data: bytes) -> np.ndarray:
    """Corners of the triangles of a binary or an ASCII file, shape (m, 3, 3)."""
    count = int.from_bytes(data[_HEAD - 4 : _HEAD], "little")
    if len(data) >= _HEAD and len(data) == _HEAD + count * _TRIANGLE.itemsize:  # also where it begins with "solid"
        return np.frombuffer(data, _TRIANGLE, count, _HEAD)["corners"].copy()
    words = data.split()
    if not words or words[0].lower() != b"solid":
        raise ValueError("no STL file: neither as long as its count of triangles asks for, nor beginning with solid")
    rows = [words[k + 1 : k + 4] for k, word in enumerate(words) if word.lower() == b"vertex"]
    return _numbers(rows, "vertex").reshape(-1, 3, 3)


def _obj(data: bytes) -> np.ndarray:
    """Corners of the triangles that the faces of an OBJ file are cut into, shape (m, 3, 3)."""
    places: list[list[bytes]] = []
    faces: list[tuple[int, int, int]] = []
    for number, line in enumerate(data.splitlines(), 1):
        key, *words = line.split() or [b""]
        if key == b"v":
            places.append(words[:3])
        elif key == b"f":
            try:
                given = [int(word.partition(b"/")[0]) for word in words]
            except ValueError:
                raise ValueError(f"line {number}: a face that is not made of numbers of vertices") from None
            corners = [k - 1 if k > 0 else len(places) + k for k in given]  # negative: counted from the last
            if len(corners) < 3 or not all(0 <= k < len(places) for k in corners):
                raise ValueError(f"line {number}: a face of fewer than three vertices, or of one that is not there")
            faces += [(corners[0], b, c) for b, c in pairwise(corners[1:])]
    return _numbers(places, "v")[np.array(faces, int).reshape(-1, 3)]


def _numbers(rows: list[list[bytes]], key: str) -> np.ndarray:
    try:
        found = np.array(rows, np.float32).reshape(-1, 3)
    except ValueError:
        raise ValueError(f"a {key} that is not three numbers") from None
    if key == "vertex" and len(found) % 3:
        raise ValueError("a triangle of fewer than three corners")
    return found
