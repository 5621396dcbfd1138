"""What the other vehicles of a fleet may know of a multirotor, after it has stepped."""

from typing import Any, NamedTuple

from cosim.part import GO_ON, Received
from dynamics.effects import _hooks as hooks
from dynamics.effects._axes import in_world, thrust_wrench
from dynamics.effects._interaction import Presence
from dynamics.effects._types import Loads
from dynamics.kernel import leaf
from dynamics.lie.quaternion import rotation_matrix
from dynamics.vehicles.multirotor import MultirotorParameters


class PresenceView(NamedTuple):
    """The vehicle that is told of."""

    vehicle: MultirotorParameters
    like: Presence  # with the numbers that do not change


@leaf
def step(p: PresenceView, s: Any, tick: int, inputs: tuple[Received, ...]) -> tuple[Any, tuple[Presence], int]:
    """The presence at `tick`, by the truth of that tick."""
    truth, vehicle = inputs[0].value, p.vehicle
    body = hooks.all_body(vehicle.effects, s.vehicle.memory, vehicle.body)
    thrust, _ = thrust_wrench(vehicle.layout, Loads(truth.rotor_thrust, truth.rotor_torque))
    thrust_world = in_world(thrust, rotation_matrix(truth.attitude))
    told = Presence(
        truth.position_world, truth.velocity_world, thrust_world, body.mass, truth.air_density,
        p.like.radius, p.like.restitution, p.like.disc_radius,
    )  # fmt: skip
    return s, (told,), GO_ON
