"""Scene tables of the vehicle, its airframe and its effects, and quantities derived from them."""

from functools import partial
from typing import Any, ClassVar, NamedTuple

from pydantic import ConfigDict, Field

from lapwing.cosim.scene import Files, Scene, SceneTable
from lapwing.cosim.scene.files import merge_tables, unvalidated_value
from lapwing.dynamics import effects
from lapwing.dynamics.atmosphere import density
from lapwing.dynamics.config_error import ConfigError
from lapwing.dynamics.effects._types import WakeSlopes
from lapwing.dynamics.effects.coaxial_interference import CoaxialInterference
from lapwing.dynamics.effects.rotor_quadratic import RotorQuadratic
from lapwing.dynamics.effects.rotor_table import RotorTable
from lapwing.dynamics.effects.rotor_thrust import RotorThrust
from lapwing.dynamics.lie.quaternion import Quaternion, rotate
from lapwing.dynamics.terrain import Level, Relief, surface
from lapwing.dynamics.vector import Vec3
from lapwing.dynamics.vehicles.airframe import Airframe
from lapwing.dynamics.vehicles.ground_equilibrium import Pose, resting_pose
from lapwing.dynamics.vehicles.multirotor_equations import STANDARD_DENSITY
from lapwing.kernels import math, python_function
from lapwing.services.common import effect_inputs
from lapwing.services.common.schemas import mesh_schema
from lapwing.services.common.schemas.environment_schema import environment
from lapwing.services.common.schemas.named_tables import NamedTables
from lapwing.services.common.schemas.run_schema import SHIPPED, Pair

MAX_PENETRATION = 1e-6  # [m] of a part of the resting vehicle into the ground
STEEPEST_START = 46.0  # [deg] initial tilt; terrain is at most 45 degrees steep


class Vehicle(SceneTable):
    """The vehicle; for several, a table `[[vehicle]]` each, with the keys that differ, as in the scene fleet."""

    TABLE: ClassVar[str] = "vehicle"
    DISTINCT: ClassVar[str] = "name"
    name: str = Field(default="drone1", pattern=r"^[A-Za-z][A-Za-z0-9_]*$")  # first part of its topics' names
    airframe: str | None = None  # shipped, in vehicles/ next to the scene, or the path of a .toml file
    model: str = "rigid_body"  # equations of motion
    mass: float | None = Field(default=None, gt=0.0)  # [kg] with payload, instead of airframe.mass.total
    initial_position: Pair | None = None  # [m] east and north of home, also of its trajectory; default: home

    @classmethod
    def defaults_of(cls, i: int) -> dict[str, Any]:
        """Return the default name of vehicle i: drone1, drone2, ..."""
        return {"name": f"drone{i + 1}"}

    @classmethod
    def embed(cls, tree: dict[str, Any], files: Files) -> None:
        """Read the airframe's file into the table `airframe`, overridden by the scene's values."""
        folder = files.folder
        if isinstance(name := unvalidated_value(tree, "vehicle", "airframe"), str):
            path = files.find("vehicle.airframe", "airframe", name, "vehicles", SHIPPED / "vehicles")
            content = files.toml(VehicleAirframe.TABLE, "vehicle.airframe", path)
            if unvalidated_value(tree, VehicleAirframe.TABLE, "mesh") is None:
                folder = path.parent
            tree[VehicleAirframe.TABLE] = merge_tables(content, tree.get(VehicleAirframe.TABLE, {}))
        mesh_schema.embed(tree, folder)
        mass, frame = unvalidated_value(tree, "vehicle", "mass"), tree.get(VehicleAirframe.TABLE)
        if mass is not None and isinstance(frame, dict):
            tree[VehicleAirframe.TABLE] = merge_tables(frame, {"mass": {"total": mass}})

    def check(self, scene: Scene) -> None:
        """Raise ConfigError unless the mass agrees with the airframe's."""
        if self.mass is None:
            return
        if not scene.has(VehicleAirframe):
            raise ConfigError("vehicle.mass", "the vehicle has no airframe; remove the key")
        if scene[VehicleAirframe].payload:
            raise ConfigError(
                "vehicle.mass", "conflicts with airframe.payload", "airframe.mass.total, without the payload"
            )
        if (total := airframe(scene).mass.total) != self.mass:
            raise ConfigError(
                "vehicle.mass", f"{self.mass:g} kg, but airframe.mass.total = {total:g} kg", "one of them"
            )


class VehicleAirframe(Airframe, SceneTable):
    """The airframe: content of the file that `vehicle.airframe` names."""

    TABLE: ClassVar[str] = "airframe"
    OPTIONAL: ClassVar[bool] = True
    FROM_FILE: ClassVar[bool] = True
    model_config = ConfigDict(strict=False)

    def check(self, scene: Scene) -> None:
        """Raise ConfigError unless the mesh was read and fits the rotors in size."""
        mesh_schema.check(scene, self.mesh, max(math.hypot(*place) for place in self.rotors.position))


class Effects(NamedTables):
    """Physical effects, a table for each; also effects of your own, with the key `module`."""

    TABLE: ClassVar[str] = "effects"

    @classmethod
    def embed(cls, tree: dict[str, Any], files: Files) -> None:
        """Store user modules, and read the files that effects name into their tables."""
        super().embed(tree, files)
        entries = tree.get(cls.TABLE, {})
        for name in set(entries).intersection(effects.names()) if isinstance(entries, dict) else ():
            if isinstance(entries[name], dict) and hasattr(module := effects.get(name), "embed"):
                try:
                    module.embed(entries[name], partial(files.path, f"{cls.TABLE}.{name}.file"))
                except ConfigError as error:
                    raise error.with_prefix(f"{cls.TABLE}.{name}") from None

    def check(self, scene: Scene) -> None:
        """Raise ConfigError unless all effects exist, have valid parameters and are compatible."""
        super().check(scene)
        for name in self.switched_off - set(effects.names()):
            raise ConfigError.unknown(f"{self.TABLE}.{name}", "effect", name, effects.names())
        active(scene)


def airframe(scene: Scene) -> Airframe:
    """Return the scene's airframe with its payload, with positions relative to the common centre of mass.

    Raises:
        ConfigError: the scene has no airframe.
    """
    if not scene.has(VehicleAirframe):
        raise ConfigError("vehicle.airframe", "missing", "the name of an airframe, or the path of a .toml file")
    return scene[VehicleAirframe].loaded.about_centre


def active(scene: Scene) -> tuple:
    """Return the parameters of the scene's effects, sorted by name."""
    return scene.cached(_active)


def _active(scene: Scene) -> tuple:
    tables = scene[Effects].tables
    scene[Effects].load(scene)
    if not tables:
        return ()
    return effects.from_scene(tables, airframe(scene), environment(scene), effect_inputs.external(scene))


class RotorConstants(NamedTuple):
    """Static thrust and torque of a rotor over the square of its speed."""

    thrust: float  # [N s^2/rad^2], at a density of 1 kg/m^3 if `with_density`
    torque: float  # [N m s^2/rad^2]
    with_density: bool  # both are proportional to the air density


def rotor_constants(scene: Scene) -> RotorConstants:
    """Return the constants of the scene's rotor effect, or of the airframe's [propeller].

    Raises:
        ConfigError: the scene has neither.
    """
    for effect in active(scene):
        if isinstance(effect, RotorQuadratic | RotorTable):
            with_density = isinstance(effect, RotorTable)
            return RotorConstants(effect.thrust_constant, effect.torque_constant, with_density)
    frame = airframe(scene)
    if frame.propeller is None:
        expected = "[effects.rotor_quadratic] with both constants, or an airframe with [propeller]"
        raise ConfigError("effects", "rotor thrust is undefined", expected)
    rotor = RotorThrust.from_scene({}, frame)
    return RotorConstants(rotor.thrust_constant, rotor.torque_constant, True)


def thrust_coefficient(scene: Scene) -> float:
    """Return the thrust of a rotor over the square of its speed [N s^2/rad^2] in the air at home."""
    rotor, here = rotor_constants(scene), environment(scene)
    if not rotor.with_density:
        return rotor.thrust
    if "air_density" not in scene[Effects].tables:
        return STANDARD_DENSITY * rotor.thrust
    return float(python_function(density)(here.atmosphere, here.home.height)) * rotor.thrust


def wake_slopes(scene: Scene) -> WakeSlopes:
    """Return the coupling of the rotors' loads by `coaxial_interference`, empty if the scene does not use it."""
    return next((e.slopes() for e in active(scene) if isinstance(e, CoaxialInterference)), WakeSlopes())


def gravity(scene: Scene) -> float:
    """Return gravity at home [m/s^2] of the scene's gravity effect, 0 without one."""
    return next((e.acceleration_at_home for e in active(scene) if hasattr(e, "acceleration_at_home")), 0.0)


def start_pose(scene: Scene) -> tuple[Vec3, Quaternion]:
    """Return (position of the centre of mass [m], attitude) of the vehicle at rest at its start, world frame."""
    return scene.cached(_start_pose)


def _start_pose(scene: Scene) -> tuple[Vec3, Quaternion]:
    contact, terrain = airframe(scene).contact, environment(scene).terrain
    pose = resting_pose(contact.feet if contact else (), terrain, scene[Vehicle].initial_position or (0.0, 0.0))
    if not isinstance(terrain, Level):
        _check_upright(pose)
        _check_above_ground(airframe(scene), terrain, pose)
    return pose


def _check_upright(pose: Pose) -> None:
    """Raise ConfigError if the vehicle cannot stand upright, for example next to a wall."""
    upward = rotate(pose[1], (0.0, 0.0, 1.0))[2]
    tilt = math.degrees(math.acos(min(upward, 1.0)))
    if tilt > STEEPEST_START:
        message = f"the ground at the start is too uneven: the vehicle would tilt by {tilt:.0f} degrees"
        raise ConfigError("environment.terrain", message, "flatter ground at the start")


def _check_above_ground(frame: Airframe, terrain: Relief, pose: Pose) -> None:
    """Raise ConfigError if a part of the resting vehicle is below the ground."""
    (x, y, z), attitude = pose
    hull = frame.contact.hull if frame.contact else ()
    for part in ((0.0, 0.0, 0.0), *frame.rotors.position, *hull):
        dx, dy, dz = rotate(attitude, part)
        depth = surface(terrain, x + dx, y + dy)[0] - (z + dz)
        if depth > MAX_PENETRATION:
            point = ", ".join(f"{p:g}" for p in part)
            message = f"intersects the vehicle at the start: point ({point}) m would be {depth:.2f} m below the ground"
            raise ConfigError("environment.terrain", message, "free ground at the start")


def start_place(scene: Scene) -> Vec3:
    """Return the start position of the centre of mass [m], world frame."""
    return start_pose(scene)[0]


def start_height(scene: Scene) -> float:
    """Return world z of the centre of mass at the start [m]."""
    return start_place(scene)[2]
