"""Output of a multirotor's state for the other vehicles of a fleet, after it has stepped."""

from typing import Any, NamedTuple

from lapwing.cosim.diagram.compiled_block import CONTINUE, InputSample
from lapwing.dynamics.effects import _hooks as hooks
from lapwing.dynamics.effects._axes import in_world, thrust_wrench
from lapwing.dynamics.effects._types import Loads
from lapwing.dynamics.effects._vehicle_interaction import NeighbourState
from lapwing.dynamics.lie.quaternion import rotation_matrix
from lapwing.dynamics.vector import ZERO, Mat3, add, apply, cross
from lapwing.dynamics.vehicles.multirotor_equations import MultirotorParameters
from lapwing.dynamics.vehicles.newton_euler import angular_acceleration
from lapwing.kernels import always_inline


class NeighbourStateOutput(NamedTuple):
    """Parameters of the block."""

    vehicle: MultirotorParameters
    example: NeighbourState  # prototype with the constant fields
    interval: float  # [s] length of a tick


@always_inline
def _inverse_inertia_world(body: Any, R: Mat3) -> Mat3:
    """Return the inverse inertia [1/(kg m^2)] along the world's axes, row by row: it is symmetric."""
    x = apply(R, angular_acceleration(body, ZERO, (R[0], R[1], R[2])))
    y = apply(R, angular_acceleration(body, ZERO, (R[3], R[4], R[5])))
    z = apply(R, angular_acceleration(body, ZERO, (R[6], R[7], R[8])))
    return (x[0], x[1], x[2], y[0], y[1], y[2], z[0], z[1], z[2])


@always_inline
def step(
    p: NeighbourStateOutput, s: Any, tick: int, inputs: tuple[InputSample, ...]
) -> tuple[Any, tuple[NeighbourState], int]:
    """Output the neighbour state at `tick` from the true state."""
    truth, vehicle = inputs[0].value, p.vehicle
    body = hooks.all_mass_properties(vehicle.effects, s.vehicle.memory, vehicle.body)
    thrust, _ = thrust_wrench(vehicle.layout, Loads(truth.rotor_thrust, truth.rotor_torque))
    R, hook, omega = rotation_matrix(truth.attitude), p.example.hook_body, truth.omega_body
    turning = cross(omega, hook)
    swinging = add(cross(truth.angular_acceleration_body, hook), cross(omega, turning))
    sample = NeighbourState(
        truth.position_world, truth.velocity_world, in_world(thrust, R), body.mass, truth.air_density,
        p.example.radius, p.example.restitution, p.example.disc_radius,
        hook, add(truth.position_world, apply(R, hook)), add(truth.velocity_world, apply(R, turning)),
        add(truth.acceleration_world, apply(R, swinging)), truth.wind_world, tick * p.interval, False,
        p.example.friction, apply(R, omega), _inverse_inertia_world(body, R),
    )  # fmt: skip
    return s, (sample,), CONTINUE
