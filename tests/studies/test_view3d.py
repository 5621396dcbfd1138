"""3D view: solids, poses, recorded page, and its player in a browser."""

import copy
import json
import re

import numpy as np
import pytest
import rich
import synthetic_flights
from flights_in_space import AIRFRAME, HUBS, READY, TICKS, Recorder, T, flight

from lapwing.services.common.mesh_file import Mesh
from lapwing.services.common.mesh_schema import pack
from lapwing.services.scene_resolver import load, resolve
from lapwing.studies.flight_data import FlightData
from lapwing.studies.flight_provenance import Origin
from lapwing.studies.plan_shapes import FenceShape
from lapwing.studies.report import write
from lapwing.studies.topic_view import TopicView
from lapwing.studies.view3d import headless as chromium
from lapwing.studies.view3d import sampling, solids, surroundings, vehicle_bodies
from lapwing.studies.view3d.coloured_mesh import coloured_mesh
from lapwing.studies.view3d.live_trail import LINES, POINTS, LiveTrail
from lapwing.studies.view3d.local_server import run_server
from lapwing.studies.view3d.recording import page as view_page
from lapwing.studies.view3d.rotors import Rotors
from lapwing.studies.view3d.samples import sample
from lapwing.studies.view3d.sampling import along, dashes, thin_path
from lapwing.studies.view3d.stage import Vehicle, error_colours, reach
from lapwing.studies.view3d.vehicle_bodies import motion
from tests.golden.digests import sample_file

pytest.importorskip("viser", reason="needs viser (pip install lapwing[view3d])")


def volume(solid):
    a, b, c = (solid.vertices[solid.faces[:, i]] for i in range(3))
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6.0)


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


def test_straight_path_is_thinned_to_its_corners():
    corners = np.array([(0.0, 0.0), (8.0, 0.0), (8.0, 2.0)])
    path = np.column_stack([np.interp(np.arange(21), (0, 10, 20), corners[:, i]) for i in (0, 1)])
    assert thin_path(path, 1e-6).tolist() == [0, 10, 20]


def test_path_at_unequal_speed_keeps_its_times():
    path = np.column_stack([np.interp(np.arange(21), (0, 10, 20), (0.0, 1.0, 9.0)), np.zeros(21)])  # a straight line
    assert thin_path(path, 1e-6).tolist() == [0, 10, 20]


def test_thinned_parabola_has_pieces_of_known_length():
    t = np.arange(1025) / 1024.0
    path, tolerance = np.column_stack([t, t**2]), 1.01 / 4.0 / 16.0**2
    keep = thin_path(path, tolerance)  # a chord of duration h is h^2 / 4 away from t^2
    assert np.diff(t[keep]) == pytest.approx(np.full(16, 1.0 / 16.0))
    drawn = np.column_stack([np.interp(t, t[keep], path[keep, i]) for i in (0, 1)])
    assert np.abs(drawn - path).max() <= tolerance


def test_thinned_path_keeps_points_beside_gap():
    path = np.arange(9.0)[:, None] * np.array([1.0, 2.0])
    path[4] = np.nan
    keep = thin_path(path, 1e-6).tolist()
    assert {3, 4, 5} <= set(keep)


def test_path_without_first_and_last_point_is_thinned():
    path = np.arange(9.0)[:, None] * np.array([1.0, 2.0])
    path[[0, -1]] = np.nan
    assert thin_path(path, 1e-6).tolist() == [0, 1, 7, 8]


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


def test_each_rotor_turns_in_its_direction():
    values = flight()
    moved = motion(values)
    assert [tuple(rotor.hub) for rotor in moved.bodies[0].rotors] == [tuple(hub) for hub in HUBS]
    assert [rotor.radius for rotor in moved.bodies[0].rotors] == [0.25] * 4
    assert moved.bodies[0].rotors[1].angle == pytest.approx(T)  # ccw seen from above is about +z
    assert moved.bodies[0].rotors[0].angle == pytest.approx(-T)
    (body,) = sample(values, moved, np.array([1.0])).bodies
    scene = Recorder()
    Rotors(scene, "/body", moved.bodies[0].rotors, "#0072B2", 0.1).set_angles(body.angles[0])
    tips = scene.nodes["/body/blades"].vertices.reshape(4, -1, 3)[:, :2].mean(axis=1) - np.array(HUBS)
    step = 2.0 * np.pi / sampling.ANGLES
    for (x, y, _), sign in zip(tips, (-1.0, 1.0, -1.0, 1.0), strict=True):
        assert np.hypot(x, y) == pytest.approx(0.95 * 0.25, abs=1e-3)
        assert np.arctan2(y, x) == pytest.approx(sign, abs=step)


def test_thrust_arrows_start_at_hubs_with_expected_lengths():
    rotors, scene = motion(flight()).bodies[0].rotors, Recorder()
    Rotors(scene, "/body", rotors, "#0072B2", 0.1).set_thrusts(np.array([1.0, 2.0, 0.0, -3.0]))
    arrows = scene.nodes["/body/thrusts"].vertices.reshape(4, -1, 3)
    assert np.ptp(arrows[:, :, 2], axis=1) == pytest.approx([0.1, 0.2, 0.0, 0.3])
    assert arrows[3, :, 2].min() == pytest.approx(-0.3)
    assert arrows[:, -1, :2] == pytest.approx(np.array(HUBS)[:, :2])
    assert np.ptp(arrows[2], axis=0) == pytest.approx(0.0)  # an arrow of zero length is invisible


def test_coloured_mesh_is_read_with_its_shape_and_colours(tmp_path):
    trimesh = pytest.importorskip("trimesh")
    parts = [solids.box((0.0, 0.0, 1.0), (1.0, 2.0, 3.0), "#E69F00"), solids.ball((0.0,) * 3, 0.5, "#14181C")]
    path = tmp_path / "body.glb"
    path.write_bytes(coloured_mesh(parts))
    mesh = trimesh.load(path, force="mesh", process=False)
    assert mesh.vertices == pytest.approx(np.concatenate([part.vertices for part in parts]), abs=1e-6)
    assert mesh.volume == pytest.approx(sum(map(volume, parts)), rel=1e-5)
    data = path.read_bytes()
    head = int.from_bytes(data[12:16], "little")
    place = 20 + head + 8 + json.loads(data[20 : 20 + head])["bufferViews"][1]["byteOffset"]
    colours = np.frombuffer(data, "<u2", 4 * len(mesh.vertices), place).reshape(-1, 4) / 65535.0
    for row, colour in ((0, (0.791, 0.347, 0.0, 1.0)), (-1, (0.00700, 0.00913, 0.01161, 1.0))):  # linear
        assert colours[row] == pytest.approx(colour, abs=1e-3)


@pytest.mark.parametrize("is_open", [False, True])
def test_only_closed_mesh_is_drawn_from_one_side(is_open):
    data = coloured_mesh([solids.box((0.0,) * 3, (1.0,) * 3, "#E69F00")._replace(open=is_open)])
    text = json.loads(data[20 : 20 + int.from_bytes(data[12:16], "little")])
    assert text["materials"][0]["doubleSided"] is is_open


def test_dashes_have_their_length_and_skip_rest_and_missing_points():
    rest = np.zeros((50, 3))
    path = np.concatenate(
        [[(np.nan,) * 3], rest, [(1.0, 0.0, 0.0), (2.0, 0.0, 0.0)], np.tile((2.0, 0.0, 0.0), (50, 1))]
    )
    result = dashes(path, 0.1, 750)
    assert result[:, 0, 0] == pytest.approx(np.arange(10) / 5.0)
    assert result[:, 1] - result[:, 0] == pytest.approx(np.tile((0.1, 0.0, 0.0), (10, 1)))
    assert len(dashes(path, 0.1, 4)) == 4
    assert len(dashes(rest, 0.1, 4)) == 0


def test_samples_follow_pose_wind_and_thrust():
    values = flight()
    result = sample(values, motion(values), np.array([0.0, 2.0]))
    assert result.bodies[0].position[:, 2] == pytest.approx([0.0, 2.0], abs=1e-3)
    assert result.bodies[0].orientation[1] == pytest.approx([1.0, 0.0, 0.0, 0.0])  # w, x, y, z
    assert result.wind[1] == pytest.approx([3.0, 0.0, 0.0])
    assert result.bodies[0].thrusts[0].tolist() == [1.0] * 4


def test_airframe_model_has_feet_and_payload_volume():
    (body,) = motion(flight()).bodies
    lowest = min(solid.vertices[:, 2].min() for solid in body.solids)
    assert lowest == pytest.approx(-0.3, abs=0.02)
    (payload,) = (solid for solid in body.solids if solid.colour == vehicle_bodies.PAYLOAD)
    assert volume(payload) == pytest.approx(2.0 / vehicle_bodies.DENSITY)
    assert reach(motion(flight())) == pytest.approx(0.3 * 2**0.5 + 0.25)


def fleet():
    """Return two vehicles, the second 4 m north of the first."""
    first = flight()
    truth = {name: first.truth[name] for name in first.truth.fields}
    truth["pose.position"] = first.truth.position + np.array([0.0, 4.0, 0.0])
    second = FlightData({"ground_truth": TopicView(np.arange(TICKS) * 10**7, truth)}, copy.copy(first.origin))
    second.vehicle = "second"
    first.others = (second,)
    first.fleet = {"second": second.truth, first.vehicle: first.truth}
    return first


SLING = {"mass": 0.4, "length": 2.0, "hook": [0.1, 0.0, -0.1]}
OFF = {**AIRFRAME, "mass": {"payload": 0.0, "centre": [0.1, 0.0, 0.2]}}


def slung():
    """Return a flight with a load 1.5 m below the hook, on a slack cable first, on a taut one in the second half."""
    place = np.zeros((TICKS, 1, 3))
    place[:, 0, 2] = T - 0.3 - 1.5
    force = np.where((np.arange(TICKS) < TICKS // 2)[:, None, None], 0.0, [[[0.0, 0.0, 4.0]]])
    load_states = {
        "name": np.full((TICKS, 1), "load", object),
        "pose": np.concatenate([place, np.tile(synthetic_flights.LEVEL, (TICKS, 1, 1))], axis=2),
        "force": force,
    }
    return flight("slung_load", scene={"airframe": OFF, "slung_load": SLING}, body_states=load_states)


def test_cable_is_straight_if_taut_and_keeps_length_if_slack():
    values, scene = slung(), Recorder()
    vehicle = Vehicle(scene, 0, values, "drone1", "#0072B2")
    result = sample(values, vehicle.motion, np.array([1.0, 3.0]))
    lengths = []
    for k, time in enumerate((1.0, 3.0)):
        vehicle.show(result, k)
        (cable,) = (node for name, node in scene.nodes.items() if name.endswith("/link 1"))
        assert cable.points[0, 0] == pytest.approx([0.0, 0.0, time - 0.3], abs=2e-3)
        assert cable.points[-1, 1] == pytest.approx([0.0, 0.0, time - 1.8], abs=2e-3)
        lengths.append(np.linalg.norm(np.diff(cable.points, axis=1), axis=2).sum())
    assert lengths == pytest.approx([2.0, 1.5], rel=0.1)


def test_body_without_new_samples_moves_evenly_in_between():
    whole = slung()
    seldom = TopicView(
        np.arange(0, TICKS, 10) * 10**7, {k: whole.topic("body_states")[k][::10] for k in ("name", "pose", "force")}
    )
    views = {name: whole.topic(name) for name in whole.topics} | {"body_states": seldom}
    values = FlightData(views, whole.origin)
    result = sample(values, motion(values), np.array([1.0, 1.05]))
    assert result.bodies[1].position[:, 2] == pytest.approx([-0.8, -0.75], abs=1e-3)


def test_contact_forces_are_drawn_at_their_points():
    place, force = np.zeros((TICKS, 2, 3)), np.zeros((TICKS, 2, 3))
    place[:, 0, 0], place[:, 1, 0], force[:, :, 2] = 0.2, -0.2, 50.0
    whole = flight()
    contact = TopicView(np.arange(TICKS) * 10**7, {"position": place, "force": force})
    values = FlightData({**{name: whole.topic(name) for name in whole.topics}, "contact_forces": contact}, whole.origin)
    scene = Recorder()
    vehicle = Vehicle(scene, 0, values, "drone1", "#0072B2")
    vehicle.show(sample(values, vehicle.motion, np.array([1.0])), 0)
    arrows = [node for name, node in scene.nodes.items() if "/force" in name]
    assert [arrow.position[0] for arrow in arrows] == pytest.approx([0.2, -0.2])
    assert all(arrow.visible and arrow.wxyz == pytest.approx((1.0, 0.0, 0.0, 0.0)) for arrow in arrows)


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


def test_node_is_sent_only_when_it_changes():
    values, scene = flight(), Recorder()
    vehicle = Vehicle(scene, 0, values, "a/b", "#0072B2")
    result = sample(values, vehicle.motion, np.array([1.0]))
    vehicle.show(result, 0)
    (frame,) = (node for name, node in scene.nodes.items() if name.startswith("/0 a_b/0") and name.count("/") == 2)
    frame.position = None
    vehicle.show(result, 0)
    assert frame.position is None


def test_live_trail_is_flown_path_in_few_lines():
    values, scene = flight(ticks=20), Recorder()
    trail = LiveTrail(Vehicle(scene, 0, values, "drone1", "#0072B2"), 0.25)
    steps = 3 * POINTS // 4
    for k in range(steps):
        truth = {name: values.truth[name] for name in values.truth.fields}
        truth["pose.position"] = values.truth.position + np.array([0.0, 0.0, 0.2 * k])
        views = {"ground_truth": TopicView(np.arange(20) * 10**7 + k * 200_000_000, truth)}
        trail.extend(FlightData(views, copy.copy(values.origin)))
    lines = [node for name, node in scene.nodes.items() if "/trail/" in name]
    drawn = [getattr(line, "points", line.arguments[0]) for line in lines]
    assert len(lines) == 4
    assert len(lines) < LINES
    ends = [(points[0, 0, 2], points[-1, 1, 2]) for points in drawn]
    assert [stop for _, stop in ends[:-1]] == pytest.approx([start for start, _ in ends[1:]])
    assert (ends[0][0], ends[-1][1]) == pytest.approx((0.0, 0.2 * (steps - 1) + 0.19), abs=1e-3)


def test_error_colours_run_from_dark_blue_to_orange():
    low, high = error_colours(np.array([0.0, 2.0]))
    assert (low.tolist(), high.tolist()) == ([0, 76, 140], [224, 110, 20])


TRIANGLE = Mesh(np.array([(0.5, 0.0, 0.0), (0.0, 0.25, 0.0), (0.0, 0.0, 0.125)]), np.array([(0, 1, 2)]))
WITH_MESH = {"airframe": {**AIRFRAME, "mesh": "a.stl"}, "meshes": {"a.stl": pack(TRIANGLE)}}


def test_mesh_replaces_airframe():
    (body,) = motion(flight(scene=WITH_MESH)).bodies
    assert [solid.vertices.tolist() for solid in body.solids] == [TRIANGLE.vertices.tolist()]


def test_vehicle_without_shape_has_its_axes():
    (body,) = motion(flight("something new", scene={})).bodies
    assert len(body.solids) == 3


@pytest.mark.parametrize(
    ("scene", "bodies", "rotors", "links"),
    [
        ("hover", 1, 4, 0),
        ("delivery_full", 1, 4, 0),
        ("gyrostat_attitude", 1, 0, 0),
        ("os4_motors", 1, 4, 0),
        ("cooperative_load", 3, 8, 2),
        ("slung_load", 2, 4, 1),
        ("unload", 8, 0, 0),
    ],
)
def test_every_kind_of_scene_has_its_shape(scene, bodies, rotors, links):
    recorded = FlightData.read(sample_file(scene))  # the samples carry no run configuration
    views = {name: recorded.topic(name) for name in recorded.topics}
    result = motion(FlightData(views, Origin.of_setup(resolve(load(scene)))))
    count = (len(result.bodies), sum(len(body.rotors) for body in result.bodies), len(result.links))
    assert count == (bodies, rotors, links)
    assert all(body.solids or body.rotors or body.force is not None for body in result.bodies)


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    return write(flight(), tmp_path_factory.mktemp("page") / "flight.html", view3d=True)


def embedded(page):
    """Return the page of the 3D view within a report."""
    text = page.read_text(encoding="utf-8").partition('id="space"')[2]
    return json.loads(re.search(r'<script type="application/json">(".*?")</script>', text)[1])


def test_page_is_self_contained_and_small(page):
    text = page.read_text(encoding="utf-8")
    assert not re.search(r"<(script|link|img|iframe)[^>]+(src|href)=\"http", text)
    assert text.index('id="space"') < text.index('id="position"')
    assert len(text) < 5_000_000


def test_names_of_scene_cannot_end_script(tmp_path):
    values = fleet()
    values.others[0].vehicle = "</script><script>alert(1)</script>"
    values.fleet = {values.others[0].vehicle: values.others[0].truth, values.vehicle: values.truth}
    text = write(values, tmp_path / "flight.html", view3d=True).read_text(encoding="utf-8")
    assert "<script>alert(1)" not in text
    assert "<script>alert(1)" not in embedded(tmp_path / "flight.html")


def test_report_without_viser_names_extra(tmp_path, monkeypatch):
    monkeypatch.setattr("lapwing.studies.view3d.available", lambda: False)
    text = write(flight(), tmp_path / "flight.html", view3d=True).read_text(encoding="utf-8")
    assert "pip install lapwing[view3d]" in text


@pytest.mark.long
@pytest.mark.skipif(chromium.PROGRAM is None, reason="needs Chromium")
def test_browser_follows_vehicle_and_seeks(tmp_path, page):
    path = tmp_path / "view.html"
    path.write_text(embedded(page), encoding="utf-8")
    with chromium.Browser(path, tmp_path / "profile") as browser:
        shown, seen, onboard, place = browser.run(
            READY
            + """
            const camera = () => lapwingView.camera();
            lapwingView.seek(2.5);
            await until(() => Math.abs(lapwingView.time - 2.5) < 0.01);
            await until(() => Math.abs(camera().target[1] - 2.5) < 0.05);  // y is up in three.js
            const followed = camera();
            lapwingView.look("onboard");
            const far = ({ place, target }) => Math.hypot(target[0] - place[0], target[2] - place[2]);
            await until(() => far(camera()) > 15);
            return [lapwingView.time, followed.target, camera().target, camera().place];
            """
        )
        assert browser.errors == []
    assert shown == pytest.approx(2.5, abs=0.01)
    assert seen == pytest.approx([0.0, 2.5, 0.0], abs=0.05)
    assert onboard[1] == pytest.approx(2.5, abs=0.1)  # along x of the body, which is level
    assert np.hypot(onboard[0], onboard[2]) == pytest.approx(20.0, abs=0.1)
    assert np.dot(np.subtract(onboard, place), onboard) > 0.0


@pytest.mark.long
@pytest.mark.skipif(chromium.PROGRAM is None, reason="needs Chromium")
def test_browser_links_view_to_plots(tmp_path, page):
    with chromium.Browser(page, tmp_path / "profile") as browser:
        played, sought, cursor = browser.run(
            """
            const until = async (holds) => {
              for (let k = 0; k < 1200 && !holds(); k++) await new Promise((done) => setTimeout(done, 50));
              if (!holds()) throw new Error(`never: ${holds}`);
            };
            await until(() => document.readyState === "complete");
            const space = document.querySelector("#space .space");
            space.closest("details").open = true;
            space.scrollIntoView();
            await until(() => Number(space.dataset.time) > 0.1);
            const played = Number(space.dataset.time);
            space.querySelector("iframe").contentWindow.postMessage({ lapwing: "seek", time: 2.5 }, "*");
            await until(() => Math.abs(Number(space.dataset.time) - 2.5) < 0.01);
            const sought = Number(space.dataset.time);
            const figure = document.querySelector("#position figure");
            figure.scrollIntoView();
            await until(() => figure.querySelector(".js-plotly-plot"));
            const view = space.querySelector("iframe").contentWindow;
            await until(() => {
              view.postMessage({ lapwing: "seek", time: 1 + Math.random() / 100 }, "*");
              return figure.querySelector(".hoverlayer text");
            });
            return [played, sought, figure.querySelector(".hoverlayer").textContent];
            """
        )
        assert browser.errors == []
    assert 0.1 < played < 4.0
    assert sought == pytest.approx(2.5, abs=0.01)
    assert re.match(r"(0\.99|1|2\.5)\S* s", cursor)


@pytest.mark.long
@pytest.mark.skipif(chromium.PROGRAM is None, reason="needs Chromium")
def test_view_opens_at_event_that_was_chosen_before(tmp_path, page):
    with chromium.Browser(page, tmp_path / "profile") as browser:
        time = browser.run(
            """
            const until = async (holds) => {
              for (let k = 0; k < 1200 && !holds(); k++) await new Promise((done) => setTimeout(done, 50));
              if (!holds()) throw new Error(`never: ${holds}`);
            };
            await until(() => document.readyState === "complete");
            const event = document.createElement("button");
            event.dataset.time = 2.5;
            document.body.append(event);
            event.click();
            const space = document.querySelector("#space .space");
            space.closest("details").open = true;
            await until(() => Math.abs(Number(space.dataset.time) - 2.5) < 0.01);
            return Number(space.dataset.time);
            """
        )
        assert browser.errors == []
    assert time == pytest.approx(2.5, abs=0.01)


@pytest.mark.long
@pytest.mark.skipif(chromium.PROGRAM is None, reason="needs Chromium")
def test_bar_follows_player_less_often_than_trail_and_body(tmp_path, page):
    path = tmp_path / "view.html"
    path.write_text(embedded(page), encoding="utf-8")
    with chromium.Browser(path, tmp_path / "profile") as browser:
        bars, seconds, apart = browser.run(
            READY
            + """
            const slider = () => Number(document.querySelector("[role=slider]").getAttribute("aria-valuenow"));
            lapwingView.seek(0.5);
            await until(() => Math.abs(lapwingView.time - 0.5) < 0.01);
            document.activeElement.blur();
            dispatchEvent(new KeyboardEvent("keydown", { code: "Space" })); // plays again
            const bars = new Set(), start = performance.now();
            let apart = 0, before = 0.5;
            while (lapwingView.time < 3.0) {
              await new Promise(requestAnimationFrame);
              bars.add(slider());
              const { z } = __viserMutable.nodeRefFromName["/0 drone1/0 drone1"].position;
              apart = Math.max(apart, Math.abs(lapwingView.time - z) - Math.abs(z - before)); // one image late at most
              before = z;
            }
            return [bars.size, (performance.now() - start) / 1000, apart];
            """
        )
        assert browser.errors == []
    assert bars <= 10.0 * seconds + 3
    assert apart < 0.05  # [m] at 1 m/s: one frame of the recording


@pytest.mark.long
@pytest.mark.skipif(chromium.PROGRAM is None, reason="needs Chromium")
def test_fleet_is_drawn_in_few_calls_and_only_on_change(tmp_path):
    first = flight()
    for k in range(1, 8):
        truth = {name: first.truth[name] for name in first.truth.fields}
        truth["pose.position"] = first.truth.position + np.array([-2.0 * k, 0.02 * k, 0.0])
        first.others += (FlightData({"ground_truth": TopicView(np.arange(TICKS) * 10**7, truth)}, first.origin),)
    first.others = tuple(copy.copy(other) for other in first.others)
    for k, other in enumerate(first.others):
        other.vehicle = f"vehicle {k + 2}"
    first.fleet = {one.vehicle: one.truth for one in (first, *first.others)}
    path = tmp_path / "view.html"
    path.write_text(view_page([first], [first.vehicle]), encoding="utf-8")
    with chromium.Browser(path, tmp_path / "profile", size=(960, 540)) as browser:
        calls, trail, names, frames, seconds, after = browser.run(
            READY
            + """
            lapwingView.seek(1.0);
            await until(() => Math.abs(lapwingView.time - 1.0) < 0.01);
            const wait = (time) => new Promise((done) => setTimeout(done, time));
            const still = async () => { // until no frame has been drawn for half a second
              for (let k = 0, before = -1; k < 200; k++) {
                const now = lapwingView.frames();
                if (now === before) return;
                before = now;
                await wait(500);
              }
            };
            await still();
            const ends = () => {
              const result = [];
              __viserMutable.nodeRefFromName["/0 drone1/trail"].traverse(({ geometry }) => {
                const last = geometry?.instanceCount - 1, end = geometry?.attributes.instanceEnd;
                if (end) result.push([geometry.instanceCount, end.getX(last), end.getY(last), end.getZ(last)]);
              });
              return result;
            };
            const early = ends();
            const tree = __viserSceneTree.getState();
            const names = Object.keys(tree).filter((name) => name.endsWith("/label") && tree[name].effectiveVisibility);
            const calls = __viserTestpoints.rendererInfo.render.calls;
            const begin = lapwingView.frames(), start = performance.now();
            await wait(4000);
            const frames = lapwingView.frames() - begin, seconds = (performance.now() - start) / 1000;
            lapwingView.seek(3.0);
            await until(() => Math.abs(lapwingView.camera().target[1] - 3.0) < 0.05);
            await until(() => Math.abs(ends()[0][3] - 3.0) < 0.01);
            return [calls, [...early, ...ends()], names.length, frames, seconds, lapwingView.frames() - begin - frames];
            """
        )
        assert browser.errors == []
    assert calls < 80
    assert np.array(trail) == pytest.approx(
        np.array([(1, 0, 0, 1), (1, 0, 0, 3)]), abs=0.01
    )  # one piece, up to the time
    assert 1 <= names < 8  # covered labels are hidden
    assert frames <= 2.0 * seconds  # of 60 per second; viser draws one per second, with late ones on a busy machine
    assert after > 0


def test_message_that_viser_prints_late_is_dropped(capsys):
    with run_server():
        pass
    rich.print("[bold](viser)[/bold] Server stopped")
    rich.print("another message")
    assert capsys.readouterr().out == "another message\n"
