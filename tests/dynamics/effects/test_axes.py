"""Tilted rotors against hand calculations, an independent sum over rotors, and a rotated body frame."""

from dataclasses import dataclass

import numpy as np
import pytest
from pydantic import ValidationError
from scipy.spatial.transform import Rotation

from lapwing.dynamics import effects
from lapwing.dynamics.effects._types import Motion
from lapwing.dynamics.lie.quaternion import Quaternion
from lapwing.dynamics.validation import fault
from lapwing.dynamics.vehicles import multirotor
from lapwing.dynamics.vehicles.airframe import Airframe
from lapwing.dynamics.vehicles.multirotor_equations import STANDARD_DENSITY, StepInputs, evaluate
from lapwing.kernels import python_function

pytestmark = pytest.mark.usefixtures("uncompiled")

SPEED = (310.0, 290.0, 330.0, 270.0)  # [rad/s]
VOLTAGE = (33.0, 29.0, 31.0, 30.0)  # [V], so that the rotors speed up and slow down
AXES = ((0.3, 0.1, 1.0), (-0.2, 0.3, 2.0), (0.0, -0.5, 1.0), (0.1, 0.1, 0.9))
RATES = (0.7, -1.1, 0.4)
TABLE = {"advance": [-0.2, 0.0, 0.2, 0.4], "angle_deg": [0.0, 90.0], "diameter": 0.5588,
         "thrust": [[0.09, 0.074, 0.05, 0.02], [0.07, 0.074, 0.08, 0.09]],
         "power": [[0.03, 0.031, 0.03, 0.02], [0.031, 0.031, 0.03, 0.03]]}  # fmt: skip


@dataclass
class FlightLoads:
    """Loads on an airborne vehicle, in body coordinates."""

    force: np.ndarray
    torque: np.ndarray
    thrust: np.ndarray
    drag: np.ndarray
    rotor_acceleration: np.ndarray


def airframe(drone, axes, positions=None):
    rotors = {"axis": tuple(map(tuple, axes))} | ({"position": tuple(map(tuple, positions))} if positions else {})
    return drone.model_copy(update={"rotors": drone.rotors.model_copy(update=rotors)})


def loads_in_flight(frame, tables, turn=(0.2, -0.3, 0.5), velocity=(4.0, -2.0, 1.5), omega=RATES):
    """Return the loads on a vehicle with rotors at SPEED under VOLTAGE; `turn` is the rotation vector body to world."""
    p = multirotor.parameters(frame, effects.from_scene(tables, frame))
    R = Rotation.from_rotvec(turn)
    attitude = Quaternion(*map(float, R.as_quat(scalar_first=True)))
    motion = Motion((0.0, 0.0, 50.0), attitude, tuple(velocity), tuple(map(float, omega)), SPEED)
    u = StepInputs(p, p.body, multirotor.initial_state(p).memory, VOLTAGE)
    _, rotors, force, torque = python_function(evaluate)(u, 0.0, motion)
    return FlightLoads(R.inv().apply(force), np.array(torque), *map(np.array, rotors[:3]))


def test_static_thrust_and_moments_by_hand(drone):
    """F = sum T a, M = sum r x T a + s Q a: reaction torque and thrust lie along the axis."""
    frame = airframe(drone, AXES)
    result = loads_in_flight(frame, {"rotor_thrust": {}}, velocity=(0, 0, 0), omega=(0, 0, 0))
    (e,) = effects.from_scene({"rotor_thrust": {}}, frame)
    force, torque = np.zeros(3), np.zeros(3)
    spins = drone.rotors.spin_direction
    for r, axis, w, spin in zip(frame.rotors.position, AXES, SPEED, spins, strict=True):
        a = np.array(axis) / np.linalg.norm(axis)
        push = STANDARD_DENSITY * e.thrust_constant * w**2 * a
        reaction = STANDARD_DENSITY * e.torque_constant * w**2 * a  # of a rotor that turns clockwise about its axis
        force, torque = force + push, torque + np.cross(r, push) + (reaction if spin == "cw" else -reaction)
    assert result.force == pytest.approx(force, rel=1e-12)
    assert result.torque == pytest.approx(torque, rel=1e-12)


@pytest.mark.long
@pytest.mark.parametrize(
    "tables",
    [
        {"rotor_thrust": {}},
        {"rotor_thrust": {}, "gyroscopic_torque": {}},
        {"rotor_thrust": {}, "h_force": {"coefficient": 1e-4}},
        {"rotor_thrust": {}, "axial_inflow": {}},
        {"rotor_thrust": {}, "dynamic_inflow": {}},
        {"rotor_thrust": {}, "rotor_flapping": {"stiffness": 3.0}},
        {"rotor_table": TABLE},
    ],
    ids=lambda tables: " ".join(tables),
)
def test_vehicle_in_turned_body_frame_flies_same(drone, tables):
    """Tilting all axes and hubs alike describes the plain vehicle in other coordinates."""
    hubs = [(x, y, 0.1) for x, y, _ in drone.rotors.position]
    Q = Rotation.from_rotvec([0.3, -0.4, 0.2])  # of the vehicle in its body frame
    turn = Rotation.from_rotvec([0.2, -0.3, 0.5])
    plain = loads_in_flight(airframe(drone, (), hubs), tables, turn.as_rotvec())
    tilted = airframe(drone, [Q.apply((0, 0, 1))] * 4, Q.apply(hubs).tolist())
    result = loads_in_flight(tilted, tables, (turn * Q.inv()).as_rotvec(), omega=Q.apply(RATES))
    assert Q.inv().apply(result.force) == pytest.approx(plain.force, rel=1e-10, abs=1e-10)
    assert Q.inv().apply(result.torque) == pytest.approx(plain.torque, rel=1e-10, abs=1e-10)
    assert result.thrust == pytest.approx(plain.thrust, rel=1e-12)
    assert result.drag == pytest.approx(plain.drag, rel=1e-12)


def test_gyroscopic_torque_conserves_angular_momentum(drone):
    """The torque is -dL/dt of L = -J sum s w a in a rotating body; the reference uses differences of L in the world."""
    frame = airframe(drone, AXES)
    with_it = loads_in_flight(frame, {"rotor_thrust": {}, "gyroscopic_torque": {}})
    without = loads_in_flight(frame, {"rotor_thrust": {}})
    axes = np.array(frame.rotors.tilted_axis)
    lag = multirotor.parameters(frame).layout
    speeding = lag.lag_rate * (lag.speed_per_volt * np.array(VOLTAGE) - SPEED)

    def momentum(t):
        L = -frame.rotors.inertia * (np.array(frame.rotors.reaction_sign) * (SPEED + t * speeding)) @ axes
        return Rotation.from_rotvec(t * np.array(RATES)).apply(L)

    rate = (momentum(1e-4) - momentum(-1e-4)) / 2e-4
    assert with_it.torque - without.torque == pytest.approx(-rate, rel=1e-6)


def test_axes_along_z_need_no_tilt(drone):
    assert airframe(drone, [(0.0, 0.0, 2.0)] * 4).rotors.tilted_axis == ()


@pytest.mark.parametrize(
    ("axis", "message"),
    [
        ([(0, 0, 1)] * 3, "rotors.axis: expected a direction for each of the 4 rotors, got 3 of them"),
        ([(0, 0, 1)] * 3 + [(0, 0, 0)], "rotors.axis.3: expected a direction that points up"),
        ([(0, 0, 1), (0.1, 0, -1), (0, 0, 1), (0, 0, 1)], "rotors.axis.1: expected a direction that points up"),
        ([(1, 0, 0)] + [(0, 0, 1)] * 3, "rotors.axis.0: expected a direction that points up"),
    ],
)
def test_invalid_axes_are_rejected(drone, axis, message):
    with pytest.raises(ValidationError) as caught:
        Airframe.model_validate(
            drone.model_dump(exclude_none=True) | {"rotors": drone.rotors.model_dump() | {"axis": axis}}
        )
    assert str(fault(caught.value, Airframe)).startswith(message)
