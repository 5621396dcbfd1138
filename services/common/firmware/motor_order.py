"""Assignment of a firmware's outputs to the rotors of the airframe."""

from functools import partial
from typing import NamedTuple

from lapwing.cosim.scene import Scene
from lapwing.dynamics.config_error import ConfigError
from lapwing.dynamics.vehicles.airframe import Airframe
from lapwing.kernels import math
from lapwing.services.common.firmware.schema import TABLE, firmware_of, parameters_in
from lapwing.services.common.schemas.vehicle_schema import airframe


class Output(NamedTuple):
    """One motor output of a firmware, in its numbering."""

    forward: float  # body x of its rotor, any positive scale
    left: float  # body y of its rotor
    spin: str  # "cw" or "ccw", seen from above


class Motors(NamedTuple):
    """Motors of a scene's vehicle as its firmware drives them."""

    order: tuple[int, ...]  # output (from 0) that drives each rotor
    parameters: dict[str, float]  # of the firmware, for this order


def _around(spins: str, *degrees: float) -> tuple[Output, ...]:
    """Return outputs by their spins and their directions [deg], clockwise from ahead."""
    angles = map(math.radians, degrees)
    return tuple(Output(math.cos(a), -math.sin(a), spin) for a, spin in zip(angles, spins.split(), strict=True))


QUADROTOR_X = (Output(1.0, -1.0, "ccw"), Output(-1.0, 1.0, "ccw"), Output(1.0, 1.0, "cw"), Output(-1.0, -1.0, "cw"))
"""Outputs 1 to 4 of PX4 (airframe 10016), ArduPilot and Betaflight (port 9002).

The last one differs from Betaflight's numbering of motors.
"""
ARDUPILOT = {
    (1.0, 1.0): QUADROTOR_X,
    (2.0, 1.0): _around("cw ccw cw ccw ccw cw", 90, -90, -30, 150, 30, -150),
    (3.0, 1.0): _around("cw cw ccw ccw ccw ccw cw cw", 22.5, -157.5, 67.5, 157.5, -22.5, -112.5, -67.5, 112.5),
    (3.0, 14.0): _around("ccw cw " * 4, 22.5, 67.5, 112.5, 157.5, -157.5, -112.5, -67.5, -22.5),
    (4.0, 1.0): _around("ccw cw " * 4, 45, -45, -135, 135, -45, 45, 135, -135),
}
"""Outputs by FRAME_CLASS and FRAME_TYPE. Source: ArduPilot, AP_MotorsMatrix.cpp."""
ROTORS = {"px4": (4, 6, 8), "ardupilot": (4, 6, 8), "betaflight": (4,)}
FRAME_KEYS = ("FRAME_CLASS", "FRAME_TYPE", "CA_ROTOR_COUNT")  # parameters that must be those of the airframe
MOTOR_1 = 101.0  # PWM_MAIN_FUNC of motor 1
YAW_RATIO = 0.05  # [m] torque over thrust of each rotor; PX4 scales all of them together
NEAR = 0.4  # greatest angle between a rotor and its output, over that between two outputs


def motors(scene: Scene) -> Motors:
    """Return the motors of the vehicle of a scene that a firmware flies.

    Raises:
        ConfigError: the firmware does not fly the airframe, or its parameters in the scene are those of another one.
    """
    frame, firmware, table = airframe(scene), firmware_of(scene), scene.section(TABLE)
    count, chosen = len(frame.rotors.position), parameters_in(table.parameter_text) | table.parameters
    if count not in ROTORS[firmware]:
        known = " or ".join(map(str, ROTORS[firmware]))
        message = f"{firmware} drives {known} rotors, the airframe has {count}"
        raise ConfigError("airframe.rotors.position", message, f"an airframe with {known} rotors")
    if count > len(QUADROTOR_X) and frame.rotors.tilted_axis:
        message = f"{firmware} takes the thrusts of {count} rotors for parallel"
        raise ConfigError("airframe.rotors.axis", message, "rotors without a tilt")
    frames: list[tuple[dict[str, float], tuple[Output, ...]]] = [({}, QUADROTOR_X)]
    if firmware == "ardupilot":
        frames = [({"FRAME_CLASS": a, "FRAME_TYPE": b}, x) for (a, b), x in ARDUPILOT.items() if len(x) == count]
    elif count > len(QUADROTOR_X):
        frames = [_px4(frame, chosen)]
    faults = []
    for parameters, layout in frames:
        try:
            order = motor_order(frame, layout, firmware)
        except ConfigError as error:
            faults.append(error)
            continue
        for name in FRAME_KEYS:
            if name in parameters and chosen.get(name, parameters[name]) != parameters[name]:
                expected = f"{parameters[name]:g} for the rotors of this airframe"
                raise ConfigError(f"autopilot.parameters.{name}", f"got {chosen[name]:g}", expected)
        return Motors(order, parameters)
    raise faults[0]


def _px4(frame: Airframe, chosen: dict[str, float]) -> tuple[dict[str, float], tuple[Output, ...]]:
    """Return the parameters of PX4's control allocation for an airframe, and the outputs that they describe.

    Those of the scene take precedence: a firmware's own parameter file may number the rotors in another order.
    """
    rotors, result = frame.rotors, {"CA_ROTOR_COUNT": float(len(frame.rotors.position))}
    for k, ((x, y, _), sign) in enumerate(zip(rotors.position, rotors.reaction_sign, strict=True)):
        result |= {f"CA_ROTOR{k}_PX": x, f"CA_ROTOR{k}_PY": -y, f"CA_ROTOR{k}_KM": -sign * YAW_RATIO}
        result[f"PWM_MAIN_FUNC{k + 1}"] = MOTOR_1 + k
    p = result | chosen
    spins = ("cw" if p[f"CA_ROTOR{k}_KM"] < 0.0 else "ccw" for k in range(len(rotors.position)))
    return result, tuple(Output(p[f"CA_ROTOR{k}_PX"], -p[f"CA_ROTOR{k}_PY"], spin) for k, spin in enumerate(spins))


def motor_order(frame: Airframe, layout: tuple[Output, ...], firmware: str) -> tuple[int, ...]:
    """Return for each rotor of the airframe the number (from 0) of the firmware's output that drives it.

    A rotor belongs to the output in the nearest direction; of several there, to that with its spin, then the nearest.

    Raises:
        ConfigError: a rotor is between two outputs, two rotors share an output, or a spin direction differs.
    """
    places, spins = frame.rotors.position, frame.rotors.spin_direction
    directions = len({(o.forward, o.left) for o in layout})
    least, order = math.cos(NEAR * 2.0 * math.pi / directions), []

    def nearness(k: int, i: int) -> tuple[float, bool, float]:
        """Return cosine of the angle between a rotor and an output, equality of their spins, negative distance."""
        (x, y, _), o = places[k], layout[i]
        scale = math.hypot(x, y) * math.hypot(o.forward, o.left) or 1.0
        return (
            round((x * o.forward + y * o.left) / scale, 9),
            spins[k] == o.spin,
            -math.hypot(x - o.forward, y - o.left),
        )

    for k in range(len(places)):
        order.append(max(range(len(layout)), key=partial(nearness, k)))
        if nearness(k, order[k])[0] < least:
            message = f"rotor {k + 1} is between the directions of two outputs of {firmware}"
            raise ConfigError("airframe.rotors.position", message, "an airframe in X")
    if sorted(order) != list(range(len(layout))):
        outputs = ", ".join(str(i + 1) for i in order)
        message = f"rotors belong to the outputs {outputs} of {firmware}"
        raise ConfigError("airframe.rotors.position", message, "one rotor for each output")
    for k, i in enumerate(order):
        if spins[k] != layout[i].spin:
            message = f"rotor {k + 1} turns {spins[k]}, output {i + 1} of {firmware} expects {layout[i].spin}"
            raise ConfigError("airframe.rotors.spin_direction", message)
    return tuple(order)
