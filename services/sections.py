"""The tables of a scene that more than one service reads."""

import importlib
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Literal

from pydantic import ConfigDict, Field

from dynamics import effects
from dynamics.vehicles.airframe import Airframe, load_airframe
from messages.topics import Topic
from services.scene import Scene, SceneError, Section, WrongKeyError, model_names, sections

Triple = Annotated[tuple[float, float, float], Field(strict=False)]  # along x, y, z; TOML gives a list
AIRFRAMES = "vehicles"  # the folder beside the scenes


class Run(Section):
    """What ends a run, and the seed of all its randomness."""

    TABLE: ClassVar[str] = "run"
    title: str = ""  # one line for `lapwing scenes`
    seed: int = Field(default=1, ge=0, lt=2**63)
    duration: float = Field(gt=0.0, le=1e6)  # [s] the run ends here at the latest
    settle: float = Field(default=1.0, ge=0.0)  # [s] recorded after the mission has ended
    speed: float | None = Field(default=None, gt=0.0)  # simulated seconds per second; without it, as fast as it goes


class Exchange(Section):
    """How often the services exchange messages, and whether the command closes the loop at once."""

    TABLE: ClassVar[str] = "exchange"
    rate: int = Field(default=250, gt=0, le=10_000)  # [Hz] one tick is 1/rate
    coupling: Literal["sequential", "parallel"] = "sequential"

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
            raise ValueError(
                "rate: expected a rate whose interval is a whole number of ns "
                f"(100, 125, 200, 250, 400, 500, 1000, ...), got {self.rate} Hz"
            )


class Rates(Section):
    """How often derived messages are published [Hz], at the most once a tick; each divides exchange.rate."""

    TABLE: ClassVar[str] = "rates"
    pose: int = Field(default=50, gt=0)  # pose, odometry, transform and clock
    estimate: int = Field(default=50, gt=0)
    status: int = Field(default=10, gt=0)
    battery: int = Field(default=10, gt=0)
    bodies: int = Field(default=50, gt=0)  # the single bodies of a vehicle that has several
    operator: int = Field(default=50, gt=0)  # what comes from outside, and the answers

    def check(self, scene: Scene) -> None:
        """Every rate divides the exchange rate."""
        for key in type(self).model_fields:
            ticks(scene, min(getattr(self, key), scene[Exchange].rate), key)


class Vehicle(Section):
    """What flies."""

    TABLE: ClassVar[str] = "vehicle"
    name: str = Field(default="drone1", pattern=r"^[A-Za-z][A-Za-z0-9_]*$")  # first part of its topics' names
    airframe: str = "delivery_drone"  # a file of the folder vehicles/ beside the scene, or the path of a .toml file
    model: str = "reduced"  # a module of services/plant/models

    def check(self, scene: Scene) -> None:
        """There is such a model, and the scene has what it needs and nothing that it cannot have."""
        if self.model not in model_names():
            raise ValueError(f"model: expected one of {', '.join(model_names())}, got {self.model!r}")
        importlib.import_module(f"services.plant.models.{self.model}").check(scene)


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

    TABLE: ClassVar[str] = "effects"
    model_config = ConfigDict(extra="allow", frozen=True, allow_inf_nan=False)

    @property
    def tables(self) -> Mapping[str, Any]:
        """The table of each effect that the scene names."""
        return self.__pydantic_extra__ or {}

    def check(self, scene: Scene) -> None:
        """Every effect exists, has sound parameters, and suits the vehicle and the others."""
        for name, table in self.tables.items():
            if not isinstance(table, dict):
                raise ValueError(f"{name}: expected a table [effects.{name}], got {table!r}")
            try:
                effects.get(name)
            except ValueError as error:
                raise ValueError(f"{name}: {error}") from None
        try:
            active(scene)
        except ValueError as error:
            raise ValueError(str(error).removeprefix("effects.")) from None


class Published(Section):
    """Figures from the literature that a run's figures are shown beside."""

    TABLE: ClassVar[str] = "published"
    source: str = "published"
    rmse: dict[Literal["x", "y", "z", "roll", "pitch", "yaw"], float] = Field(default_factory=dict)  # [m], [rad]


def follows_trajectory(scene: Scene) -> bool:
    """Whether the vehicle flies along the scene's `[trajectory]`: there is one, and no operator takes its place."""
    known = sections()
    return scene.has(known["trajectory"]) and not (
        scene.has(known["autopilot"]) and not scene.lookup("autopilot.trajectory")
    )


def needs(scene: Scene, *tables: str) -> None:
    """WrongKeyError if a scene lacks one of these optional tables."""
    for name in tables:
        if not scene.has(sections()[name]):
            raise WrongKeyError(name, f"missing; the model {scene[Vehicle].model} needs a table [{name}]")


def can_have(scene: Scene, *tables: str) -> None:
    """WrongKeyError if a scene has a table that means nothing to its model, which knows only `tables` of these."""
    for name in {"effects", "sensors", "autopilot", "trajectory"}.difference(tables):
        section = sections()[name]
        if scene.has(section) and (section.OPTIONAL or scene.tables(name)):
            raise WrongKeyError(name, f"the model {scene[Vehicle].model} knows no such table; leave it out")


def ticks(scene: Scene, rate: float, key: str) -> int:
    """Ticks between messages of `rate` [Hz].

    Raises:
        ValueError: the rate does not divide the exchange rate.
    """
    exchange = scene[Exchange].rate
    if rate <= 0 or exchange % rate:
        divisors = ", ".join(str(exchange // n) for n in range(1, 51) if exchange % n == 0)
        raise ValueError(
            f"{key}: expected a rate that divides exchange.rate = {exchange} Hz ({divisors}), got {rate:g}"
        )
    return int(exchange // rate)


def period(scene: Scene, topic: Topic) -> int:
    """Ticks between two messages of a topic: its rate is the scene key that the topic table names."""
    if topic.rate is None:
        return 1
    return ticks(scene, min(scene.lookup(topic.rate), scene[Exchange].rate), topic.rate)


def airframe(scene: Scene) -> Airframe:
    """The airframe of the scene.

    Raises:
        ValueError: no such airframe, or a fault in its file.
    """
    name = scene[Vehicle].airframe
    folder = scene.path.parent / AIRFRAMES
    path = scene.path.parent / name if name.endswith(".toml") else folder / f"{name}.toml"
    if not path.exists():
        there = ", ".join(sorted(p.stem for p in folder.glob("*.toml"))) or "none"
        raise ValueError(
            f"airframe: no file {path}; expected one of {there} (in {folder}), or the path of a .toml file"
        )
    try:
        return load_airframe(path)
    except ValueError as error:
        raise SceneError(str(error)) from None


def active(scene: Scene) -> tuple:
    """Parameters of the scene's effects, sorted by name."""
    tables = scene[Effects].tables
    return effects.from_scene(tables, airframe(scene)) if tables else ()


def gravity(scene: Scene) -> float:
    """Gravity at home [m/s^2]: that of the scene's gravity effect, 0 without one."""
    named = effects.parameter_class("gravity")
    return next((e.acceleration for e in active(scene) if isinstance(e, named)), 0.0)  # type: ignore[attr-defined]


def start_height(scene: Scene) -> float:
    """World z of the vehicle's centre of mass when it stands on level ground [m]."""
    contact = airframe(scene).contact
    return -min(z for _, _, z in contact.feet) if contact else 0.0
