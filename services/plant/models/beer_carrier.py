"""The crate that unloads its pack over the door, as the drone stands on the ground."""

import math
from collections.abc import Iterator
from typing import Any, ClassVar

from pydantic import Field

from dynamics.effects._types import Motion
from dynamics.lie.quaternion import exp
from dynamics.vector import Vec3, add, scale
from dynamics.vehicles import beer_carrier, beer_places
from dynamics.vehicles.beer_carrier import BeerCarrierParameters, BeerCarrierState, Surface
from messages import Vector3, VehicleState, header
from messages.topics import BODIES, CLOCK, POSE, TF, TRUTH, Topic
from services.plant import outputs
from services.plant.ending import Ending
from services.plant.marched import Marched, check_marched
from services.scene import Scene, Section
from services.sections import Exchange, Triple, Vehicle, can_have, needs, period

NOTHING = (0.0, 0.0, 0.0)
RPM = 2.0 * math.pi / 60.0  # [rad/s]
STIFFNESS, DAMPING = 2.0e4, 60.0  # [N/m], [N s/m] of one place of contact
Pair = tuple[float, float]  # static and dynamic friction


class BeerCarrier(Section):
    """The crate, its rollers, its door and the pack (theory.md, chapter 9)."""

    TABLE: ClassVar[str] = "beer_carrier"
    OPTIONAL: ClassVar[bool] = True
    pack_mass: float = Field(gt=0.0)  # [kg]
    pack_size: Triple  # [m] length, width, height
    gap: float = Field(default=0.01, ge=0.0)  # [m] between the pack and the shut door
    tilt_deg: float = Field(ge=0.0, lt=90.0)  # of the crate's floor, down towards the door
    floor_height: float = Field(gt=0.0)  # [m] of the hinge over the ground
    depth: float = Field(gt=0.0)  # [m] from the hinge to the rear wall
    width: float = Field(gt=0.0)  # [m] between the side walls
    roller_radius: float = Field(gt=0.0)  # [m]
    roller_spacing: float = Field(gt=0.0)  # [m]
    roller_rpm: float  # at the end of the ramp
    ramp_start: float = Field(ge=0.0)  # [s] when the rollers start and the door is unlocked
    ramp_duration: float = Field(gt=0.0)  # [s]
    door_length: float = Field(gt=0.0)  # [m]
    door_mass: float = Field(gt=0.0)  # [kg]
    door_spring: float = Field(ge=0.0)  # [N m/rad]
    door_preload: float = Field(ge=0.0)  # [rad] that the spring is wound up when the door is shut
    door_damping: float = Field(ge=0.0)  # [N m s/rad]
    door_lock: float = Field(default=50.0, gt=0.0)  # [N m/rad] of the lock and of the stop
    edge_radius: float = Field(default=0.003, gt=0.0)  # [m]
    pickup: float = Field(gt=0.0)  # [s] when somebody takes the pack away
    gravity: float = Field(default=9.81, ge=0.0)  # [m/s^2]
    roller_friction: Pair = Field(strict=False)
    door_friction: Pair = Field(strict=False)
    ground_friction: Pair = Field(strict=False)

    def check(self, scene: Scene) -> None:
        """Sizes are sizes, the pack fits into the crate, friction is lower in motion."""
        if not all(side > 0.0 for side in self.pack_size):
            raise ValueError(f"pack_size: expected three lengths above 0 m, got {list(self.pack_size)}")
        length, width, _ = self.pack_size
        if width > self.width or length + self.gap > self.depth:
            room = f"{self.depth:g} m deep and {self.width:g} m wide"
            raise ValueError(f"pack_size: a pack that fits into the crate, {room}, got {length:g} m by {width:g} m")
        for key in ("roller_friction", "door_friction", "ground_friction"):
            static, dynamic = getattr(self, key)
            if not 0.0 < dynamic <= static:
                raise ValueError(
                    f"{key}: expected [static, dynamic] with 0 < dynamic <= static, got {[static, dynamic]}"
                )


def check(scene: Scene) -> None:
    """The crate is described, and nothing asks of it what it cannot do."""
    needs(scene, "beer_carrier")
    can_have(scene)
    check_marched(scene, *system(scene))


def create(scene: Scene) -> "Unloading":
    """The plant of the crate."""
    return Unloading(scene)


def _surface(friction: Pair) -> Surface:
    return (STIFFNESS, DAMPING, *friction)


def system(scene: Scene) -> tuple[BeerCarrierParameters, BeerCarrierState]:
    """(parameters, state at the start)."""
    c = scene[BeerCarrier]
    length, width, height = c.pack_size
    m = c.pack_mass / 12.0
    inertia = (m * (width**2 + height**2), m * (length**2 + height**2), m * (length**2 + width**2))
    p = BeerCarrierParameters(
        c.pack_mass, (0.5 * length, 0.5 * width, 0.5 * height), inertia, math.radians(c.tilt_deg), c.floor_height,
        c.depth, 0.5 * c.width, c.roller_radius, c.roller_spacing, c.roller_rpm * RPM, c.ramp_start, c.ramp_duration,
        c.door_length, c.door_mass, c.door_spring, c.door_preload, c.door_damping, c.door_lock, c.edge_radius, c.pickup,
        c.gravity, _surface(c.roller_friction), _surface(c.door_friction), _surface(c.ground_friction),
    )  # fmt: skip
    return p, beer_carrier.initial_state(p, c.gap)


class Unloading:
    """The pack, of which the vehicle's own topics tell, the door, the rollers and the ground."""

    inputs = ()
    outputs = (TRUTH, POSE, TF, CLOCK, BODIES)

    def __init__(self, scene: Scene):
        self.finished = False
        self._end = Ending(scene)
        exchange = scene[Exchange]
        self._name, self._interval, self._interval_ns = scene[Vehicle].name, exchange.interval, exchange.interval_ns
        self._pose_every, self._bodies_every = period(scene, POSE), period(scene, BODIES)
        self._p, start = system(scene)
        self._marched = Marched(scene, self._p, start)
        self._names = ("pack", "door", *[f"roller{i + 1}" for i in range(beer_places.ROLLERS)], "ground")

    def prepare(self) -> None:
        """Compile or load the kernels."""
        beer_carrier.forces_on_pack(self._p, 0.0, self._marched.to(0))

    def step(self, tick: int) -> Iterator[tuple[Topic, Any]]:
        """Advance to `tick`."""
        state = self._marched.to(tick)
        self.finished = self._end.reached(tick)
        time_ns = tick * self._interval_ns
        pack = Motion(state.position_world, state.attitude, state.velocity_world, state.omega_body, ())
        yield (
            TRUTH,
            VehicleState(
                header(time_ns, outputs.WORLD),
                outputs.pose_of(pack),
                Vector3(*state.velocity_world),
                Vector3(*state.omega_body),
            ),
        )
        if tick % self._bodies_every == 0:
            yield BODIES, self._bodies(time_ns, tick * self._interval, state, pack)
        if tick % self._pose_every == 0:
            yield from outputs.whereabouts(time_ns, self._name, pack)

    def _bodies(self, time_ns: int, t: float, state: BeerCarrierState, pack: Motion) -> Any:
        """Every body with the contact force on it; the door lies along z of its frame."""
        p, tilt = self._p, self._p.tilt
        rollers, door, ground, walls = beer_carrier.forces_on_pack(p, t, state)
        forward, upward = (math.cos(tilt), 0.0, -math.sin(tilt)), (math.sin(tilt), 0.0, math.cos(tilt))
        hinge = (0.0, 0.0, p.floor_height)
        turning = (0.0, beer_places.roller_speed(p, t), 0.0)
        motions, forces = [pack], [_sum(*rollers, door, ground, walls)]
        motions.append(Motion(hinge, exp((0.0, tilt + state.door[0], 0.0)), NOTHING, (0.0, state.door[1], 0.0), ()))
        forces.append(scale(-1.0, door))
        for i in range(beer_places.ROLLERS):
            behind = scale(-(i + 0.5) * p.roller_spacing, forward)
            place = add(hinge, add(behind, scale(p.roller_radius, upward)))
            motions.append(Motion(place, exp((0.0, tilt, 0.0)), NOTHING, turning, ()))
            forces.append(scale(-1.0, _sum(*rollers[2 * i : 2 * i + 2])))
        motions.append(Motion(NOTHING, exp(NOTHING), NOTHING, NOTHING, ()))
        forces.append(scale(-1.0, ground))
        return outputs.bodies(time_ns, self._names, motions, forces)


def _sum(*forces: Vec3) -> Vec3:
    total = NOTHING
    for force in forces:
        total = add(total, force)
    return total
