"""Controller block with a user-defined controller between land detector and control allocation."""

from collections.abc import Callable
from typing import Any, NamedTuple

from numba import types

from lapwing.cosim.diagram.compiled_block import CONTINUE, InputSample
from lapwing.dynamics.vector import Vec3
from lapwing.kernels import DispatchTable, always_inline, python_function
from lapwing.kernels.cell import read
from lapwing.kernels.codegen import dispatch, generic
from lapwing.services.autopilot import motor_failure
from lapwing.services.autopilot.block import NO_READING, Controller, block_outputs, motors_off, start_step
from lapwing.services.autopilot.custom.controller_output import (
    NO_WRENCH,
    ControllerOutput,
    command,
    no_output,
    parse_controller_output,
)
from lapwing.services.autopilot.mixer import zero_thrust
from lapwing.services.common.ports import BatteryReading, PerRotor


class PythonControllerProxy(NamedTuple):
    """Parameters of a Python controller, whose output arrives at a port."""

    rate: float


class CustomController(NamedTuple):
    """Parameters of the block."""

    common: Controller
    own: Any  # parameters of a compiled controller, or `PythonControllerProxy`
    own_start: Any  # its state at take-off
    every: int  # [ticks] between its steps
    lift: float  # force along body z [N] of a collective of 1 N
    moments: Vec3  # torques about body x, y, z [N m] of virtual controls of 1 N
    voltage_max: float  # [V]


class CustomState(NamedTuple):
    """State of the block."""

    own: Any
    held: ControllerOutput  # last output of the user's controller
    failure_detector: motor_failure.State
    still_from: int  # [tick]
    battery: BatteryReading


def start(p: CustomController) -> CustomState:
    """Return the initial state."""
    parameters = read(p.common.failure_detector)
    held, detector = no_output(len(parameters.roll)), python_function(motor_failure.start)(parameters)
    return CustomState(p.own_start, held, detector, 0, NO_READING)


@always_inline
def _parse_output(result: tuple, no_voltage: PerRotor) -> tuple[Any, ControllerOutput]:
    """Return the state and the parsed output of the user's step."""
    return result[0], parse_controller_output(result[1], no_voltage)


_user_step = dispatch(DispatchTable("step"))


@generic(inline=True)
def _call_user_step(
    p: types.Type,
    s: types.Type,
    time: types.Type,
    estimate: types.Type,
    setpoint: types.Type,
    by_port: types.Type,
    no_voltage: types.Type,
) -> Callable:
    """Call `step` of the user's module, or read the port."""
    if p.instance_class is PythonControllerProxy:
        return lambda p, s, time, estimate, setpoint, by_port, no_voltage: (s, by_port[0].value)
    return lambda p, s, time, estimate, setpoint, by_port, no_voltage: _parse_output(
        _user_step(p, s, time, estimate, setpoint), no_voltage
    )


@always_inline
def step(
    p: CustomController, s: CustomState, tick: int, inputs: tuple[InputSample, ...]
) -> tuple[CustomState, tuple, int]:
    """Compute the motor command at `tick`."""
    c = p.common
    i = start_step(c, s, tick, inputs)
    e, setpoint, law = i.estimate, i.setpoint, c.law.value
    own, held, no_voltage = s.own, s.held, zero_thrust(law.shares[0])
    if not i.flying:
        own, held = p.own_start, ControllerOutput(True, no_voltage, NO_WRENCH, (0.0, 0.0))
    elif tick % p.every == 0:
        own, held = _call_user_step(p.own, own, tick * c.interval, e, setpoint, inputs[4:], no_voltage)
    motor_command = motors_off(law, setpoint)
    if i.flying:
        failed = i.failure_detector.failed
        motor_command = command(law, p.lift, p.moments, p.voltage_max, held, setpoint.yaw, failed)
    detector, outputs = block_outputs(c, i, motor_command)
    return CustomState(own, held, detector, i.still_from, i.battery), outputs, CONTINUE
