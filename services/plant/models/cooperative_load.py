"""Quadrotors that carry a point mass by rigid links: thrusts and moments in, the state of every body out."""

from collections.abc import Iterator
from typing import Any

from dynamics.effects._types import Motion
from dynamics.kernel import kernel
from dynamics.lie.quaternion import NO_ROTATION
from dynamics.lie.ts2 import Swing
from dynamics.unrolled import each
from dynamics.vehicles.cooperative_load import (
    CooperativeLoadParameters,
    CooperativeLoadState,
    LiftCommand,
    quad_position,
    quad_velocity,
)
from messages import LiftCommand as LiftMessage
from messages import Vector3, VehicleState, header
from messages.topics import BODIES, CLOCK, LIFT, POSE, TF, TRUTH, Topic
from services.lockstep import Input
from services.plant import outputs
from services.plant.ending import Ending
from services.plant.marched import Marched, check_marched
from services.scene import Scene, WrongKeyError
from services.sections import CooperativeLoad, Exchange, Rates, Vehicle, can_have, needs, period

NOTHING = (0.0, 0.0, 0.0)
LOAD = "load"


def check(scene: Scene) -> None:
    """The formation is described, somebody controls it and gets its state at every tick."""
    needs(scene, "cooperative_load", "formation")
    can_have(scene)
    rate = scene[Exchange].rate
    if scene[Rates].bodies != rate:
        raise WrongKeyError("rates.bodies", f"expected exchange.rate = {rate} Hz, at which the control works")
    check_marched(scene, *_system(scene))


def create(scene: Scene) -> "CarriedLoad":
    """The plant of the formation."""
    return CarriedLoad(scene)


def _system(scene: Scene) -> tuple[CooperativeLoadParameters, CooperativeLoadState]:
    c = scene[CooperativeLoad]
    n = len(c.link_length)
    off = LiftCommand((0.0,) * n, (NOTHING,) * n)
    p = CooperativeLoadParameters(c.quad_mass, c.quad_inertia, c.link_length, c.load_mass, c.gravity, off)
    links = tuple(Swing(direction, NOTHING) for direction in c.link_start)
    return p, CooperativeLoadState(c.load_start, c.load_velocity_start, (NO_ROTATION,) * n, (NOTHING,) * n, links)


@kernel
def drive(p, thrust, moment_body):
    """Put a command into the cell of the parameters."""
    g = p.value
    given = LiftCommand(thrust, moment_body)
    p.value = CooperativeLoadParameters(g.quad_mass, g.quad_inertia, g.link_length, g.load_mass, g.gravity, given)


@kernel
def quadrotors(p, x):
    """(positions [m], velocities [m/s]) of the quadrotors in the world."""
    return each(quad_position, x.link, p.value, x), each(quad_velocity, x.link, p.value, x)


class CarriedLoad:
    """The load, from whose place and speed the vehicle's own topics tell, and its carriers."""

    outputs = (TRUTH, POSE, TF, CLOCK, BODIES)

    def __init__(self, scene: Scene):
        self.inputs = (Input(LIFT, scene[Exchange].loop_delay),)
        self.finished = False
        self._end = Ending(scene)
        self._name, self._interval_ns = scene[Vehicle].name, scene[Exchange].interval_ns
        self._pose_every = period(scene, POSE)
        p, start = _system(scene)
        self._names = (LOAD, *[f"quad{i + 1}" for i in range(len(p.link_length))])
        self._marched = Marched(scene, p, start)

    def prepare(self) -> None:
        """Compile or load the kernels."""
        state = self._marched.to(0)
        drive(self._marched.parameters, (0.0,) * len(state.link), (NOTHING,) * len(state.link))
        quadrotors(self._marched.parameters, state)

    def step(self, tick: int, lift: LiftMessage | None) -> Iterator[tuple[Topic, Any]]:
        """Advance to `tick` under the command given; before the first one nobody lifts."""
        if lift:
            drive(self._marched.parameters, lift.thrust, tuple((m.x, m.y, m.z) for m in lift.moment))
        state = self._marched.to(tick)
        self.finished = self._end.reached(tick)
        time_ns = tick * self._interval_ns
        load = Motion(state.load_position, NO_ROTATION, state.load_velocity, NOTHING, ())
        places, speeds = quadrotors(self._marched.parameters, state)
        carriers = [Motion(*m, ()) for m in zip(places, state.attitude, speeds, state.omega_body, strict=True)]
        yield TRUTH, VehicleState(header(time_ns, outputs.WORLD), outputs.pose_of(load), Vector3(*state.load_velocity))
        yield BODIES, outputs.bodies(time_ns, self._names, [load, *carriers])
        if tick % self._pose_every == 0:
            yield from outputs.whereabouts(time_ns, self._name, load)
