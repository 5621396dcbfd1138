"""3D view: solids, meshes and sensor beams."""

import json

import numpy as np
import pytest
from flights_in_space import AIRFRAME, TICKS, Recorder, T, flight, volume

from lapwing.flights.flight_data import FlightData
from lapwing.flights.plan_shapes import FenceShape
from lapwing.flights.topic_view import TopicView
from lapwing.views.view3d import solids, surroundings
from lapwing.views.view3d.samples import sample
from lapwing.views.view3d.sampling import along
from lapwing.views.view3d.stage import Vehicle

pytest.importorskip("viser", reason="needs viser (pip install lapwing[view3d])")


@pytest.mark.parametrize(
    ("solid", "expected"),
    [
        (solids.box((1.0, 2.0, 3.0), (1.0, 2.0, 3.0), "#000000"), 6.0),
        (solids.rod((1.0, 0.0, 2.0), (0.0, 1.0, 5.0), 0.5, "#000000"), np.pi * 0.25 * 11.0**0.5),
        (solids.rod((0.0, 0.0, 0.0), (0.0, 0.0, -2.0), 0.5, "#000000"), np.pi * 0.25 * 2.0),
        (solids.ball((0.0, 0.0, 1.0), 1.0, "#000000"), 4.0 / 3.0 * np.pi),
    ],
)
def test_solids_have_their_volume_and_face_outwards(solid, expected):
    assert volume(solid) == pytest.approx(expected, rel=0.03)


def test_rotor_disc_is_closed_and_above_its_hub():
    disc = solids.disc((1.0, 2.0, 3.0), 2.0, "#000000")
    assert volume(disc) == pytest.approx(np.pi * 4.0 * 0.02 / 3.0, rel=0.03)  # two cones, together 0.01 radii high
    assert disc.vertices.min(axis=0) == pytest.approx([-1.0, 0.0, 3.1])
    assert disc.vertices.max(axis=0) == pytest.approx([3.0, 4.0, 3.12])


def test_rod_ends_at_its_points():
    rod = solids.rod((1.0, 2.0, 3.0), (1.0, 2.0, 7.0), 0.5, "#000000")
    assert rod.vertices.min(axis=0) == pytest.approx([0.5, 1.5, 3.0])
    assert rod.vertices.max(axis=0) == pytest.approx([1.5, 2.5, 7.0])


@pytest.mark.parametrize("direction", [(1.0, 0.0, 0.0), (0.0, -2.0, 0.0), (0.3, 0.4, -0.5), (0.0, 0.0, -1.0)])
def test_arrows_point_along_their_vector(direction):
    w, *axis = along(np.array([direction]))[0]
    twice = 2.0 * np.cross(axis, (0.0, 0.0, 1.0))
    tip = np.array([0.0, 0.0, 1.0]) + w * twice + np.cross(axis, twice)
    assert tip == pytest.approx(np.array(direction) / np.linalg.norm(direction), abs=2e-3)


def test_coloured_mesh_is_read_with_its_shape_and_colours(tmp_path):
    import trimesh

    parts = [solids.box((0.0, 0.0, 1.0), (1.0, 2.0, 3.0), "#E69F00"), solids.ball((0.0,) * 3, 0.5, "#14181C")]
    path = tmp_path / "body.glb"
    path.write_bytes(solids.coloured_mesh(parts))
    (mesh,) = trimesh.load_scene(path, process=False, skip_materials=True).dump()
    assert mesh.vertices == pytest.approx(np.concatenate([part.vertices for part in parts]), abs=1e-6)
    assert mesh.volume == pytest.approx(sum(map(volume, parts)), rel=1e-5)
    colours = mesh.visual.vertex_colors / 255.0
    for row, colour in ((0, (0.791, 0.347, 0.0, 1.0)), (-1, (0.00700, 0.00913, 0.01161, 1.0))):  # linear
        assert colours[row] == pytest.approx(colour, abs=0.51 / 255.0)


@pytest.mark.parametrize("is_open", [False, True])
def test_only_closed_mesh_is_drawn_from_one_side(is_open):
    data = solids.coloured_mesh([solids.box((0.0,) * 3, (1.0,) * 3, "#E69F00")._replace(open=is_open)])
    text = json.loads(data[20 : 20 + int.from_bytes(data[12:16], "little")])
    assert text["materials"][0]["doubleSided"] is is_open


@pytest.mark.parametrize(
    ("name", "table", "origin", "direction"),
    [
        ("sonar", {}, (0.0, 0.0, 0.0), (0.0, 0.0, -1.0)),
        (
            "rangefinder",
            {"azimuth_deg": 90.0, "elevation_deg": 0.0, "position": [0.1, 0.0, 0.2]},
            (0.1, 0.0, 0.2),
            (0, 1, 0),
        ),
        ("rangefinder", {"elevation_deg": 30.0, "position": [0.0, 0.0, 0.0]}, (0.0, 0.0, 0.0), (0.75**0.5, 0.0, 0.5)),
    ],
)
def test_drawn_beam_starts_at_sensor_and_ends_at_surface(name, table, origin, direction):
    ranges = np.where(T < 2.0, 1.5, np.inf)
    airframe = AIRFRAME | {"mass": {"centre": [0.05, -0.02, 0.01]}}  # positions of sensors are relative to it
    whole = flight(scene={"airframe": airframe, "sensors": {name: table}})
    reading = TopicView(np.arange(TICKS) * 10**7, {"range": ranges, "field_of_view": np.full(TICKS, 0.5)})
    values = FlightData({**{key: whole.topic(key) for key in whole.topics}, name: reading}, whole.origin)
    scene = Recorder()
    vehicle = Vehicle(scene, 0, values, "drone1", "#0072B2")
    result = sample(values, vehicle.motion, np.array([1.0, 1.0, 1.0, 3.0]))
    vehicle.show(result, 0)
    frame = next(node for path, node in scene.nodes.items() if path.endswith(f"/{name}"))
    cone, point = (
        next(node for path, node in scene.nodes.items() if path.endswith(end)) for end in ("/cone", "/point")
    )
    w, *axis = frame.wxyz
    twice = 2.0 * np.cross(axis, (0.0, 0.0, 1.0))
    assert np.array([0.0, 0.0, 1.0]) + w * twice + np.cross(axis, twice) == pytest.approx(direction, abs=2e-3)
    assert frame.position == pytest.approx(origin)
    assert cone.scale == pytest.approx((1.5 * np.tan(0.25), 1.5 * np.tan(0.25), 1.5))
    assert point.position == pytest.approx((0.0, 0.0, 1.5))
    assert (cone.visible, point.visible) == (True, True)
    vehicle.show(result, 3)
    assert (cone.visible, point.visible) == (False, False)


def test_terrain_of_grid_is_drawn_at_its_heights():
    heights = np.zeros((5, 5))
    heights[2, 2] = 2.0
    grid = {"spacing": 10.0, "corner": [-20.0, -20.0], "heights": heights.tolist()}
    scene = {"airframe": AIRFRAME, "environment": {"terrain": {"grid": grid}}}
    recorder = Recorder()
    surroundings.add_surroundings(recorder, flight(scene=scene))
    (node,) = (node for node in recorder.nodes.values() if node.kind == "add_mesh_simple")
    assert node.cast_shadow is False  # shadows on itself
    vertices = node.arguments[0]
    assert vertices[np.argmax(vertices[:, 2])] == pytest.approx(
        [0.0, 0.0, 0.0], abs=0.01
    )  # heights are relative to home
    assert vertices[:, 2].min() == pytest.approx(-2.0 - 2.0 * 2.0 / 27.0, abs=0.01)  # hollow of a bicubic surface
    lines = recorder.nodes["/surroundings/lines"].arguments[0]
    rows = {tuple(row) for row in np.asarray(vertices, np.float32)[:, :2].tolist()}
    assert {tuple(end) for end in lines[:, :, :2].reshape(-1, 2).tolist()} < rows  # between the points of the surface
    assert lines[:, :, 2].max() == pytest.approx(0.02, abs=0.01)


def test_fence_is_drawn_as_lines_up_to_flight_height(monkeypatch):
    """A translucent wall hid the ground behind it."""
    square = np.array([[-5.0, -5.0], [5.0, -5.0], [5.0, 5.0], [-5.0, 5.0]])
    monkeypatch.setattr(
        surroundings, "fence_shapes", lambda flight: [FenceShape(True, square), FenceShape(False, square)]
    )
    recorder, values = Recorder(), flight()
    surroundings.add_surroundings(recorder, values)
    segments, colours = recorder.nodes["/surroundings/fence"].arguments[:2]
    assert segments.shape == colours.shape == (2 * (3 * 4 + 4), 2, 3)
    lengths = np.linalg.norm(segments[:, 1] - segments[:, 0], axis=1)
    assert np.isclose(lengths, 10.0).sum() == 2 * 3 * 4
    assert segments[..., 2].max() >= max(12.0, values.truth.position[:, 2].max())
    assert len(np.unique(colours.reshape(-1, 3), axis=0)) == 2
    assert not [node for node in recorder.nodes.values() if node.kind == "add_mesh_simple"]
