"""3D view: vehicles, rotors, loads and their motion."""

import numpy as np
import pytest
import synthetic_flights
from flights_in_space import AIRFRAME, HUBS, TICKS, Recorder, T, flight, volume

from lapwing.flights.flight_data import FlightData
from lapwing.flights.flight_provenance import Origin
from lapwing.flights.topic_view import TopicView
from lapwing.services.common.schemas.mesh_schema import Mesh, pack
from lapwing.services.scene_resolver import load, resolve
from lapwing.views.view3d import sampling, vehicle_bodies
from lapwing.views.view3d.samples import sample
from lapwing.views.view3d.stage import Rotors, Vehicle, reach
from lapwing.views.view3d.vehicle_bodies import motion
from tests.golden.digests import sample_file

pytest.importorskip("viser", reason="needs viser (pip install lapwing[view3d])")


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


def test_node_is_sent_only_when_it_changes():
    values, scene = flight(), Recorder()
    vehicle = Vehicle(scene, 0, values, "a/b", "#0072B2")
    result = sample(values, vehicle.motion, np.array([1.0]))
    vehicle.show(result, 0)
    (frame,) = (node for name, node in scene.nodes.items() if name.startswith("/0 a_b/0") and name.count("/") == 2)
    frame.position = None
    vehicle.show(result, 0)
    assert frame.position is None


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
    result = motion(FlightData(views, Origin.of_config(resolve(load(scene)))))
    count = (len(result.bodies), sum(len(body.rotors) for body in result.bodies), len(result.links))
    assert count == (bodies, rotors, links)
    assert all(body.solids or body.rotors or body.force is not None for body in result.bodies)
