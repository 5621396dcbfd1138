"""Crate that unloads its pack through the door while the drone is on the ground."""

import math
from typing import ClassVar

from pydantic import Field

from lapwing.cosim.config.run_config import ServiceConfig
from lapwing.cosim.scene import Scene, SceneTable
from lapwing.dynamics.config_error import ConfigError
from lapwing.papers.unloading import unloading
from lapwing.papers.unloading.unloading import Surface, UnloadingParameters, UnloadingState
from lapwing.services.common.ports import TrueState
from lapwing.services.common.schemas.communication_schema import Communication
from lapwing.services.common.schemas.run_schema import Triple
from lapwing.services.plant.blocks import unloading_bodies
from lapwing.services.plant.blocks.unloading_bodies import UnloadingView
from lapwing.services.plant.models._common import autonomous, check_system, reject_other_tables, require_tables

RPM = 2.0 * math.pi / 60.0  # [rad/s]
STIFFNESS, DAMPING = 2.0e4, 60.0  # [N/m], [N s/m] of a contact point
Pair = tuple[float, float]  # static and dynamic friction


class Unloading(SceneTable):
    """The crate, its rollers, its door and the pack (theory, chapter 9)."""

    TABLE: ClassVar[str] = "unloading"
    OPTIONAL: ClassVar[bool] = True
    pack_mass: float = Field(gt=0.0)  # [kg] of one pack
    pack_size: Triple  # [m] length, width, height
    gap: float = Field(default=0.01, ge=0.0)  # [m] between the pack and the shut door
    tilt_deg: float = Field(ge=0.0, lt=90.0)  # [deg] of the crate's floor, down towards the door
    floor_height: float = Field(gt=0.0)  # [m] of the hinge over the ground
    depth: float = Field(gt=0.0)  # [m] from the hinge to the rear wall
    width: float = Field(gt=0.0)  # [m] between the side walls
    roller_radius: float = Field(gt=0.0)  # [m] of the floor's rollers
    roller_spacing: float = Field(gt=0.0)  # [m] distance between their axes
    roller_rpm: float  # [rpm] at the end of the ramp
    ramp_start: float = Field(ge=0.0)  # [s] start of the rollers, and unlocking of the door
    ramp_duration: float = Field(gt=0.0)  # [s] time of the rollers' run-up
    door_length: float = Field(gt=0.0)  # [m] from hinge to edge
    door_mass: float = Field(gt=0.0)  # [kg] of the door
    door_spring: float = Field(ge=0.0)  # [N m/rad] stiffness of its hinge
    door_preload: float = Field(ge=0.0)  # [rad] twist of the spring with the door shut
    door_damping: float = Field(ge=0.0)  # [N m s/rad] of its hinge
    door_lock: float = Field(default=50.0, gt=0.0)  # [N m/rad] of the lock and of the stop
    edge_radius: float = Field(default=0.003, gt=0.0)  # [m] of a pack's edges
    pickup: float = Field(gt=0.0)  # [s] removal of the pack
    gravity: float = Field(default=9.81, ge=0.0)  # [m/s^2] acceleration of free fall
    roller_friction: Pair = Field(strict=False)  # coefficients, static and dynamic, of pack on rollers
    door_friction: Pair = Field(strict=False)  # coefficients, static and dynamic, of pack on door
    ground_friction: Pair = Field(strict=False)  # coefficients, static and dynamic, of pack on ground

    def check(self, scene: Scene) -> None:
        """Check that sizes are positive, the pack fits into the crate, and friction is lower in motion."""
        if not all(side > 0.0 for side in self.pack_size):
            raise ConfigError("unloading.pack_size", f"got {list(self.pack_size)}", "three lengths above 0 m")
        length, width, _ = self.pack_size
        if width > self.width or length + self.gap > self.depth:
            room = f"{self.depth:g} m deep and {self.width:g} m wide"
            expected = f"a pack that fits into the crate, {room}"
            raise ConfigError("unloading.pack_size", f"got {length:g} m by {width:g} m", expected)
        for key in ("roller_friction", "door_friction", "ground_friction"):
            static, dynamic = getattr(self, key)
            if not 0.0 < dynamic <= static:
                expected = "[static, dynamic] with 0 < dynamic <= static"
                raise ConfigError(f"unloading.{key}", f"got {[static, dynamic]}", expected)


def check(scene: Scene) -> None:
    """Check that the scene describes the crate and has no table that it cannot use."""
    require_tables(scene, "unloading")
    reject_other_tables(scene)
    check_system(scene, *system(scene))


def resolve(scene: Scene) -> ServiceConfig:
    """Return the configuration of the crate's plant."""
    p, start = system(scene)
    view = UnloadingView(p, scene[Communication].interval)
    return autonomous(scene, p, start, TrueState(), view, unloading_bodies.NAMES, error_control=True)


def _surface(friction: Pair) -> Surface:
    return (STIFFNESS, DAMPING, *friction)


def system(scene: Scene) -> tuple[UnloadingParameters, UnloadingState]:
    """Return the parameters and the initial state."""
    c = scene[Unloading]
    length, width, height = c.pack_size
    m = c.pack_mass / 12.0
    xx, yy, zz = length * length, width * width, height * height
    inertia = (m * (yy + zz), m * (xx + zz), m * (xx + yy))
    p = UnloadingParameters(
        c.pack_mass, (0.5 * length, 0.5 * width, 0.5 * height), inertia, math.radians(c.tilt_deg), c.floor_height,
        c.depth, 0.5 * c.width, c.roller_radius, c.roller_spacing, c.roller_rpm * RPM, c.ramp_start, c.ramp_duration,
        c.door_length, c.door_mass, c.door_spring, c.door_preload, c.door_damping, c.door_lock, c.edge_radius, c.pickup,
        c.gravity, _surface(c.roller_friction), _surface(c.door_friction), _surface(c.ground_friction),
    )  # fmt: skip
    return p, unloading.initial_state(p, c.gap)
