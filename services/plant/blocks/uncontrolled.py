"""Plant without inputs: a system of lapwing/dynamics/vehicles, advanced by any integrator."""

from collections.abc import Callable
from typing import Any, NamedTuple

from numba import types

from lapwing.cosim.diagram.compiled_block import InputSample
from lapwing.dynamics.integrators import StepDoubling, integrate_fixed, integrate_step_doubling, rate
from lapwing.dynamics.lie.quaternion import Quaternion
from lapwing.dynamics.vector import ZERO, Vec3
from lapwing.dynamics.vehicles.rigid_body import RigidBody
from lapwing.kernels import DispatchTable, always_inline
from lapwing.kernels.codegen import dispatch, generic
from lapwing.kernels.state_tree import finite
from lapwing.papers.gyrostat import GyrostatParameters
from lapwing.papers.quadrotor_os4 import Os4Parameters, Os4State
from lapwing.papers.unloading.unloading import UnloadingParameters, UnloadingState
from lapwing.services.common.ports import TrueState
from lapwing.services.plant.blocks.termination import termination_status


class AutonomousPlant(NamedTuple):
    """Parameters of the block: the system and its integration."""

    system: Any  # parameters, a class of lapwing.dynamics.integrators.RATES
    method: Any  # `Method()` of an integrator, or `StepDoubling` with error control
    steps: int  # per tick
    step: float  # [s]
    interval: float  # [s] length of a tick
    last: int  # last tick of the run


OUTPUT_FUNCTIONS = DispatchTable()
"""The compiled function (p, t, x) -> port values of state x at time t [s], by class of a system's parameters p."""
outputs_of = dispatch(OUTPUT_FUNCTIONS)


@generic(inline=True)
def _advance(method: types.Type, p: types.Type, t: types.Type, x: types.Type) -> Callable:
    if getattr(method, "instance_class", None) is StepDoubling:
        return lambda method, p, t, x: integrate_step_doubling(method, p.system, t, x, p.step, t + p.interval)
    return lambda method, p, t, x: integrate_fixed(method, p.system, t, x, p.step, p.steps)


@always_inline
def step(p: AutonomousPlant, s: Any, tick: int, inputs: tuple[InputSample, ...]) -> tuple[Any, tuple, int]:
    """Integrate to `tick`; tick 0 is the initial state."""
    x = s
    if tick > 0:
        x = _advance(p.method, p, (tick - 1) * p.interval, x)
    return x, outputs_of(p.system, tick * p.interval, x), termination_status(tick, p.last, finite(x))


@always_inline
def motion_alone(position: Vec3, attitude: Quaternion, velocity: Vec3, omega_body: Vec3) -> TrueState:
    """Return the true state of a body without rotors."""
    return TrueState(position, attitude, velocity, omega_body, ZERO, (), (), (), (), (), (), ZERO, 0.0, False, ZERO)


@always_inline
def outputs_of_gyrostat(p: GyrostatParameters, t: float, x: RigidBody) -> tuple[TrueState]:
    """Return attitude and angular velocity of the satellite, which rotates about a fixed centre."""
    return (motion_alone(ZERO, x.attitude, ZERO, x.omega_body),)


@always_inline
def outputs_of_unloading(p: UnloadingParameters, t: float, x: UnloadingState) -> tuple[TrueState]:
    """Return the motion of the pack."""
    return (motion_alone(x.position_world, x.attitude, x.velocity_world, x.omega_body),)


@always_inline
def outputs_of_os4(p: Os4Parameters, t: float, x: Os4State) -> tuple[TrueState]:
    """Return the true state with acceleration, rotor thrusts and torques."""
    a, b, c, d = x.rotor_speed
    k, m = p.lift_constant, p.drag_constant
    return (
        TrueState(
            x.position_world, x.attitude, x.velocity_world, x.omega_body, rate(p, t, x).velocity_world,
            x.rotor_speed, (), (), (),
            (k * a * a, k * b * b, k * c * c, k * d * d), (m * a * a, m * b * b, m * c * c, m * d * d),
            ZERO, 0.0, False, ZERO,
        ),
    )  # fmt: skip


OUTPUT_FUNCTIONS[GyrostatParameters] = outputs_of_gyrostat
OUTPUT_FUNCTIONS[UnloadingParameters] = outputs_of_unloading
OUTPUT_FUNCTIONS[Os4Parameters] = outputs_of_os4
