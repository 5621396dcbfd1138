"""The tables of a scene that more than one service reads."""

import importlib.resources
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

from pydantic import ConfigDict, Field

import scenes
from cosim.scene import Files, Scene, Section
from cosim.scene.files import laid_over
from dynamics import effects
from dynamics.errors import KeyedError
from dynamics.lie.quaternion import Quaternion
from dynamics.vector import Vec3
from dynamics.vehicles.airframe import Airframe
from dynamics.vehicles.standing import standing_pose
from messages.topics import Topic
from services.common import user_code

SHIPPED = Path(str(importlib.resources.files(scenes)))  # folder of the scenes that ship
Triple = Annotated[tuple[float, float, float], Field(strict=False)]  # along x, y, z; TOML gives a list


class Run(Section):
    """What ends a run, and the seed of all its randomness."""

    TABLE: ClassVar[str] = "run"
    title: str = ""  # one line for `lapwing scenes`
    seed: int = Field(default=1, ge=0, lt=2**63)  # of every random number: same scene, same seed, same bits
    duration: float = Field(gt=0.0, le=1e6)  # [s] the run ends here at the latest
    settle: float = Field(default=1.0, ge=0.0)  # [s] recorded after the mission has ended
    speed: float | None = Field(default=None, gt=0.0)  # simulated seconds per second; without it, as fast as it goes


class Exchange(Section):
    """How often the services exchange messages, and whether the command closes the loop at once."""

    TABLE: ClassVar[str] = "exchange"
    rate: int = Field(default=250, gt=0, le=10_000)  # [Hz] one tick is 1/rate
    coupling: Literal["sequential", "parallel"] = "sequential"  # Gauss-Seidel, or Jacobi: services overlap

    @property
    def interval_ns(self) -> int:
        """Length of one tick [ns]."""
        return 1_000_000_000 // self.rate

    @property
    def interval(self) -> float:
        """Length of one tick [s]."""
        return 1.0 / self.rate

    @property
    def loop_delay(self) -> int:
        """Ticks after which the plant applies a command: at once, or one exchange later so that services overlap."""
        return 1 if self.coupling == "sequential" else 2

    def check(self, scene: Scene) -> None:
        """A tick is a whole number of nanoseconds."""
        if 1_000_000_000 % self.rate:
            expected = "a rate whose interval is a whole number of ns (100, 125, 200, 250, 400, 500, 1000, ...)"
            raise KeyedError("exchange.rate", f"got {self.rate} Hz", expected)


class Rates(Section):
    """How often derived messages are published [Hz], at the most once a tick; each divides exchange.rate."""

    TABLE: ClassVar[str] = "rates"
    pose: int = Field(default=50, gt=0)  # [Hz] pose, odometry, transform and clock
    estimate: int = Field(default=50, gt=0)  # [Hz] what the autopilot takes for the state
    status: int = Field(default=10, gt=0)  # [Hz] phase, armed, landed, failures
    battery: int = Field(default=10, gt=0)  # [Hz] charge, voltage, current
    bodies: int = Field(default=50, gt=0)  # [Hz] the single bodies of a vehicle that has several
    operator: int = Field(default=50, gt=0)  # [Hz] what comes from outside, and the answers

    def check(self, scene: Scene) -> None:
        """Every rate divides the exchange rate."""
        for key in type(self).model_fields:
            ticks(scene, min(getattr(self, key), scene[Exchange].rate), f"rates.{key}")


class Vehicle(Section):
    """What flies."""

    TABLE: ClassVar[str] = "vehicle"
    name: str = Field(default="drone1", pattern=r"^[A-Za-z][A-Za-z0-9_]*$")  # first part of its topics' names
    airframe: str | None = None  # one that ships or lies in vehicles/ beside the scene, or the path of a .toml file
    model: str = "reduced"  # a module of services/plant/models
    mass: float | None = Field(default=None, gt=0.0)  # [kg] with payload, in the place of airframe.mass.total

    @classmethod
    def embed(cls, tree: dict[str, Any], files: Files) -> None:
        """The airframe's file becomes the table `airframe`; what the scene says there is laid over it."""
        if isinstance(name := named(tree, "vehicle", "airframe"), str):
            path = files.find("vehicle.airframe", "airframe", name, "vehicles", SHIPPED / "vehicles")
            content = files.toml(VehicleAirframe.TABLE, "vehicle.airframe", path)
            tree[VehicleAirframe.TABLE] = laid_over(content, tree.get(VehicleAirframe.TABLE, {}))
        mass, frame = named(tree, "vehicle", "mass"), tree.get(VehicleAirframe.TABLE)
        if mass is not None and isinstance(frame, dict):
            tree[VehicleAirframe.TABLE] = laid_over(frame, {"mass": {"total": mass}})

    def check(self, scene: Scene) -> None:
        """The mass is that of the airframe."""
        if self.mass is None:
            return
        if not scene.has(VehicleAirframe):
            raise KeyedError("vehicle.mass", "there is no airframe whose mass it could be; leave it out")
        if (total := airframe(scene).mass.total) != self.mass:
            raise KeyedError("vehicle.mass", f"{self.mass:g} kg, and airframe.mass.total = {total:g} kg", "one of them")


class VehicleAirframe(Airframe, Section):
    """The airframe: the content of the file that `vehicle.airframe` names."""

    TABLE: ClassVar[str] = "airframe"
    OPTIONAL: ClassVar[bool] = True
    FROM_FILE: ClassVar[bool] = True
    model_config = ConfigDict(strict=False)


class CooperativeLoad(Section):
    """Quadrotors that carry a point mass by rigid links (theory.md, section 7.4); a tuple has an entry for each."""

    TABLE: ClassVar[str] = "cooperative_load"
    OPTIONAL: ClassVar[bool] = True
    quad_mass: tuple[float, ...] = Field(min_length=2, strict=False)  # [kg]
    quad_inertia: tuple[Triple, ...] = Field(min_length=2, strict=False)  # [kg m^2] principal moments
    link_length: tuple[float, ...] = Field(min_length=2, strict=False)  # [m]
    link_start: tuple[Triple, ...] = Field(min_length=2, strict=False)  # unit vectors from quadrotor to load
    load_mass: float  # [kg]
    load_start: Triple  # [m] world frame
    load_velocity_start: Triple = (0.0, 0.0, 0.0)  # [m/s] world frame
    gravity: float = 9.81  # [m/s^2]


class Effects(Section):
    """The physics that the scene calls for: a table for each effect of dynamics/effects."""

    TABLE: ClassVar[str] = "effects"  # one of the user's own has the key `module`
    model_config = ConfigDict(extra="allow", frozen=True, allow_inf_nan=False)

    @property
    def tables(self) -> Mapping[str, Any]:
        """The table of each effect that the scene names."""
        return self.__pydantic_extra__ or {}

    @classmethod
    def embed(cls, tree: dict[str, Any], files: Files) -> None:
        """The modules of effects of the user's own become part of the table `modules`."""
        user_code.embed_all(tree, files, cls.TABLE)

    def check(self, scene: Scene) -> None:
        """Every effect exists, has sound parameters, and suits the vehicle and the others."""
        for name, table in self.tables.items():
            if not isinstance(table, dict):
                raise KeyedError(f"effects.{name}", f"got {table!r}", f"a table [effects.{name}]")
        active(scene)


class Published(Section):
    """Figures from the literature that a run's figures are shown beside."""

    TABLE: ClassVar[str] = "published"
    source: str = "published"  # where the figures are from
    rmse: dict[Literal["x", "y", "z", "roll", "pitch", "yaw"], float] = Field(default_factory=dict)  # [m], [rad]


def named(tree: dict[str, Any], table: str, key: str, default: Any = None) -> Any:
    """The value of a key in data that is not yet validated; None where there is no such table."""
    found = tree.get(table)
    return found.get(key, default) if isinstance(found, dict) else None


def follows_trajectory(scene: Scene) -> bool:
    """Whether the vehicle flies along the scene's `[trajectory]`: there is one, and no operator takes its place."""
    return scene.has("trajectory") and not (scene.has("autopilot") and not scene.lookup("autopilot.trajectory"))


def needs(scene: Scene, *tables: str) -> None:
    """KeyedError if a scene lacks one of these optional tables."""
    for name in tables:
        if not scene.has(name):
            raise KeyedError(name, "missing", f"a table [{name}], which the model {scene[Vehicle].model} needs")


def can_have(scene: Scene, *tables: str) -> None:
    """KeyedError if a scene has a table that means nothing to its model, which knows only `tables` of these."""
    for name in sorted({"effects", "sensors", "autopilot", "trajectory"}.difference(tables)):
        if scene.has(name) and (scene.section(name).OPTIONAL or scene.tables(name)):
            raise KeyedError(name, f"the model {scene[Vehicle].model} knows no such table; leave it out")


def ticks(scene: Scene, rate: float, key: str) -> int:
    """Ticks between messages of `rate` [Hz].

    Raises:
        KeyedError: the rate, which is that of `key`, does not divide the exchange rate.
    """
    exchange = scene[Exchange].rate
    if rate <= 0 or exchange % rate:
        divisors = ", ".join(str(exchange // n) for n in range(1, 51) if exchange % n == 0)
        raise KeyedError(key, f"got {rate:g}", f"a rate that divides exchange.rate = {exchange} Hz ({divisors})")
    return int(exchange // rate)


def period(scene: Scene, topic: Topic) -> int:
    """Ticks between two messages of a topic: its rate is the scene key that the topic table names."""
    if topic.rate is None:
        return 1
    return ticks(scene, min(scene.lookup(topic.rate), scene[Exchange].rate), topic.rate)


def airframe(scene: Scene) -> Airframe:
    """The airframe of the scene. Raises KeyedError where it names none."""
    if not scene.has(VehicleAirframe):
        raise KeyedError("vehicle.airframe", "missing", "the name of an airframe, or the path of a .toml file")
    return scene[VehicleAirframe]


def active(scene: Scene) -> tuple:
    """Parameters of the scene's effects, sorted by name."""
    tables = scene[Effects].tables
    user_code.load_all(Effects.TABLE, tables, user_code.texts_of(scene))
    return effects.from_scene(tables, airframe(scene)) if tables else ()


def gravity(scene: Scene) -> float:
    """Gravity at home [m/s^2]: that of whichever effect gives one, 0 without."""
    return next((e.acceleration_at_home for e in active(scene) if hasattr(e, "acceleration_at_home")), 0.0)


def start_pose(scene: Scene) -> tuple[Vec3, Quaternion]:
    """(position of the centre of mass [m], attitude) in the world of the vehicle that stands on the ground at home."""
    contact = airframe(scene).contact
    ground = next((e.ground for e in active(scene) if hasattr(e, "ground")), None)
    return standing_pose(contact.feet if contact else (), ground)


def start_height(scene: Scene) -> float:
    """World z of its centre of mass [m]."""
    return start_pose(scene)[0][2]
