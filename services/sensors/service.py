"""The sensors as a service: the true state in, what each instrument reads out."""

from collections.abc import Iterator
from types import ModuleType
from typing import Any, NamedTuple

from dynamics.geodesy import MAGNETIC_FIELD_WORLD, Home
from dynamics.lie.quaternion import Quaternion
from dynamics.noise import stream_key
from messages import VehicleState
from messages.topics import TRUTH, Topic
from services.lockstep import Input
from services.scene import Scene
from services.sections import Exchange, Run, Vehicle, gravity, ticks
from services.sensors.config import Sensors as Config
from services.sensors.outputs import CONVERSIONS
from services.sensors.registry import parameters, sensors
from services.sensors.truth import Truth

TEMPERATURE = 15.0  # [deg C] of the air at the ground


class Instrument(NamedTuple):
    """A sensor that the vehicle carries."""

    name: str
    module: ModuleType  # of this folder
    parameters: Any
    key: tuple[int, int]  # of its random stream
    every: int  # ticks between two samples


def create(scene: Scene) -> "Sensors | None":
    """The sensors that the scene names; None where it names none."""
    return Sensors(scene) if scene[Config].tables else None


class Sensors:
    """Samples every sensor at its own rate."""

    inputs = (Input(TRUTH),)

    def __init__(self, scene: Scene):
        exchange, vehicle = scene[Exchange], scene[Vehicle].name
        self._interval_ns = exchange.interval_ns
        self._frame = vehicle
        self._gravity = gravity(scene)
        self.instruments: list[Instrument] = []
        for name, table in sorted(scene[Config].tables.items()):
            p = parameters(name, table, exchange.interval)
            key = stream_key(scene[Run].seed, vehicle, name)
            self.instruments.append(Instrument(name, sensors()[name], p, key, ticks(scene, p.rate, name)))
        self._states: dict[str, Any] = {}
        self.outputs = tuple(topic for name, *_ in self.instruments for topic, _ in CONVERSIONS[name])

    def prepare(self) -> None:
        """Compile or load the kernels."""
        for _, module, p, key, _ in self.instruments:
            truth = self.truth(VehicleState())
            module.sample(p, module.initial(p, key, truth), key, 0, truth)

    def truth(self, state: VehicleState) -> Truth:
        """What the sensors measure in this state."""
        p, q = state.pose.position, state.pose.orientation
        return Truth(
            (p.x, p.y, p.z),
            Quaternion(q.w, q.x, q.y, q.z),
            tuple(state.velocity),
            tuple(state.angular_velocity),
            tuple(state.acceleration),
            p.z,
            self._gravity,
            Home(),
            TEMPERATURE,
            MAGNETIC_FIELD_WORLD,
        )

    def step(self, tick: int, state: VehicleState) -> Iterator[tuple[Topic, Any]]:
        """The readings that are due at `tick`."""
        truth = self.truth(state)
        time_ns = tick * self._interval_ns
        for name, module, p, key, every in self.instruments:
            if tick % every:
                continue
            before = self._states.get(name)
            if before is None:
                before = module.initial(p, key, truth)
            self._states[name], reading = module.sample(p, before, key, tick, truth)
            for topic, convert in CONVERSIONS[name]:
                yield topic, convert(time_ns, self._frame, p, reading)
