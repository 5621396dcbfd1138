"""Output of the five bodies of a multirotor, with the forces in their hinges."""

from collections.abc import Callable
from typing import Any, NamedTuple

from numba import types

from lapwing.cosim.diagram.compiled_block import CONTINUE, InputSample
from lapwing.dynamics.effects import _hooks as hooks
from lapwing.dynamics.multibody.five_bodies import FiveBodies
from lapwing.dynamics.vehicles import multirotor_euler
from lapwing.dynamics.vehicles.multirotor_equations import MultirotorDrive, MultirotorParameters
from lapwing.dynamics.vehicles.multirotor_multibody_equations import joints
from lapwing.kernels import always_inline
from lapwing.kernels.codegen import generic
from lapwing.services.common.ports import BodyMotions, PerRotor


class FiveBodiesView(NamedTuple):
    """Parameters of the block."""

    vehicle: MultirotorParameters
    interval: float  # [s] length of a tick
    off: PerRotor  # [V] before the first command


@generic()
def on_se3(x: types.Type) -> Callable:
    """Return the bodies' poses on SE(3), from any coordinates."""
    if x.instance_class is FiveBodies:
        return lambda x: x
    return lambda x: multirotor_euler.five(x)


@always_inline
def step(p: FiveBodiesView, s: Any, tick: int, inputs: tuple[InputSample, ...]) -> tuple[Any, tuple[BodyMotions], int]:
    """Output the motions of the bodies at `tick`, and the loads of their hinges under the command of the tick."""
    actuators = inputs[0]
    command = actuators.value.motor_voltage if actuators.due else p.off
    g, memory = p.vehicle, s.vehicle.memory
    drive = MultirotorDrive(g, hooks.all_mass_properties(g.effects, memory, g.body), memory, command)
    x = on_se3(s.vehicle.motion)
    j = joints(drive, tick * p.interval, x)
    a, (b, c, d, e) = x.chassis, x.propellers
    sample = BodyMotions(
        (a.position_world, b.position_world, c.position_world, d.position_world, e.position_world),
        (a.attitude, b.attitude, c.attitude, d.attitude, e.attitude),
        (a.velocity_world, b.velocity_world, c.velocity_world, d.velocity_world, e.velocity_world),
        (a.omega_body, b.omega_body, c.omega_body, d.omega_body, e.omega_body),
        (j[0][0], j[1][0], j[2][0], j[3][0], j[4][0]),
        (j[0][1], j[1][1], j[2][1], j[3][1], j[4][1]),
    )
    return s, (sample,), CONTINUE
