"""The gyrostat satellite: four cases by which numbers are zero, and a control towards an attitude.

Rotors blocked: no `rotor_momentum`. Spinning: with it. Friction: with `damping`. Feedback: with gains.
"""

from collections.abc import Iterator
from typing import Any, ClassVar

from pydantic import Field

from dynamics.effects._types import Motion
from dynamics.lie.quaternion import Quaternion, exp
from dynamics.vehicles.gyrostat import GyrostatParameters
from dynamics.vehicles.rigid_body import RigidBody
from messages import Vector3, VehicleState, header
from messages.topics import CLOCK, POSE, TF, TRUTH, Topic
from services.plant import outputs
from services.plant.ending import Ending
from services.plant.marched import Marched, check_marched
from services.scene import Scene, Section, WrongKeyError
from services.sections import Exchange, Triple, Vehicle, can_have, needs, period

NOTHING = (0.0, 0.0, 0.0)
Turn = tuple[float, float, float, float]


class Gyrostat(Section):
    """The satellite, its rotors and its control (theory.md, eqs. (7.6) to (7.9))."""

    TABLE: ClassVar[str] = "gyrostat"
    OPTIONAL: ClassVar[bool] = True
    inertia: Triple  # [kg m^2] principal moments of the platform with its rotors
    rotor_momentum: Triple = NOTHING  # [kg m^2/s] of the rotors, the third its mean
    forcing_amplitude: float = 0.0  # of the third rotor's speed, relative
    forcing_frequency: float = Field(default=0.0, ge=0.0)  # [rad/s]
    damping: float = Field(default=0.0, ge=0.0)  # [N m s] about z
    linear_gain: Triple = NOTHING  # [N m s]
    cubic_gain: Triple = NOTHING  # [N m s^3]
    desired_rate: float = 0.0  # [rad/s] about each axis
    attitude_gain: float = Field(default=0.0, ge=0.0)  # [N m] towards `target_rotation`
    rate_gain: float = Field(default=0.0, ge=0.0)  # [N m s]
    target_rotation: Triple = NOTHING  # rotation vector of the wanted attitude [rad]
    initial_attitude: Turn = Field(default=(1.0, 0.0, 0.0, 0.0), strict=False)  # quaternion w, x, y, z
    initial_rate: Triple  # [rad/s] body frame


def check(scene: Scene) -> None:
    """The satellite is described, with sound numbers, and nothing asks of it what it cannot do."""
    needs(scene, "gyrostat")
    can_have(scene)
    check_marched(scene, *_system(scene))


def create(scene: Scene) -> "Satellite":
    """The plant of the satellite."""
    return Satellite(scene)


def _system(scene: Scene) -> tuple[GyrostatParameters, RigidBody]:
    g = scene[Gyrostat]
    for axis, moment in zip("xyz", g.inertia, strict=True):
        if not moment > 0.0:
            raise WrongKeyError("gyrostat.inertia", f"expected principal moments above 0, got {moment:g} about {axis}")
    p = GyrostatParameters(
        g.inertia, g.rotor_momentum, g.forcing_amplitude, g.forcing_frequency, g.damping, g.linear_gain, g.cubic_gain,
        g.desired_rate, g.attitude_gain, g.rate_gain, exp(g.target_rotation),
    )  # fmt: skip
    return p, RigidBody(Quaternion(*g.initial_attitude), g.initial_rate)


class Satellite:
    """Turns freely about a fixed centre."""

    inputs = ()
    outputs = (TRUTH, POSE, TF, CLOCK)

    def __init__(self, scene: Scene):
        self.finished = False
        self._end = Ending(scene)
        self._name, self._interval_ns = scene[Vehicle].name, scene[Exchange].interval_ns
        self._pose_every = period(scene, POSE)
        self._marched = Marched(scene, *_system(scene))

    def prepare(self) -> None:
        """Compile or load the kernel."""
        self._marched.to(0)

    def step(self, tick: int) -> Iterator[tuple[Topic, Any]]:
        """Advance to `tick`."""
        state = self._marched.to(tick)
        self.finished = self._end.reached(tick)
        time_ns = tick * self._interval_ns
        motion = Motion(NOTHING, state.attitude, NOTHING, state.omega_body, ())
        yield (
            TRUTH,
            VehicleState(
                header(time_ns, outputs.WORLD), outputs.pose_of(motion), angular_velocity=Vector3(*state.omega_body)
            ),
        )
        if tick % self._pose_every == 0:
            yield from outputs.whereabouts(time_ns, self._name, motion)
