"""The vehicle mesh that an airframe names: read by trimesh, stored in the run configuration for viewers."""

import base64
import io
import json
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

import numpy as np
from pydantic import ConfigDict

from lapwing.cosim.scene import Scene, SceneTable
from lapwing.cosim.scene.files import unvalidated_value
from lapwing.dynamics.config_error import ConfigError
from lapwing.dynamics.input_file import read_bytes

KEY = "airframe.mesh"
GLTF = (".glb", ".gltf")
SUFFIXES = (".stl", ".obj", *GLTF)
LARGEST = 20_000_000  # [byte] largest file
MOST = 20_000  # triangles: 0.3 MB in the run configuration, and smooth in a browser
WIDEST = 20.0  # mesh size over the distance of the farthest rotor; more means a mesh in millimetres


class Mesh(NamedTuple):
    """A triangle mesh in the axes of the body."""

    vertices: np.ndarray  # (n, 3) float32 [m]
    faces: np.ndarray  # (m, 3) uint16: rows of `vertices`


class Meshes(SceneTable):
    """Triangles of the file `airframe.mesh`, by its name."""

    TABLE: ClassVar[str] = "meshes"
    OPTIONAL: ClassVar[bool] = True
    FROM_FILE: ClassVar[bool] = True
    model_config = ConfigDict(extra="allow", frozen=True)
    __pydantic_extra__: dict[str, str]

    def text(self, name: str) -> str | None:
        """Return the packed triangles of a file. Return None if it was not read."""
        return self.__pydantic_extra__.get(name)


def embed(tree: dict[str, Any], folder: Path) -> None:
    """Store the triangles of the airframe's mesh in the table `meshes`.

    Args:
        tree: scene data, not yet validated.
        folder: folder of the file that names the mesh.

    Raises:
        ConfigError: the file is missing or invalid.
    """
    if not isinstance(name := unvalidated_value(tree, "airframe", "mesh"), str):
        return
    path = folder / name
    if path.suffix.lower() not in SUFFIXES:
        raise ConfigError(KEY, f"got {name!r}", f"the path of a file that ends in {', '.join(SUFFIXES)}")
    try:
        tree[Meshes.TABLE] = {name: pack(read(path))}
    except OSError as error:
        raise ConfigError(KEY, f"{path}: {(error.strerror or 'cannot be read').lower()}") from None
    except ValueError as error:
        raise ConfigError(KEY, f"{path}: {error}") from None
    except ImportError:
        raise ConfigError(KEY, "trimesh is not installed; pip install lapwing[meshes]") from None


def read(path: Path) -> Mesh:
    """Return the triangles of an STL, OBJ or glTF file; equal corners become one vertex, colours are not read.

    Raises:
        ValueError: the file is invalid; the message does not contain its name.
        OSError: the file cannot be read.
        ImportError: trimesh is not installed.
    """
    import trimesh

    if path.stat().st_size > LARGEST:
        raise ValueError(f"{path.stat().st_size / 1e6:.0f} MB; expected at most {LARGEST / 1e6:.0f} MB")
    data, suffix = read_bytes(path), path.suffix.lower()
    try:
        if suffix in GLTF:
            _check_gltf(data if suffix == ".gltf" else data[20 : 20 + int.from_bytes(data[12:16], "little")])
        scene = trimesh.load_scene(io.BytesIO(data), file_type=suffix[1:], process=False, skip_materials=True)
        shapes = [scene.geometry[scene.graph[node][1]] for node in scene.graph.nodes_geometry]  # one for each instance
        if (count := sum(len(getattr(shape, "faces", ())) for shape in shapes)) > MOST:
            raise ValueError(f"{count} triangles; expected at most {MOST} (decimate it in Blender or MeshLab)")
        corners = [shape.triangles for shape in scene.dump() if isinstance(shape, trimesh.Trimesh)]  # others: lines
    except Exception as error:  # trimesh raises errors of many types
        raise ValueError(f"not a valid {suffix} file: {type(error).__name__}: {' '.join(str(error).split())}") from None
    points = np.concatenate([np.empty((0, 3, 3)), *corners]).astype(np.float32)
    if not len(points):
        raise ValueError("contains no triangles, or is cut off")
    if not np.isfinite(points).all():
        raise ValueError("a coordinate is not finite")
    if suffix in GLTF:
        points = points[..., [2, 0, 1]]  # from x left, y up, z forward
    vertices, faces = np.unique(points.reshape(-1, 3), axis=0, return_inverse=True)
    return Mesh(vertices, faces.reshape(-1, 3).astype(np.uint16))


def _check_gltf(text: bytes) -> None:
    """Raise ValueError for content that trimesh would replace by zeros, or that is in another file."""
    tree = json.loads(text)
    if missing := tree.get("extensionsRequired"):
        raise ValueError(f"it needs {', '.join(map(str, missing))}; export it without compression")
    if any("sparse" in entry or "bufferView" not in entry for entry in tree.get("accessors", ())):
        raise ValueError("it has sparse accessors; export it without them")
    if any(not entry.get("uri", "data:").startswith("data:") for entry in tree.get("buffers", ())):
        raise ValueError("its triangles are in another file; export it as .glb")


def check(scene: Scene, mesh: str | None, reach: float) -> None:
    """Raise ConfigError if the mesh was not read or is too large for rotors within `reach` [m] of the origin."""
    if mesh is None:
        return
    text = scene[Meshes].text(mesh) if scene.has(Meshes) else None
    if text is None:
        raise ConfigError(KEY, f"got {mesh!r} as an override", "mesh in the airframe's file or the scene's [airframe]")
    far = float(np.abs(unpack(text).vertices).max())
    if far > WIDEST * reach:
        message = f"{mesh} extends {far:g} m from the origin, but the rotors only {reach:g} m"
        raise ConfigError(KEY, message, "a mesh in metres (scale one in millimetres by 0.001)")


def pack(mesh: Mesh) -> str:
    """Return the mesh as text: vertices and faces row by row, little-endian, in base64."""
    parts = (mesh.vertices.astype("<f4"), mesh.faces.astype("<u2"))
    return " ".join(base64.b64encode(part.tobytes()).decode("ascii") for part in parts)


def unpack(text: str) -> Mesh:
    """Return the mesh of a packed text."""
    vertices, faces = map(base64.b64decode, text.split())
    return Mesh(np.frombuffer(vertices, "<f4").reshape(-1, 3), np.frombuffer(faces, "<u2").reshape(-1, 3))
