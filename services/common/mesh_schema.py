"""The vehicle mesh that an airframe names, stored in the run configuration for viewers."""

import base64
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from pydantic import ConfigDict

from lapwing.cosim.scene import Scene, SceneTable
from lapwing.cosim.scene.files import unvalidated_value
from lapwing.dynamics.config_error import ConfigError
from lapwing.services.common.mesh_file import SUFFIXES, Mesh, read

KEY = "airframe.mesh"
WIDEST = 20.0  # mesh size over the distance of the farthest rotor; more means a mesh in millimetres


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
