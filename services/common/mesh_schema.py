"""The surface of the vehicle that an airframe names, as the set-up carries it: for those who show the vehicle."""

import base64
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from pydantic import ConfigDict

from lapwing.cosim.scene import Scene, SceneTable
from lapwing.cosim.scene.files import named
from lapwing.dynamics.config_error import ConfigError
from lapwing.services.common.mesh_file import SUFFIXES, Mesh, read

KEY = "airframe.mesh"
WIDEST = 20.0  # times as far as the farthest rotor is from the origin: no vehicle, but one in millimetres


class Meshes(SceneTable):
    """The triangles of the file that `airframe.mesh` names, by that name."""

    TABLE: ClassVar[str] = "meshes"
    OPTIONAL: ClassVar[bool] = True
    FROM_FILE: ClassVar[bool] = True
    model_config = ConfigDict(extra="allow", frozen=True)
    __pydantic_extra__: dict[str, str]

    def text(self, name: str) -> str | None:
        """The triangles of a file; None where it was not read."""
        return self.__pydantic_extra__.get(name)


def embed(tree: dict[str, Any], folder: Path) -> None:
    """Put the triangles of the airframe's mesh into the table `meshes`.

    Args:
        tree: the scene's data, not yet validated.
        folder: of the file that names the mesh.

    Raises:
        KeyedError: no such file, or nothing in it that can be shown.
    """
    if not isinstance(name := named(tree, "airframe", "mesh"), str):
        return
    path = folder / name
    if path.suffix.lower() not in SUFFIXES:
        raise ConfigError(KEY, f"got {name!r}", "the path of an .stl or .obj file")
    try:
        tree[Meshes.TABLE] = {name: pack(read(path))}
    except OSError as error:
        raise ConfigError(KEY, f"{path}: {(error.strerror or 'cannot be read').lower()}") from None
    except ValueError as error:
        raise ConfigError(KEY, f"{path}: {error}") from None


def check(scene: Scene, mesh: str | None, reach: float) -> None:
    """Refuse a mesh that was not read, or is no vehicle with rotors at most `reach` [m] from the origin; KeyedError."""
    if mesh is None:
        return
    text = scene[Meshes].text(mesh) if scene.has(Meshes) else None
    if text is None:
        raise ConfigError(KEY, f"got {mesh!r} as an override", "it in the airframe's file or the scene's [airframe]")
    far = float(np.abs(unpack(text).vertices).max())
    if far > WIDEST * reach:
        message = f"{mesh} reaches {far:g} m from the origin, and the rotors {reach:g} m"
        raise ConfigError(KEY, message, "metres along the airframe's axes (of millimetres, scale it by 0.001)")


def pack(mesh: Mesh) -> str:
    """A mesh as a text: vertices and faces row by row, little-endian, in base64."""
    parts = (mesh.vertices.astype("<f4"), mesh.faces.astype("<u2"))
    return " ".join(base64.b64encode(part.tobytes()).decode("ascii") for part in parts)


def unpack(text: str) -> Mesh:
    """The mesh of a text."""
    vertices, faces = map(base64.b64decode, text.split())
    return Mesh(np.frombuffer(vertices, "<f4").reshape(-1, 3), np.frombuffer(faces, "<u2").reshape(-1, 3))
