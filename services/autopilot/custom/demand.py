"""What a controller of the user's asks for, and its way to the motors."""

import math
from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

from numba import types

from dynamics.generate import define, implements
from dynamics.kernel import leaf
from dynamics.vector import Vec3
from services.autopilot import control
from services.autopilot.interface import Command
from services.autopilot.mixer import Demands, clamp, mix, saturate
from services.autopilot.motor import thrust_at, voltage
from services.autopilot.stage import FLYING, LANDED
from services.common.controllers import Four, MotorVoltages, ThrustAndMoments

DEMAND = "demand"  # port within the autopilot


class Demand(NamedTuple):
    """Either voltages, or thrust and moments, as numbers."""

    to_motors: bool = True
    numbers: Four = (0.0, 0.0, 0.0, 0.0)  # [V] of each motor; or thrust [N] and moments about body x, y, z [N m]
    roll_pitch: tuple[float, float] = (0.0, 0.0)  # [rad] that the controller steers to


def demand(output: Any) -> Demand:
    """The demand of a `MotorVoltages` or `ThrustAndMoments`.

    Raises:
        TypeError: anything else, or other than numbers in it.
        ValueError: a number is not finite.
    """
    if isinstance(output, MotorVoltages):
        to_motors, numbers = True, _numbers("volts", output.volts, 4)
    elif isinstance(output, ThrustAndMoments):
        to_motors, moments = False, _numbers("moments_body", output.moments_body, 3)
        numbers = (*_numbers("thrust", (output.thrust,), 1), *moments)
    else:
        raise TypeError(f"step returned {type(output).__name__}, expected MotorVoltages or ThrustAndMoments")
    return Demand(to_motors, numbers, _numbers("roll_pitch", output.roll_pitch, 2))


def _numbers(what: str, given: Iterable[float], n: int) -> Any:
    try:
        found = tuple(map(float, given))
    except (TypeError, ValueError):
        found = ()
    if len(found) != n:
        raise TypeError(f"step returned {what} = {' '.join(repr(given).split())}, expected {n} number{'s' * (n > 1)}")
    if not all(map(math.isfinite, found)):
        raise ValueError(f"step returned {what} = {found}, which is not finite")
    return found


@implements(demand, inline=True)
def _demand(output: types.Type) -> Callable:
    told = len(output) == len(output.instance_class._fields)  # a compiled NamedTuple has no defaults filled in
    roll_pitch = "output[-1]" if told else "(0.0, 0.0)"
    if output.instance_class is MotorVoltages:
        return define("demand(output)", {"Demand": Demand}, f"return Demand(True, output[0], {roll_pitch})")
    numbers = "(output[0], output[1][0], output[1][1], output[1][2])"
    return define("demand(output)", {"Demand": Demand}, f"return Demand(False, {numbers}, {roll_pitch})")


@leaf
def command(law: control.Parameters, arms: Vec3, voltage_max: float, asked: Demand, yaw: float, stage: int) -> Command:
    """The motors' command.

    Args:
        law: control.Parameters, of which the control allocation and the motor model are used.
        arms: (roll, pitch, yaw) moment of a rotor over its thrust [m].
        voltage_max: [V].
        asked: Demand.
        yaw: of the setpoint [rad].
        stage: ON_GROUND, FLYING or LANDED.
    """
    off = (0.0, 0.0, 0.0, 0.0)
    if stage != FLYING:
        return Command(off, off, 0.0, 0.0, yaw, stage == LANDED)
    n, m, top = asked.numbers, law.motor, law.thrust_max
    if asked.to_motors:
        volts = (
            clamp(n[0], 0.0, voltage_max),
            clamp(n[1], 0.0, voltage_max),
            clamp(n[2], 0.0, voltage_max),
            clamp(n[3], 0.0, voltage_max),
        )
        thrust = (thrust_at(m, volts[0]), thrust_at(m, volts[1]), thrust_at(m, volts[2]), thrust_at(m, volts[3]))
    else:
        demands = Demands(0.25 * n[0], 0.25 * n[1] / arms[0], 0.25 * n[2] / arms[1], 0.25 * n[3] / arms[2])
        t = mix(law.signs, saturate(law.signs, demands, top))
        thrust = (clamp(t[0], 0.0, top), clamp(t[1], 0.0, top), clamp(t[2], 0.0, top), clamp(t[3], 0.0, top))
        volts = (voltage(m, thrust[0]), voltage(m, thrust[1]), voltage(m, thrust[2]), voltage(m, thrust[3]))
    return Command(volts, thrust, asked.roll_pitch[0], asked.roll_pitch[1], yaw, False)
