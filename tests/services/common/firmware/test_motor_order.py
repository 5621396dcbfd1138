"""Outputs of each firmware and the rotors that they drive."""

import math

import numpy as np
import pytest

from lapwing.dynamics.config_error import ConfigError
from lapwing.services.common.firmware.motor_order import QUADROTOR_X, Output, motor_order, motors
from lapwing.services.common.schemas.vehicle_schema import airframe
from lapwing.services.scene_resolver import load
from tests.commands import assert_rejected, run_command

HEXACOPTER = {"vehicle.airframe": "hexacopter"}
ALTERNATING = HEXACOPTER | {"airframe.rotors.spin_direction": ["cw", "ccw", "cw", "ccw", "cw", "ccw"]}


def rotors(positions, spins):
    """Return overrides of an airframe."""
    frame = {"airframe.rotors.position": positions, "airframe.rotors.spin_direction": spins.split()}
    return frame | {"airframe.mass.inertia": [0.54, 0.52, 0.84], "airframe.mass.payload": 0.0}


def octocopter(spins):
    """Return overrides of an airframe with eight rotors, counter-clockwise from ahead on the left."""
    angles = [math.pi / 8 * (2 * k + 1) for k in range(8)]
    return rotors([[0.4 * math.cos(a), 0.4 * math.sin(a), 0.0] for a in angles], spins)


PAIRS = rotors([[x, y, z] for x, y in ((0.3, 0.3), (-0.3, 0.3), (-0.3, -0.3), (0.3, -0.3)) for z in (0.0, 0.1)],
               "cw ccw ccw cw cw ccw ccw cw")  # fmt: skip
TWO_EACH_ARM = rotors(
    [[x * s, y * s, 0.0] for x, y in ((0.3, 0.3), (-0.3, 0.3), (-0.3, -0.3), (0.3, -0.3)) for s in (1, 2)],
    "cw cw ccw ccw cw cw ccw ccw",
)
ARDUPILOT = {  # angle from ahead to the right [deg] and yaw factor of each motor in AP_MotorsMatrix.cpp
    (1, 1): ((45, 1), (-135, 1), (-45, -1), (135, -1)),
    (2, 1): ((90, -1), (-90, 1), (-30, -1), (150, 1), (30, 1), (-150, -1)),
    (3, 1): ((22.5, -1), (-157.5, -1), (67.5, 1), (157.5, 1), (-22.5, 1), (-112.5, 1), (-67.5, -1), (112.5, -1)),
    (3, 14): ((22.5, 1), (67.5, -1), (112.5, 1), (157.5, -1), (-157.5, 1), (-112.5, -1), (-67.5, 1), (-22.5, -1)),
    (4, 1): ((45, 1), (-45, -1), (-135, 1), (135, -1), (-45, 1), (45, -1), (135, 1), (-135, -1)),
}


def ardupilot_outputs(p):
    """Return the change of each output by a command of roll, pitch and yaw, by AP_MotorsMatrix::add_motor."""
    table = ARDUPILOT[p["FRAME_CLASS"], p["FRAME_TYPE"]]
    angles = [math.radians(angle) for angle, _ in table]
    return np.array([[-math.sin(a), math.cos(a), yaw] for a, (_, yaw) in zip(angles, table, strict=True)])


def px4_outputs(p):
    """Return the same of PX4 by ActuatorEffectivenessRotors.cpp: the inverse of the torque that it expects, FRD."""
    count, up = int(p["CA_ROTOR_COUNT"]), np.array([0.0, 0.0, -1.0])
    assert [p[f"PWM_MAIN_FUNC{k + 1}"] for k in range(count)] == [101 + k for k in range(count)]
    places = [np.array([p[f"CA_ROTOR{k}_PX"], p[f"CA_ROTOR{k}_PY"], 0.0]) for k in range(count)]
    torque = [np.cross(place, up) - p[f"CA_ROTOR{k}_KM"] * up for k, place in enumerate(places)]
    effect = np.vstack([np.array(torque).T, np.full(count, -1.0)])
    return np.linalg.pinv(effect)[:, :3]


OUTPUTS = {"ardupilot": ardupilot_outputs, "px4": px4_outputs}


@pytest.mark.parametrize(
    ("firmware", "vehicle"),
    [("ardupilot", {}), ("ardupilot", ALTERNATING), ("ardupilot", octocopter("cw ccw " * 4)),
     ("ardupilot", octocopter("ccw cw " * 4)), ("ardupilot", PAIRS), ("px4", HEXACOPTER), ("px4", ALTERNATING),
     ("px4", octocopter("cw ccw " * 4)), ("px4", octocopter("ccw ccw cw cw " * 2)), ("px4", PAIRS),
     ("px4", TWO_EACH_ARM)],
)  # fmt: skip
def test_command_of_roll_pitch_and_yaw_produces_this_torque(firmware, vehicle):
    scene = load(f"{firmware}_quad", vehicle)
    order, parameters = motors(scene)
    frame = airframe(scene).rotors
    for axis, outputs in enumerate(OUTPUTS[firmware](parameters).T):
        thrust = outputs[list(order)]
        torque = sum(np.cross(place, [0.0, 0.0, f]) for place, f in zip(frame.position, thrust, strict=True))
        torque[2] += 0.05 * thrust @ frame.reaction_sign
        frd = torque * (1.0, -1.0, -1.0)
        assert frd[axis] > 0.01 * np.abs(outputs).max()
        assert np.abs(np.delete(frd, axis)).max() < 0.3 * frd[axis]  # the arms of quad_x differ


def test_px4_rotor_order_follows_parameters_of_scene():
    order, p = motors(load("px4_quad", HEXACOPTER))
    assert order == tuple(range(6))
    other = {f"CA_ROTOR{k}_{end}": p[f"CA_ROTOR{5 - k}_{end}"] for k in range(6) for end in ("PX", "PY", "KM")}
    chosen = {f"autopilot.parameters.{name}": value for name, value in other.items()}
    assert motors(load("px4_quad", HEXACOPTER | chosen)).order == (5, 4, 3, 2, 1, 0)


def test_quadrotor_keeps_the_geometry_of_its_px4_model():
    assert motors(load("px4_quad")) == ((2, 1, 3, 0), {})


def frame(*overrides):
    return airframe(load("betaflight_quad", overrides))


def test_each_rotor_gets_output_of_its_quarter():
    rotors = frame().rotors
    for k, i in enumerate(motor_order(frame(), QUADROTOR_X, "betaflight")):
        x, y, _ = rotors.position[k]
        assert (x > 0.0, y > 0.0) == (QUADROTOR_X[i].forward > 0.0, QUADROTOR_X[i].left > 0.0)
        assert rotors.spin_direction[k] == QUADROTOR_X[i].spin


def test_wrong_spin_direction_is_rejected():
    wrong = tuple(Output(o.forward, o.left, "cw" if o.spin == "ccw" else "ccw") for o in QUADROTOR_X)
    with pytest.raises(ConfigError, match=r"rotor 1 turns cw, output 3 of betaflight expects ccw"):
        motor_order(frame(), wrong, "betaflight")


PLUS = rotors([[0.3, 0.0, 0.0], [0.0, 0.3, 0.0], [-0.3, 0.0, 0.0], [0.0, -0.3, 0.0]], "cw ccw cw ccw")
FIVE = rotors([[0.3, 0.1 * k, 0.0] for k in range(5)], "cw ccw cw ccw cw")
CENTRE = rotors([[0.0, 0.0, 0.0], [0.0, 0.3, 0.0], [-0.3, 0.0, 0.0], [0.0, -0.3, 0.0]], "cw ccw cw ccw")
TILTED = {"airframe.rotors.axis": [[-0.1, 0.2, 1.0]] * 6}


@pytest.mark.parametrize(
    ("firmware", "vehicle", "message"),
    [("betaflight", HEXACOPTER, "airframe.rotors.position: betaflight drives 4 rotors, the airframe has 6"),
     ("px4", FIVE, "px4 drives 4 or 6 or 8 rotors, the airframe has 5; expected an airframe with 4 or 6 or 8 rotors"),
     ("px4", HEXACOPTER | TILTED, "airframe.rotors.axis: px4 takes the thrusts of 6 rotors for parallel"),
     ("px4", HEXACOPTER | {"autopilot.parameters.CA_ROTOR_COUNT": 4},
      "autopilot.parameters.CA_ROTOR_COUNT: expected 6 for the rotors of this airframe, got 4"),
     ("ardupilot", HEXACOPTER, "airframe.rotors.spin_direction: rotor 2 turns cw, output 5 of ardupilot expects ccw"),
     ("ardupilot", ALTERNATING | {"autopilot.parameters.FRAME_CLASS": 1},
      "autopilot.parameters.FRAME_CLASS: expected 2 for the rotors of this airframe, got 1"),
     ("ardupilot", PLUS, "airframe.rotors.position: rotor 1 is between the directions of two outputs of ardupilot"),
     ("px4", CENTRE, "airframe.rotors.position: rotor 1 is between the directions of two outputs of px4")],
)  # fmt: skip
def test_vehicle_that_a_firmware_does_not_fly_is_rejected(firmware, vehicle, message):
    settings = [word for key, value in vehicle.items() for word in ("--set", f"{key}={value}")]
    assert_rejected(run_command("check", f"{firmware}_quad", *settings), message)
