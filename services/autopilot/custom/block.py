"""Controller block with a user-defined controller between land detector and control allocation."""

import sys
from collections.abc import Callable
from typing import Any, NamedTuple

from numba import types

from lapwing.cosim.diagram.compiled_block import CONTINUE, InputSample
from lapwing.dynamics.vector import Vec3
from lapwing.kernels import always_inline, python_function
from lapwing.kernels.codegen import overload_for
from lapwing.services.autopilot import motor_failure
from lapwing.services.autopilot.block import Controller, estimate_of, outcome, setpoint_of
from lapwing.services.autopilot.custom.controller_output import NO_WRENCH, ControllerOutput, command, demand, off
from lapwing.services.autopilot.interface import PerRotor
from lapwing.services.autopilot.land_detector import FLYING, INITIAL_STAGE, LandedState, advance_stage
from lapwing.services.autopilot.mixer import at_rest
from lapwing.services.common.ports import Reference, StateEstimate


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

    stage: LandedState
    own: Any
    held: ControllerOutput  # last output of the user's controller
    watch: motor_failure.State
    still_from: int  # [tick]
    charge: float  # of the battery, fraction; NaN: unknown


def start(p: CustomController) -> CustomState:
    """Return the initial state."""
    watch = p.common.watch
    held = off(len(watch.roll_arm))
    return CustomState(INITIAL_STAGE, p.own_start, held, python_function(motor_failure.start)(watch), 0, float("nan"))


def _ask(
    p: Any,
    s: Any,
    time: float,
    estimate: StateEstimate,
    setpoint: Reference,
    by_port: tuple[InputSample, ...],
    none: PerRotor,
) -> tuple[Any, ControllerOutput]:
    """Call `step` of the user's module, or read the port."""
    raise NotImplementedError("compiled code only")


@always_inline
def _demanded(given: tuple, none: PerRotor) -> tuple[Any, ControllerOutput]:
    """Return state and parsed output of the user's step."""
    return given[0], demand(given[1], none)


@overload_for(_ask, inline=True)
def _ask_of(
    p: types.Type,
    s: types.Type,
    time: types.Type,
    estimate: types.Type,
    setpoint: types.Type,
    by_port: types.Type,
    none: types.Type,
) -> Callable:
    if p.instance_class is PythonControllerProxy:
        return lambda p, s, time, estimate, setpoint, by_port, none: (s, by_port[0].value)
    found = sys.modules[p.instance_class.__module__].step
    return lambda p, s, time, estimate, setpoint, by_port, none: _demanded(found(p, s, time, estimate, setpoint), none)


@always_inline
def step(
    p: CustomController, s: CustomState, tick: int, inputs: tuple[InputSample, ...]
) -> tuple[CustomState, tuple, int]:
    """Compute the motor command at `tick`."""
    c = p.common
    e, order, battery = inputs[0].value, inputs[1].value, inputs[2]
    wanted = inputs[3].value if order.follow else order.reference
    stage, watched, still_from = s.stage, s.watch, s.still_from
    if order.restart_at == tick:
        stage, watched, still_from = INITIAL_STAGE, motor_failure.start(c.watch), tick + c.bounce
    charge = battery.value.charge if battery.due else s.charge
    stage = advance_stage(stage, c.law.value.resting_height, estimate_of(e), setpoint_of(wanted), c.interval)
    own, held, none = s.own, s.held, at_rest(c.law.value.shares[0])
    if stage.name != FLYING:
        own, held = p.own_start, ControllerOutput(True, none, NO_WRENCH, (0.0, 0.0))
    elif tick % p.every == 0:
        own, held = _ask(p.own, own, tick * c.interval, e, wanted, inputs[4:], none)
    given = command(c.law.value, p.lift, p.moments, p.voltage_max, held, wanted.yaw, stage.name, watched.failed)
    watched, outputs = outcome(c, watched, still_from, charge, order, e, wanted, stage.name, given)
    return CustomState(stage, own, held, watched, still_from, charge), outputs, CONTINUE
