"""Ghosts of the reference, of the estimate and of a second flight."""

import numpy as np
import pytest
import synthetic_flights
from flights_in_space import TICKS, Recorder, T, flight

from lapwing.flights.rotation_arrays import from_euler, rotate
from lapwing.views.view3d.samples import sample
from lapwing.views.view3d.solids import join_meshes
from lapwing.views.view3d.stage import FULL, HIDDEN, OPACITY, Vehicle

TIMES = np.array([0.0, 1.0, 2.0, 3.0])
PATH = np.column_stack([0.0 * T, 0.0 * T, T])  # [s] times of the flight
AHEAD, ASIDE = PATH + np.array([5.0, 0.0, 0.0]), PATH + np.array([0.0, 3.0, 0.0])


def shown(reference, estimate, ghost=False):
    """Return the nodes of a vehicle and the handles of its ghost meshes at each of TIMES."""
    values = flight(
        setpoint={"position": reference, "yaw": 0.5},
        actuators={"attitude_reference": (0.1, 0.0, 0.5), "armed": np.ones(TICKS, bool)},
        estimate={
            "pose.position": estimate,
            "pose.orientation": synthetic_flights.LEVEL,
            "position_std": (0.1, 0.2, 0.3),
        },
    )
    scene = Recorder()
    vehicle = Vehicle(scene, 0, values, "drone1", "#0072B2", ghost=ghost)
    samples, result = sample(values, vehicle.motion, TIMES), []
    for k in range(len(TIMES)):
        vehicle.show(samples, k)
        meshes = {name.split("/")[2]: node for name, node in scene.nodes.items() if name.endswith("e/body")}
        result.append({name: {**vars(type(node)), **vars(node)} for name, node in meshes.items()})
    return scene, vehicle, result


@pytest.mark.parametrize("angles", [(0.3, 0.0, 0.0), (0.0, -0.4, 0.0), (0.0, 0.0, 2.0), (0.3, -0.4, 2.0)])
def test_quaternion_of_angles_turns_about_z_y_x(angles):
    (a, b, c), vector = angles, np.array([1.0, 2.0, 3.0])
    x = np.array([[1, 0, 0], [0, np.cos(a), -np.sin(a)], [0, np.sin(a), np.cos(a)]])
    y = np.array([[np.cos(b), 0, np.sin(b)], [0, 1, 0], [-np.sin(b), 0, np.cos(b)]])
    z = np.array([[np.cos(c), -np.sin(c), 0], [np.sin(c), np.cos(c), 0], [0, 0, 1]])
    assert rotate(from_euler(np.array([angles]))[0], vector) == pytest.approx(z @ y @ x @ vector, abs=5e-3)


def test_ghosts_are_at_reference_and_estimate():
    _, _, result = shown(AHEAD, ASIDE)
    for time, ghosts in zip(TIMES, result, strict=True):
        assert ghosts["reference"]["position"] == pytest.approx((5.0, 0.0, time), abs=1e-3)
        assert ghosts["reference"]["wxyz"] == pytest.approx(from_euler(np.array([[0.1, 0.0, 0.5]]))[0], abs=5e-4)
        assert ghosts["estimate"]["position"] == pytest.approx((0.0, 3.0, time), abs=1e-3)
        assert {ghost["opacity"] for ghost in ghosts.values()} == {OPACITY}
        assert all(ghost["visible"] for ghost in ghosts.values())


def test_ghost_is_one_mesh_in_shape_of_vehicle():
    scene, vehicle, result = shown(AHEAD, PATH)
    (body,) = vehicle.motion.bodies
    vertices, faces = result[0]["reference"]["arguments"]
    own, _ = join_meshes(body.solids)
    assert np.abs(vertices[: len(own)] - own).max() < 1e-6
    assert np.linalg.norm(vertices, axis=1).max() >= np.hypot(0.3, 0.3) + 0.24  # with the discs of its rotors
    assert faces.max() == len(vertices) - 1
    assert [name for name in scene.nodes if "/reference/" in name] == ["/0 drone1/reference/body"]


def test_ghost_fades_out_close_to_body():
    size = 0.7  # [m] approximate size of the vehicle
    away = np.interp(T, [0.0, 1.0, 2.0, 3.0], [0.0, 0.3 * HIDDEN * size, 0.5 * (HIDDEN + FULL) * size, 2.0])
    _, _, result = shown(PATH, PATH + np.column_stack([away, 0.0 * T, 0.0 * T]))
    ghosts = [ghosts["estimate"] for ghosts in result]
    assert [ghost["visible"] for ghost in ghosts] == [False, False, True, True]
    assert 0.2 * OPACITY < ghosts[2]["opacity"] < 0.8 * OPACITY
    assert ghosts[3]["opacity"] == OPACITY


def test_ghost_is_hidden_without_setpoint():
    missing = np.where(T[:, None] < 1.5, np.nan, AHEAD)
    _, _, result = shown(missing, ASIDE)
    assert [ghosts["reference"]["visible"] for ghosts in result] == [False, False, True, True]


def test_ellipsoid_of_estimate_is_not_turned_with_its_ghost():
    scene, _, _ = shown(PATH, ASIDE)
    ellipsoid = scene.nodes["/0 drone1/estimate/ellipsoid"]
    assert ellipsoid.scale == pytest.approx((0.3, 0.6, 0.9))
    assert ellipsoid.position == pytest.approx((0.0, 3.0, 3.0), abs=1e-3)
    assert not hasattr(scene.nodes["/0 drone1/estimate"], "position")


def test_second_flight_is_translucent_body_without_ghosts():
    scene, _, result = shown(AHEAD, ASIDE, ghost=True)
    assert result == [{}] * len(TIMES)
    bodies = [node for name, node in scene.nodes.items() if "/solid " in name]
    assert len(bodies) == 1
    assert bodies[0].opacity < 0.5
