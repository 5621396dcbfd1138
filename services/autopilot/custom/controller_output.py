"""Output of user-defined controllers and its conversion into motor commands."""

import math
from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

from numba import types

from lapwing.dynamics.vector import Vec3
from lapwing.kernels import always_inline
from lapwing.kernels.codegen import compile_source, overload_for
from lapwing.services.autopilot import control
from lapwing.services.autopilot.control import Command
from lapwing.services.autopilot.mixer import VirtualControls, active_allocation, clamp_to_range, mix, saturate
from lapwing.services.autopilot.motor import thrusts_at, voltages
from lapwing.services.common.controller_api import MotorVoltages, ThrustAndMoments
from lapwing.services.common.ports import PerRotor

CONTROLLER_OUTPUT = "controller_output"  # port within the autopilot

Wrench = tuple[float, float, float, float]
NO_WRENCH = (0.0, 0.0, 0.0, 0.0)


class ControllerOutput(NamedTuple):
    """Numbers of `MotorVoltages` or `ThrustAndMoments`."""

    to_motors: bool
    volts: PerRotor  # [V] of each motor
    wrench: Wrench  # thrust [N] and moments about body x, y, z [N m]
    roll_pitch: tuple[float, float]  # [rad] references, for the log


def no_output(rotors: int) -> ControllerOutput:
    """Return the output that stops the motors."""
    return ControllerOutput(True, (0.0,) * rotors, NO_WRENCH, (0.0, 0.0))


def parse_controller_output(output: Any, no_voltage: PerRotor) -> ControllerOutput:
    """Return the numbers of a `MotorVoltages` or `ThrustAndMoments`.

    Args:
        output: return value of a controller's step.
        no_voltage: 0 V for each motor.

    Raises:
        TypeError: the output has another type or contains no numbers.
        ValueError: a number is not finite.
    """
    if isinstance(output, MotorVoltages):
        to_motors, volts, wrench = True, _numbers("volts", output.volts, len(no_voltage)), NO_WRENCH
    elif isinstance(output, ThrustAndMoments):
        to_motors, volts, moments = False, no_voltage, _numbers("moments_body", output.moments_body, 3)
        wrench = (*_numbers("thrust", (output.thrust,), 1), *moments)
    else:
        raise TypeError(f"step returned {type(output).__name__}, expected MotorVoltages or ThrustAndMoments")
    return ControllerOutput(to_motors, volts, wrench, _numbers("roll_pitch", output.roll_pitch, 2))


def _numbers(name: str, values: Iterable[float], n: int) -> Any:
    try:
        numbers = tuple(map(float, values))
    except (TypeError, ValueError):
        numbers = ()
    if len(numbers) != n:
        raise TypeError(f"step returned {name} = {' '.join(repr(values).split())}, expected {n} number{'s' * (n > 1)}")
    if not all(map(math.isfinite, numbers)):
        raise ValueError(f"step returned {name} = {numbers}, which is not finite")
    return numbers


@overload_for(parse_controller_output, inline=True)
def _parse_controller_output(output: types.Type, no_voltage: types.Type) -> Callable:
    is_complete = len(output) == len(output.instance_class._fields)  # a compiled NamedTuple has no defaults filled in
    roll_pitch = "output[-1]" if is_complete else "(0.0, 0.0)"
    if output.instance_class is MotorVoltages:
        values = "True, output[0], (0.0, 0.0, 0.0, 0.0)"
    else:
        values = "False, no_voltage, (output[0], output[1][0], output[1][1], output[1][2])"
    return compile_source(
        "parse_controller_output(output, no_voltage)",
        {"ControllerOutput": ControllerOutput},
        f"return ControllerOutput({values}, {roll_pitch})",
    )


@always_inline
def command(
    law: control.Parameters,
    lift: float,
    moments: Vec3,
    voltage_max: float,
    requested: ControllerOutput,
    yaw: float,
    failed: int,
) -> Command:
    """Return the motor command in flight.

    Args:
        law: controller parameters with control allocation and motor model.
        lift: force along body z [N] of a collective of 1 N.
        moments: torques about body x, y, z [N m] of virtual controls of 1 N.
        voltage_max: [V].
        requested: output of the user's controller.
        yaw: setpoint [rad].
        failed: number of the failed rotor, from 1; 0: none.
    """
    if requested.to_motors:
        volts = clamp_to_range(requested.volts, voltage_max)
        thrust = thrusts_at(law.motor, volts)
    else:
        shares, w = active_allocation(law.shares, failed), requested.wrench
        collective = 1.0 / lift * w[0]
        desired = VirtualControls(collective, w[1] / moments[0], w[2] / moments[1], w[3] / moments[2])
        saturated = saturate(shares, desired, law.thrust_max, law.airmode)
        thrust = clamp_to_range(mix(shares, saturated), law.thrust_max)
        volts = voltages(law.motor, thrust)
    return Command(volts, thrust, requested.roll_pitch[0], requested.roll_pitch[1], yaw)
