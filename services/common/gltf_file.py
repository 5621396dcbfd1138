"""Reader of triangle meshes in glTF 2.0 files (.glb, and .gltf with embedded buffers); colours are not used."""

import base64
import binascii
import json
import struct
from typing import Any

import numpy as np

SUFFIXES = (".glb", ".gltf")
DEEPEST = 32  # nested levels of nodes
MOST_NODES = 10_000  # instances of nodes in a scene
MOST_TRIANGLES = 200_000  # in a file
_MAGIC, _JSON, _BINARY = b"glTF", 0x4E4F534A, 0x004E4942
_TYPES = {5121: "<u1", 5123: "<u2", 5125: "<u4", 5126: "<f4"}  # component types
_TRIANGLES = 4  # mode of a primitive
_EMBEDDED = "base64,"
_FAULTS = (  # raised for a file that is not glTF
    *(KeyError, IndexError, TypeError, AttributeError, RecursionError),
    *(struct.error, json.JSONDecodeError, UnicodeDecodeError, binascii.Error),
)
# Axes of glTF: y up, z forward; of a body: x forward, y left, z up.
_TO_BODY = np.array([(0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)])


def corners_of(data: bytes) -> np.ndarray:
    """Return the corners of all triangles of the default scene, shape (m, 3, 3) [m], in the axes of a body.

    Raises:
        ValueError: the file is invalid or uses an extension; the message does not contain its name.
    """
    try:
        tree, binary = _parts(data)
        if missing := tree.get("extensionsRequired"):
            raise ValueError(f"needs {', '.join(map(str, missing))}; export it without compression")
        buffers = [_buffer(entry, binary) for entry in tree.get("buffers", [])]
        scene = tree["scenes"][tree.get("scene", 0)]
        stack = [(node, np.eye(4), 0) for node in scene.get("nodes", [])]
        parts, count, triangles = [], 0, 0
        while stack:
            number, parent, level = stack.pop()
            count += 1
            if level > DEEPEST or count > MOST_NODES:
                raise ValueError(f"more than {DEEPEST} levels or {MOST_NODES} parts; join the parts")
            node = tree["nodes"][number]
            pose = parent @ _transform(node)
            stack += [(child, pose, level + 1) for child in node.get("children", [])]
            if "mesh" in node:
                for primitive in tree["meshes"][node["mesh"]]["primitives"]:
                    parts.append(_triangles(tree, buffers, primitive) @ pose[:3, :3].T + pose[:3, 3])
                    triangles += len(parts[-1])
                    if triangles > MOST_TRIANGLES:
                        raise ValueError(f"more than {MOST_TRIANGLES} triangles; decimate it in Blender or MeshLab")
    except _FAULTS as error:
        raise ValueError(f"not a glTF 2.0 file ({type(error).__name__}: {error})") from None
    if not parts:
        return np.empty((0, 3, 3), np.float32)
    return (np.concatenate(parts) @ _TO_BODY.T).astype(np.float32)


def _parts(data: bytes) -> tuple[dict[str, Any], bytes]:
    """Return the JSON tree and the binary chunk, which may be empty."""
    if data[:4] != _MAGIC:
        return json.loads(data), b""
    at = 12
    chunks: dict[int, bytes] = {}
    while at + 8 <= len(data):
        length, kind = struct.unpack_from("<II", data, at)
        chunks.setdefault(kind, data[at + 8 : at + 8 + length])
        at += 8 + length
    return json.loads(chunks[_JSON]), chunks.get(_BINARY, b"")


def _buffer(entry: dict[str, Any], binary: bytes) -> bytes:
    uri = entry.get("uri")
    if uri is None:
        return binary
    head, is_embedded, text = uri.partition(_EMBEDDED)
    if not (head.startswith("data:") and is_embedded):
        raise ValueError("its triangles are in another file; export it as .glb")
    return base64.b64decode(text)


def _transform(node: dict[str, Any]) -> np.ndarray:
    if "matrix" in node:
        return np.array(node["matrix"], float).reshape(4, 4).T
    result = np.eye(4)
    x, y, z, w = node.get("rotation", (0.0, 0.0, 0.0, 1.0))
    rotation = np.array(
        [
            (1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)),
            (2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)),
            (2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)),
        ]
    )
    result[:3, :3] = rotation * np.array(node.get("scale", (1.0, 1.0, 1.0)), float)
    result[:3, 3] = node.get("translation", (0.0, 0.0, 0.0))
    return result


def _triangles(tree: dict[str, Any], buffers: list[bytes], primitive: dict[str, Any]) -> np.ndarray:
    if primitive.get("mode", _TRIANGLES) != _TRIANGLES:
        return np.empty((0, 3, 3))
    points = _accessor(tree, buffers, primitive["attributes"]["POSITION"], 3).astype(float)
    if "indices" not in primitive:
        return points[: len(points) // 3 * 3].reshape(-1, 3, 3)
    rows = _accessor(tree, buffers, primitive["indices"], 1)[:, 0].astype(int)
    return points[rows[: len(rows) // 3 * 3]].reshape(-1, 3, 3)


def _accessor(tree: dict[str, Any], buffers: list[bytes], number: int, width: int) -> np.ndarray:
    """Return the rows of an accessor, shape (count, width)."""
    accessor = tree["accessors"][number]
    if "sparse" in accessor or "bufferView" not in accessor:
        raise ValueError("has sparse accessors; export it without them")
    view = tree["bufferViews"][accessor["bufferView"]]
    kind = np.dtype(_TYPES[accessor["componentType"]])
    start, count = view.get("byteOffset", 0) + accessor.get("byteOffset", 0), accessor["count"]
    stride = view.get("byteStride", width * kind.itemsize)
    data = buffers[view["buffer"]]
    if not (count >= 1 and start >= 0 and stride >= width * kind.itemsize):
        raise ValueError("an accessor is empty or overlaps itself")
    if start + (count - 1) * stride + width * kind.itemsize > len(data):
        raise ValueError("is cut off")
    return np.ndarray((count, width), kind, data, start, (stride, kind.itemsize))
