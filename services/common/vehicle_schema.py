"""What flies and under which physics: the airframe, the effects, and what follows from both."""

import math
from typing import Any, ClassVar, NamedTuple

from pydantic import ConfigDict, Field

from lapwing.cosim.scene import Files, Scene, SceneTable
from lapwing.cosim.scene.files import laid_over, named
from lapwing.dynamics import effects
from lapwing.dynamics.atmosphere import density
from lapwing.dynamics.config_error import ConfigError
from lapwing.dynamics.effects._types import WakeSlopes
from lapwing.dynamics.effects.coaxial_wash import CoaxialWash
from lapwing.dynamics.effects.rotor_quadratic import RotorQuadratic
from lapwing.dynamics.effects.rotor_table import RotorTable
from lapwing.dynamics.effects.rotor_thrust import RotorThrust
from lapwing.dynamics.lie.quaternion import Quaternion, rotate
from lapwing.dynamics.terrain import Level, Relief, surface
from lapwing.dynamics.vector import Vec3
from lapwing.dynamics.vehicles.airframe import Airframe
from lapwing.dynamics.vehicles.ground_equilibrium import Pose, standing_pose
from lapwing.dynamics.vehicles.multirotor_equations import STANDARD_DENSITY
from lapwing.kernels import python_function
from lapwing.services.common import mesh_schema
from lapwing.services.common.environment_schema import environment
from lapwing.services.common.named_tables import NamedTables
from lapwing.services.common.run_schema import SHIPPED, Pair

BURIED = 1e-6  # [m]
STEEPEST_START = 46.0  # [deg] that a vehicle leans at its start: ground is at most 45 degrees steep


class Vehicle(SceneTable):
    """What flies."""

    TABLE: ClassVar[str] = "vehicle"
    DISTINCT: ClassVar[str] = "name"
    name: str = Field(default="drone1", pattern=r"^[A-Za-z][A-Za-z0-9_]*$")  # first part of its topics' names
    airframe: str | None = None  # one that ships or lies in vehicles/ beside the scene, or the path of a .toml file
    model: str = "reduced"  # a module of services/plant/models
    mass: float | None = Field(default=None, gt=0.0)  # [kg] with payload, in the place of airframe.mass.total
    start: Pair | None = None  # [m] east and north of home, where it stands and its trajectory begins; without it, home

    @classmethod
    def numbered(cls, i: int) -> dict[str, Any]:
        """drone1, drone2, ..."""
        return {"name": f"drone{i + 1}"}

    @classmethod
    def embed(cls, tree: dict[str, Any], files: Files) -> None:
        """The airframe's file becomes the table `airframe`; what the scene says there is laid over it."""
        folder = files.folder
        if isinstance(name := named(tree, "vehicle", "airframe"), str):
            path = files.find("vehicle.airframe", "airframe", name, "vehicles", SHIPPED / "vehicles")
            content = files.toml(VehicleAirframe.TABLE, "vehicle.airframe", path)
            if named(tree, VehicleAirframe.TABLE, "mesh") is None:
                folder = path.parent
            tree[VehicleAirframe.TABLE] = laid_over(content, tree.get(VehicleAirframe.TABLE, {}))
        mesh_schema.embed(tree, folder)
        mass, frame = named(tree, "vehicle", "mass"), tree.get(VehicleAirframe.TABLE)
        if mass is not None and isinstance(frame, dict):
            tree[VehicleAirframe.TABLE] = laid_over(frame, {"mass": {"total": mass}})

    def check(self, scene: Scene) -> None:
        """The mass is that of the airframe."""
        if self.mass is None:
            return
        if not scene.has(VehicleAirframe):
            raise ConfigError("vehicle.mass", "there is no airframe whose mass it could be; leave it out")
        if scene[VehicleAirframe].payload:
            raise ConfigError(
                "vehicle.mass", "airframe.payload is part of it", "airframe.mass.total, without the payload"
            )
        if (total := airframe(scene).mass.total) != self.mass:
            raise ConfigError(
                "vehicle.mass", f"{self.mass:g} kg, and airframe.mass.total = {total:g} kg", "one of them"
            )


class VehicleAirframe(Airframe, SceneTable):
    """The airframe: the content of the file that `vehicle.airframe` names."""

    TABLE: ClassVar[str] = "airframe"
    OPTIONAL: ClassVar[bool] = True
    FROM_FILE: ClassVar[bool] = True
    model_config = ConfigDict(strict=False)

    def check(self, scene: Scene) -> None:
        """The mesh was read, and is as large as a vehicle with these rotors."""
        mesh_schema.check(scene, self.mesh, max(math.hypot(*place) for place in self.rotors.position))


class Effects(NamedTables):
    """The physics that the scene calls for: a table for each effect of lapwing/dynamics/effects, or of the user's
    own."""

    TABLE: ClassVar[str] = "effects"

    @classmethod
    def embed(cls, tree: dict[str, Any], files: Files) -> None:
        """As of any; and what is in the files that effects name becomes part of their tables."""
        super().embed(tree, files)
        entries = tree.get(cls.TABLE, {})
        for name in set(entries).intersection(effects.names()) if isinstance(entries, dict) else ():
            if isinstance(entries[name], dict) and hasattr(module := effects.get(name), "embed"):
                try:
                    module.embed(entries[name], files.folder)
                except ConfigError as error:
                    raise error.under(f"{cls.TABLE}.{name}") from None

    def check(self, scene: Scene) -> None:
        """Every effect exists, has sound parameters, and suits the vehicle and the others."""
        super().check(scene)
        active(scene)


def airframe(scene: Scene) -> Airframe:
    """The airframe of the scene with its payload, its positions from the joint centre of mass.

    Raises KeyedError where it names none.
    """
    if not scene.has(VehicleAirframe):
        raise ConfigError("vehicle.airframe", "missing", "the name of an airframe, or the path of a .toml file")
    return scene[VehicleAirframe].loaded.about_centre


def active(scene: Scene) -> tuple:
    """Parameters of the scene's effects, sorted by name."""
    return scene.once(_active)


def _active(scene: Scene) -> tuple:
    tables = scene[Effects].tables
    scene[Effects].load(scene)
    return effects.from_scene(tables, airframe(scene), environment(scene)) if tables else ()


class RotorConstants(NamedTuple):
    """Thrust and torque of a rotor at rest in the air, over the square of its speed."""

    thrust: float  # [N s^2/rad^2], at a density of 1 kg/m^3 where they go with the density
    torque: float  # [N m s^2/rad^2]
    with_density: bool  # whether they are in proportion to the density of the air


def rotor_constants(scene: Scene) -> RotorConstants:
    """Those of the effect that is in force; of the airframe's [propeller] where none of the three that are known is.

    Raises:
        KeyedError: there is neither.
    """
    for effect in active(scene):
        if isinstance(effect, RotorQuadratic | RotorTable):
            with_density = isinstance(effect, RotorTable)
            return RotorConstants(effect.thrust_constant, effect.torque_constant, with_density)
    frame = airframe(scene)
    if frame.propeller is None:
        expected = "[effects.rotor_quadratic] with both constants, or an airframe with [propeller]"
        raise ConfigError("effects", "nothing says what the rotors give", expected)
    known = RotorThrust.from_scene({}, frame)
    return RotorConstants(known.thrust_constant, known.torque_constant, True)


def thrust_coefficient(scene: Scene) -> float:
    """Thrust of a rotor over the square of its speed [N s^2/rad^2], in the air of home."""
    rotor, around = rotor_constants(scene), environment(scene)
    if not rotor.with_density:
        return rotor.thrust
    if "air_density" not in scene[Effects].tables:
        return STANDARD_DENSITY * rotor.thrust
    return float(python_function(density)(around.atmosphere, around.home.height)) * rotor.thrust


def wake_slopes(scene: Scene) -> WakeSlopes:
    """How the rotors' loads hang together under `coaxial_wash`, where the scene names it."""
    return next((e.slopes() for e in active(scene) if isinstance(e, CoaxialWash)), WakeSlopes())


def gravity(scene: Scene) -> float:
    """Gravity at home [m/s^2]: that of whichever effect gives one, 0 without."""
    return next((e.acceleration_at_home for e in active(scene) if hasattr(e, "acceleration_at_home")), 0.0)


def start_pose(scene: Scene) -> tuple[Vec3, Quaternion]:
    """(position of the centre of mass [m], attitude) in the world of the vehicle that stands on the ground at home."""
    return scene.once(_start_pose)


def _start_pose(scene: Scene) -> tuple[Vec3, Quaternion]:
    contact, terrain = airframe(scene).contact, environment(scene).terrain
    pose = standing_pose(contact.feet if contact else (), terrain, scene[Vehicle].start or (0.0, 0.0))
    if not isinstance(terrain, Level):
        _upright(pose)
        _above_ground(airframe(scene), terrain, pose)
    return pose


def _upright(pose: Pose) -> None:
    """KeyedError where the feet find no ground side by side, as where a wall is under one of them."""
    upward = rotate(pose[1], (0.0, 0.0, 1.0))[2]
    lean = math.degrees(math.acos(min(upward, 1.0)))
    if lean > STEEPEST_START:
        message = f"no place for the vehicle at its start: on its feet it would lean by {lean:.0f} degrees"
        raise ConfigError("environment.terrain", message, "room for the vehicle where it starts")


def _above_ground(frame: Airframe, terrain: Relief, pose: Pose) -> None:
    """KeyedError where a part of a vehicle that stands there is in the ground."""
    (x, y, z), attitude = pose
    hull = frame.contact.hull if frame.contact else ()
    for part in ((0.0, 0.0, 0.0), *frame.rotors.position, *hull):
        dx, dy, dz = rotate(attitude, part)
        under = surface(terrain, x + dx, y + dy)[0] - (z + dz)
        if under > BURIED:
            place = ", ".join(f"{p:g}" for p in part)
            message = f"buries the start: the vehicle's ({place}) m would be {under:.2f} m below the ground"
            raise ConfigError("environment.terrain", message, "room for the vehicle where it starts")


def start_place(scene: Scene) -> Vec3:
    """World position of its centre of mass [m]."""
    return start_pose(scene)[0]


def start_height(scene: Scene) -> float:
    """World z of its centre of mass [m]."""
    return start_place(scene)[2]
