"""Opaque solids of several colours as one binary glTF, drawn in one call."""

import json
from collections.abc import Sequence

import numpy as np

from lapwing.studies.view3d.solids import Solid, join_meshes

FLOAT, USHORT, UINT = 5126, 5123, 5125  # component types of glTF 2.0, 3.6.2.2
VERTICES, FACES = 34962, 34963  # targets of buffer views


def coloured_mesh(solids: Sequence[Solid]) -> bytes:
    """Return a binary glTF 2.0 of solids with vertex colours; without normals, the viewer uses flat shading."""
    vertices, faces = join_meshes(solids)
    positions = vertices.astype("<f4")
    colours = np.concatenate([np.tile(linear(solid.colour), (len(solid.vertices), 1)) for solid in solids])
    chunks = [part.tobytes() for part in (positions, colours.astype("<u2"), faces.astype("<u4"))]
    offsets = np.cumsum([0, *(len(chunk) for chunk in chunks)])
    views = [
        {"buffer": 0, "byteOffset": int(offset), "byteLength": len(chunk), "target": target}
        for offset, chunk, target in zip(offsets, chunks, (VERTICES, VERTICES, FACES), strict=False)
    ]
    low, high = positions.min(axis=0).tolist(), positions.max(axis=0).tolist()
    accessors = [
        {"bufferView": 0, "componentType": FLOAT, "count": len(positions), "type": "VEC3", "min": low, "max": high},
        {"bufferView": 1, "componentType": USHORT, "count": len(positions), "type": "VEC4", "normalized": True},
        {"bufferView": 2, "componentType": UINT, "count": int(faces.size), "type": "SCALAR"},
    ]
    attributes = {"POSITION": 0, "COLOR_0": 1}
    is_open = any(solid.open for solid in solids)
    material = {"doubleSided": is_open, "pbrMetallicRoughness": {"metallicFactor": 0.0, "roughnessFactor": 1.0}}
    document = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": attributes, "indices": 2, "material": 0}]}],
        "materials": [material],
        "buffers": [{"byteLength": int(offsets[-1])}],
        "bufferViews": views,
        "accessors": accessors,
    }
    text = json.dumps(document, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    head = _words(0x46546C67, 2, 28 + len(text) + int(offsets[-1]))  # "glTF", version, length
    return head + _chunk(b"JSON", text) + _chunk(b"BIN\0", b"".join(chunks))


def linear(colour: str) -> np.ndarray:
    """Return linear red, green, blue and opacity 1 of an sRGB colour "#RRGGBB" scaled to 65535, shape (4,)."""
    values = np.array([int(colour[k : k + 2], 16) for k in (1, 3, 5)]) / 255.0
    shares = np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)
    return np.round(65535.0 * np.append(shares, 1.0))


def _words(*values: int) -> bytes:
    return np.array(values, "<u4").tobytes()


def _chunk(kind: bytes, data: bytes) -> bytes:
    return _words(len(data)) + kind + data
