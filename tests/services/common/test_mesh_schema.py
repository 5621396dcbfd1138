"""Airframe mesh: file formats, and their use in the report."""

import base64
import json
import re
import struct
import sys

import numpy as np
import pytest

from lapwing.cosim.scene import SceneError
from lapwing.flights.flight_provenance import Origin
from lapwing.services.common.schemas.mesh_schema import MOST, pack, read, unpack
from lapwing.services.common.schemas.run_schema import SHIPPED
from lapwing.services.scene_resolver import from_resolved, load, resolve
from lapwing.views.view3d.vehicle_bodies import motion
from tests.flights import synthetic_flights

# A pyramid on a square with an eccentric apex, so that swapped axes are detected.
CORNERS = np.array([(0, 0, 0), (0.4, 0, 0), (0.4, 0.3, 0), (0, 0.3, 0), (0.1, 0.05, 0.2)], np.float32)
FACES = [(0, 2, 1), (0, 3, 2), (0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)]
VOLUME = 0.4 * 0.3 * 0.2 / 3.0


def binary(head=b"made by a test"):
    triangles = b"".join(struct.pack("<12fH", 0, 0, 0, *CORNERS[list(face)].ravel(), 0) for face in FACES)
    return head.ljust(80, b" ") + struct.pack("<I", len(FACES)) + triangles


def ascii_stl():
    facets = [
        "facet normal 0 0 0\n outer loop\n"
        + "".join(f"  vertex {x:.6e} {y} {z}\n" for x, y, z in CORNERS[list(face)])
        + " endloop\nendfacet\n"
        for face in FACES
    ]
    return ("solid pyramid\n" + "".join(facets) + "endsolid pyramid\n").encode()


def obj():
    places = "".join(f"v {x} {y} {z}\n" for x, y, z in CORNERS)
    sides = "".join(f"f {a + 1}/1/1 {b + 1}//1 {c - 5}\n" for a, b, c in FACES[2:])
    return f"# a pyramid\no pyramid\n{places}vn 0 0 1\nf 4 3 2 1\n{sides}".encode()


def gltf(scale=1.0, **changes):
    """Return the pyramid in a node that is moved, turned by 90 degrees about y (up) and scaled; y up, z forward."""
    ahead, left, up = CORNERS.T
    turned = np.column_stack([-ahead, up, left]) / scale - np.array([0.0, 1.0, 0.0])  # inverse of the node's transform
    points = turned.astype("<f4").tobytes()
    rows = np.array(FACES, "<u2").tobytes()
    half = 0.5**0.5
    tree = {
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [0]}],
        "nodes": [
            {"children": [1], "translation": [0.0, scale, 0.0], "scale": [scale] * 3},
            {"mesh": 0, "rotation": [0, half, 0, half]},
        ],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": len(CORNERS), "type": "VEC3"},
            {"bufferView": 1, "componentType": 5123, "count": 3 * len(FACES), "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteLength": len(points)},
            {"buffer": 0, "byteOffset": len(points), "byteLength": len(rows)},
        ],
        "buffers": [{"byteLength": len(points + rows)}],
        **changes,
    }
    return tree, points + rows


def with_embedded_buffer(tree, binary):
    uri = "data:application/octet-stream;base64," + base64.b64encode(binary).decode()
    return json.dumps({**tree, "buffers": [{"uri": uri, "byteLength": len(binary)}]}).encode()


def glb(tree, binary):
    text = json.dumps(tree).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(binary), 0x004E4942) + binary
    return b"glTF" + struct.pack("<II", 2, 12 + len(chunks)) + chunks


def volume(mesh):
    """Return the volume [m^3] of a closed surface with counter-clockwise faces."""
    a, b, c = (mesh.vertices[mesh.faces[:, k]].astype(float) for k in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c))) / 6.0


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("a.stl", binary()),
        ("solid.STL", binary(b"solid, says the head of many a binary file")),
        ("b.stl", ascii_stl()),
        ("c.obj", obj()),
        ("d.glb", glb(*gltf())),
        ("e.gltf", with_embedded_buffer(*gltf(scale=0.5))),
    ],
)
def test_mesh_is_equal_in_all_file_formats(tmp_path, name, content):
    (tmp_path / name).write_bytes(content)
    mesh = read(tmp_path / name)
    assert len(mesh.vertices) == len(CORNERS)  # equal corners are merged
    assert volume(mesh) == pytest.approx(VOLUME, rel=1e-6)
    assert sorted(map(tuple, mesh.vertices.round(6))) == sorted(map(tuple, CORNERS.round(6)))
    again = unpack(pack(mesh))
    assert np.array_equal(again.vertices, mesh.vertices)
    assert np.array_equal(again.faces, mesh.faces)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("no.stl", None, "no such file"),
        ("a.step", b"", "expected the path of a file that ends in .stl, .obj, .glb, .gltf, got '../a.step'"),
        ("a.stl", b"", "no triangles, or is cut off"),
        ("a.stl", binary()[:-7], "no triangles, or is cut off"),
        ("a.stl", b"solid x\nvertex 1 2 3\nvertex 1 2 3\nendsolid\n", "not a valid .stl file"),
        ("a.stl", b"solid x\nvertex 1 two 3\nendsolid\n", "not a valid .stl file"),
        ("a.stl", ascii_stl().replace(b"endsolid", 3 * b"vertex nan 0 0\n" + b"endsolid"), "not finite"),
        ("a.stl", b"solid x\nendsolid x\n", "no triangles"),
        ("a.stl", bytes(80) + struct.pack("<I", MOST + 1) + bytes(50 * (MOST + 1)), f"expected at most {MOST}"),
        ("a.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n", "not a valid .obj file"),
        ("a.obj", b"v 0 0 0\nf a b c\n", "not a valid .obj file"),
        ("a.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\n", "no triangles"),
        ("a.glb", glb(*gltf())[:-20], "not a valid .glb file"),
        ("a.glb", glb(*gltf())[:30], "not a valid .glb file"),
        ("a.glb", b"glTF", "not a valid .glb file"),
        ("a.gltf", b"[1]", "not a valid .gltf file"),
        ("a.gltf", b"no", "not a valid .gltf file"),
        ("a.glb", glb(*gltf(extensionsRequired=["KHR_draco_mesh_compression"])), "export it without compression"),
        ("a.glb", glb(*gltf(accessors=[{"componentType": 5126, "count": 5, "type": "VEC3"}])), "sparse accessors"),
        ("a.glb", glb(*gltf(buffers=[{"uri": "a.bin"}])), "in another file; export it as .glb"),
        ("a.glb", glb(*gltf(nodes=[{"children": [0]}])), "no triangles"),
        ("a.glb", glb(*gltf(nodes=[{"children": [*range(1, 5000)]}, *[{"mesh": 0}] * 5000])), "29994 triangles"),
        ("a.glb", glb(*gltf(scenes=[{}])), "no triangles"),
        ("a.obj", obj().replace(b"0.4", b"400").replace(b"0.3", b"300"), "a mesh in metres"),
    ],
)
def test_invalid_mesh_is_rejected(tmp_path, name, content, message):
    if content is not None:
        (tmp_path / name).write_bytes(content)
    with pytest.raises(SceneError, match=re.escape(message)) as refused:
        load(scene(tmp_path, name))
    text = str(refused.value)
    assert "airframe.mesh" in text
    assert name in text
    assert "\n" not in text


def test_lines_and_points_beside_triangles_are_left_out(tmp_path):
    tree, data = gltf()
    points = {"attributes": {"POSITION": 0}}
    primitives = [*tree["meshes"][0]["primitives"], {**points, "mode": 0}, {**points, "mode": 1}]
    (tmp_path / "a.glb").write_bytes(glb({**tree, "meshes": [{"primitives": primitives}]}, data))
    assert len(read(tmp_path / "a.glb").faces) == len(FACES)


def test_missing_trimesh_is_named_with_its_installation(tmp_path, monkeypatch):
    (tmp_path / "a.stl").write_bytes(binary())
    path = scene(tmp_path, "a.stl")
    monkeypatch.setitem(sys.modules, "trimesh", None)
    with pytest.raises(
        SceneError, match=re.escape("airframe.mesh: trimesh is not installed; pip install lapwing[meshes]")
    ):
        load(path)
    load("hover")


def scene(folder, mesh):
    """Write `hover` with an airframe in vehicles/ that names a mesh."""
    (folder / "vehicles").mkdir()
    text = (SHIPPED / "vehicles" / "delivery_drone.toml").read_text()
    (folder / "vehicles" / "own.toml").write_text(f'mesh = "../{mesh}"\n{text}')
    path = folder / "own.toml"
    path.write_text((SHIPPED / "hover.toml").read_text().replace('"delivery_drone"', '"own"'))
    return path


def test_run_configuration_stores_mesh(tmp_path):
    (tmp_path / "own.stl").write_bytes(binary())
    loaded = load(scene(tmp_path, "own.stl"), ["airframe.mass.centre=[0.1, 0.0, 0.0]"])
    config = resolve(loaded)
    (tmp_path / "own.stl").unlink()
    assert from_resolved(config.resolved).resolved == loaded.resolved
    truth = {"pose.position": (0.0, 0.0, 1.0), "pose.orientation": synthetic_flights.LEVEL, "rotor_speed": (0.0,) * 4}
    flight = synthetic_flights.flight(3, ground_truth=truth, scene=Origin.of_config(config).scene)
    (body,) = motion(flight).bodies
    (hull,) = body.solids  # instead of arms and feet
    assert hull.vertices.min(axis=0) == pytest.approx([-0.1, 0.0, 0.0])  # from the centre of mass
    assert hull.vertices.max(axis=0) == pytest.approx([0.3, 0.3, 0.2])
    assert len(hull.faces) == len(FACES)
    assert len(body.rotors) == 4


def test_mesh_is_rejected_as_override(tmp_path):
    (tmp_path / "own.stl").write_bytes(binary())
    path = tmp_path / "own.toml"
    path.write_text((SHIPPED / "hover.toml").read_text() + '\n[airframe]\nmesh = "own.stl"\n')
    assert list(load(path).resolved["meshes"]) == ["own.stl"]
    with pytest.raises(SceneError, match=r"airframe\.mesh: .*as an override"):
        load("hover", ["airframe.mesh=own.stl"])


def test_scene_without_mesh_has_no_mesh_tables():
    resolved = load("hover").resolved
    assert "meshes" not in resolved
    assert "mesh" not in resolved["airframe"]
