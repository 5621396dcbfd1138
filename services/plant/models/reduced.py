"""A multirotor as one rigid body with rotors: motor voltages in, the vehicle's true state out."""

from collections.abc import Iterator
from types import ModuleType
from typing import Any, NamedTuple

from dynamics.cell import Cell
from dynamics.kernel import kernel
from dynamics.noise import stream_key
from dynamics.tree import finite
from dynamics.vehicles import multirotor
from dynamics.vehicles.multirotor import advance, observe, seen
from messages import Actuators, Status
from messages.topics import ACTUATORS, BATTERY, CLOCK, ODOM, POSE, STATUS, TF, TRUTH, Topic
from services.lockstep import Input
from services.plant import outputs
from services.plant.config import method
from services.plant.ending import Ending, diverged
from services.scene import Scene
from services.sections import Exchange, Run, Vehicle, active, airframe, needs, period, start_height


def check(scene: Scene) -> None:
    """The airframe's file is there and sound, and somebody flies it."""
    airframe(scene)
    needs(scene, "autopilot")
    if not scene.lookup("autopilot.operator"):
        needs(scene, "trajectory")


def described(scene: Scene) -> tuple[ModuleType, Any]:
    """(module that makes the states, parameters)."""
    return multirotor, multirotor.parameters(airframe(scene), active(scene))


def create(scene: Scene) -> "Reduced":
    """The plant of a multirotor."""
    return Reduced(scene)


@kernel
def fly(method, p, s, key, tick, command, h, n, interval):
    """Advance the state in the cell `s` to `tick` by n steps of h [s] (none: leave it).

    Returns its motion, its observation, and whether it is finite.
    """
    if n > 0:
        s.value = advance(method, p.value, key, tick - 1, s.value, command, h, n)
    motion = seen(p.value.layout, s.value.motion)
    return motion, observe(p.value, tick, interval, s.value, command), finite(s.value.motion)


class Core(NamedTuple):
    """What `fly` is given at every tick of a flight."""

    method: tuple
    parameters: Cell
    state: Cell
    key: tuple[int, int]
    step: float  # [s]
    steps: int  # of a tick
    interval: float  # [s] a tick


class Reduced:
    """Integrates the vehicle from tick to tick under the newest command."""

    outputs = (TRUTH, POSE, ODOM, TF, CLOCK, BATTERY)
    described = staticmethod(described)

    def __init__(self, scene: Scene):
        exchange, vehicle, frame = scene[Exchange], scene[Vehicle], airframe(scene)
        delay = exchange.loop_delay
        self.inputs = (Input(ACTUATORS, delay), Input(STATUS, delay))
        self.finished = False
        self._end = Ending(scene)
        self._name, self._interval, self._interval_ns = vehicle.name, exchange.interval, exchange.interval_ns
        self._pose_every, self._battery_every = period(scene, POSE), period(scene, BATTERY)
        self._method, self._steps, self._step = method(scene)
        self._key = stream_key(scene[Run].seed, vehicle.name, "plant")
        form, p = self.described(scene)
        self._parameters, self._state = Cell(p), Cell(form.initial_state(p, (0.0, 0.0, start_height(scene))))
        self._off = (0.0,) * len(frame.rotors.position)
        self._pack = frame.battery

    @property
    def core(self) -> Core:
        """What a compiled closed loop flies with instead of `step`."""
        return Core(self._method, self._parameters, self._state, self._key, self._step, self._steps, self._interval)

    def prepare(self) -> None:
        """Compile or load the kernel."""
        self._fly(0, self._off, 0)

    def _fly(self, tick: int, command: tuple, steps: int) -> Any:
        return fly(
            self._method, self._parameters, self._state, self._key, tick, command, self._step, steps, self._interval
        )

    def step(self, tick: int, actuators: Actuators | None, status: Status | None) -> Iterator[tuple[Topic, Any]]:
        """Advance to `tick` under the command given; before the first one the motors are off."""
        command = actuators.motor_voltage if actuators else self._off
        motion, seen, sound = self._fly(tick, command, self._steps if tick > 0 else 0)
        if not sound:
            raise diverged("the multirotor", motion, tick * self._interval, self._step)
        self.finished = self._end.reached(tick, status)
        time_ns = tick * self._interval_ns
        yield TRUTH, outputs.truth(time_ns, self._name, motion, seen)
        if tick % self._pose_every == 0:
            yield from outputs.whereabouts(time_ns, self._name, motion)
            yield ODOM, outputs.odometry(time_ns, self._name, motion)
        if tick % self._battery_every == 0:
            yield BATTERY, outputs.battery(time_ns, self._name, seen.battery, self._pack)
