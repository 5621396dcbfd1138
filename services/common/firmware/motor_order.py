"""Assignment of a firmware's outputs to the rotors of the airframe."""

from typing import NamedTuple

from lapwing.dynamics.config_error import ConfigError
from lapwing.dynamics.vehicles.airframe import Airframe
from lapwing.kernels import math


class Output(NamedTuple):
    """One motor output of a firmware, in its numbering."""

    forward: float  # body x of its rotor, any positive scale
    left: float  # body y of its rotor
    spin: str  # "cw" or "ccw", seen from above


QUADROTOR_X = (Output(1.0, -1.0, "ccw"), Output(-1.0, 1.0, "ccw"), Output(1.0, 1.0, "cw"), Output(-1.0, -1.0, "cw"))
"""Outputs 1 to 4 of PX4 (airframe 10016), ArduPilot (FRAME_CLASS 1, FRAME_TYPE 1) and Betaflight (port 9002).

The last one differs from Betaflight's numbering of motors.
"""


def motor_order(frame: Airframe, layout: tuple[Output, ...], firmware: str) -> tuple[int, ...]:
    """Return for each rotor of the airframe the number (from 0) of the firmware's output that drives it.

    A rotor belongs to the output in the same quarter (or, for more rotors, in the nearest direction).

    Raises:
        ConfigError: the number of rotors differs, two rotors share an output, or a spin direction differs.
    """
    places, spins = frame.rotors.position, frame.rotors.spin_direction
    if len(places) != len(layout):
        message = f"{firmware} drives {len(layout)} rotors, the airframe has {len(places)}"
        raise ConfigError("airframe.rotors.position", message, f"an airframe with {len(layout)} rotors")

    def cosine(x: float, y: float, output: Output) -> float:
        """Return the cosine of the angle between the directions of a rotor and an output."""
        return (x * output.forward + y * output.left) / (math.hypot(x, y) * math.hypot(output.forward, output.left))

    order = tuple(max(range(len(layout)), key=lambda i: cosine(x, y, layout[i])) for x, y, _ in places)
    if sorted(order) != list(range(len(layout))):
        outputs = ", ".join(str(i + 1) for i in order)
        message = f"rotors belong to the outputs {outputs} of {firmware}"
        raise ConfigError("airframe.rotors.position", message, "one rotor for each output")
    for k, i in enumerate(order):
        if spins[k] != layout[i].spin:
            message = f"rotor {k + 1} turns {spins[k]}, output {i + 1} of {firmware} expects {layout[i].spin}"
            raise ConfigError("airframe.rotors.spin_direction", message)
    return order
