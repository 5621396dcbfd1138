"""The formation's control as a service: every body's state in, thrusts and moments out."""

from collections.abc import Iterator
from typing import Any

from dynamics.kernel import kernel
from dynamics.lie.quaternion import Quaternion
from dynamics.unrolled import each
from dynamics.vector import norm, scale
from dynamics.vehicles.cooperative_control import FormationControl, formation_control
from dynamics.vehicles.cooperative_load import CooperativeLoadParameters, CooperativeLoadState
from messages import BodyStates, LiftCommand, Vector3, header
from messages.topics import BODIES, LIFT, Topic
from services.formation import links
from services.formation.config import Formation as Config
from services.lockstep import Input
from services.scene import Scene
from services.sections import CooperativeLoad, Exchange


def create(scene: Scene) -> "Formation | None":
    """The control of the scene's `[formation]`; None where there is none."""
    return Formation(scene) if scene.has(Config) else None


@kernel
def steer(p, t, positions, velocities, attitudes, omegas):
    """The command at t; the load's position and velocity come first, the quadrotors' next."""
    load, speed = positions[0], velocities[0]
    found = each(links.link, attitudes, load, speed, positions[1:], velocities[1:])
    return formation_control(p, t, CooperativeLoadState(load, speed, attitudes, omegas, found))


class Formation:
    """Controls from the true state of every body."""

    inputs = (Input(BODIES),)
    outputs = (LIFT,)

    def __init__(self, scene: Scene):
        c, wanted = scene[CooperativeLoad], scene[Config]
        self._interval, self._interval_ns = scene[Exchange].interval, scene[Exchange].interval_ns
        law = FormationControl(
            wanted.load_position, wanted.load_velocity, wanted.link, wanted.link_rate, wanted.attitude,
            wanted.attitude_rate, wanted.epsilon, wanted.path,
            tuple(scale(1.0 / norm(d), d) for d in wanted.link_direction),
        )  # fmt: skip
        self._parameters = CooperativeLoadParameters(
            c.quad_mass, c.quad_inertia, c.link_length, c.load_mass, c.gravity, law
        )
        self._start = c

    def prepare(self) -> None:
        """Compile or load the kernel."""
        n = len(self._start.link_length)
        upright, still = Quaternion(1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
        places = (still, *[scale(-1.0, d) for d in self._start.link_start])
        steer(self._parameters, 0.0, places, (still,) * (n + 1), (upright,) * n, (still,) * n)

    def step(self, tick: int, seen: BodyStates) -> Iterator[tuple[Topic, Any]]:
        """The command at `tick`."""
        turns = [pose.orientation for pose in seen.pose[1:]]
        given = steer(
            self._parameters,
            tick * self._interval,
            tuple((p.position.x, p.position.y, p.position.z) for p in seen.pose),
            tuple((v.x, v.y, v.z) for v in seen.velocity),
            tuple(Quaternion(q.w, q.x, q.y, q.z) for q in turns),
            tuple((o.x, o.y, o.z) for o in seen.angular_velocity[1:]),
        )
        moments = tuple(Vector3(*m) for m in given.moment_body)
        yield LIFT, LiftCommand(header(tick * self._interval_ns, "body"), given.thrust, moments)
