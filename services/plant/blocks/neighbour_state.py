"""What the other vehicles of a fleet may know of a multirotor, after it has stepped."""

from typing import Any, NamedTuple

from lapwing.cosim.diagram.compiled_block import CONTINUE, InputSample
from lapwing.dynamics.effects import _hooks as hooks
from lapwing.dynamics.effects._axes import in_world, thrust_wrench
from lapwing.dynamics.effects._types import Loads
from lapwing.dynamics.effects._vehicle_interaction import NeighbourState
from lapwing.dynamics.lie.quaternion import rotation_matrix
from lapwing.dynamics.vector import add, apply, cross
from lapwing.dynamics.vehicles.multirotor_equations import MultirotorParameters
from lapwing.kernels import always_inline


class PresenceView(NamedTuple):
    """The vehicle that is told of."""

    vehicle: MultirotorParameters
    like: NeighbourState  # with the numbers that do not change
    interval: float  # [s] a tick


@always_inline
def step(p: PresenceView, s: Any, tick: int, inputs: tuple[InputSample, ...]) -> tuple[Any, tuple[NeighbourState], int]:
    """The presence at `tick`, by the truth of that tick."""
    truth, vehicle = inputs[0].value, p.vehicle
    body = hooks.all_mass_properties(vehicle.effects, s.vehicle.memory, vehicle.body)
    thrust, _ = thrust_wrench(vehicle.layout, Loads(truth.rotor_thrust, truth.rotor_torque))
    R, hook, omega = rotation_matrix(truth.attitude), p.like.hook_body, truth.omega_body
    turning = cross(omega, hook)
    swinging = add(cross(truth.angular_acceleration_body, hook), cross(omega, turning))
    told = NeighbourState(
        truth.position_world, truth.velocity_world, in_world(thrust, R), body.mass, truth.air_density,
        p.like.radius, p.like.restitution, p.like.disc_radius,
        hook, add(truth.position_world, apply(R, hook)), add(truth.velocity_world, apply(R, turning)),
        add(truth.acceleration_world, apply(R, swinging)), truth.wind_world, tick * p.interval, False,
    )  # fmt: skip
    return s, (told,), CONTINUE
