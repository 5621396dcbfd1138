"""The plant as a service: motor voltages in, the vehicle's true state out. It owns time."""

from collections.abc import Iterator
from typing import Any

from dynamics import integrators
from dynamics.cell import Cell
from dynamics.kernel import kernel
from dynamics.noise import stream_key
from dynamics.vehicles import multirotor
from dynamics.vehicles.multirotor import advance, observe
from messages import Actuators, Status
from messages.topics import ACTUATORS, BATTERY, CLOCK, ODOM, POSE, STATUS, TF, TRUTH, Topic
from services.lockstep import Input
from services.plant import outputs
from services.plant.config import Solver
from services.scene import Scene
from services.sections import Exchange, Rates, Run, Vehicle, active, airframe, start_height, ticks


def create(scene: Scene) -> "Plant":
    """Every scene has a plant."""
    return Plant(scene)


@kernel
def fly(method, p, s, key, tick, command, h, n, interval):
    """Advance the state in the cell `s` to `tick` by n steps of h [s] (none: leave it); its motion and observation."""
    if n > 0:
        s.value = advance(method, p.value, key, tick - 1, s.value, command, h, n)
    return s.value.motion, observe(p.value, tick, interval, s.value, command)


class Plant:
    """Integrates the vehicle from tick to tick under the newest command."""

    outputs = (TRUTH, POSE, ODOM, TF, CLOCK, BATTERY)

    def __init__(self, scene: Scene):
        exchange, vehicle, frame = scene[Exchange], scene[Vehicle], airframe(scene)
        delay = exchange.loop_delay
        self.inputs = (Input(ACTUATORS, delay), Input(STATUS, delay))
        self.finished = False
        self._name, self._interval, self._interval_ns = vehicle.name, exchange.interval, exchange.interval_ns
        self._last = round(scene[Run].duration * exchange.rate)
        self._settle = round(scene[Run].settle * exchange.rate)
        self._pose_every = ticks(scene, scene[Rates].pose, "pose")
        self._battery_every = ticks(scene, scene[Rates].battery, "battery")
        self._method = integrators.get(scene[Solver].integrator).Method()
        self._steps = scene[Solver].steps(exchange)
        self._step = exchange.interval / self._steps
        self._key = stream_key(scene[Run].seed, vehicle.name, "plant")
        parameters = multirotor.parameters(frame, active(scene))
        start = multirotor.initial_state(parameters, (0.0, 0.0, start_height(scene)))
        self._parameters, self._state = Cell(parameters), Cell(start)
        self._off = (0.0,) * len(frame.rotors.position)
        self._cells = frame.battery.cells if frame.battery else 0
        self._voltage = frame.motor.max_voltage

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
        motion, seen = self._fly(tick, command, self._steps if tick > 0 else 0)
        if status and status.finished:
            self._last = min(self._last, tick + self._settle)
        self.finished = tick >= self._last
        time_ns = tick * self._interval_ns
        yield TRUTH, outputs.truth(time_ns, self._name, motion, seen)
        if tick % self._pose_every == 0:
            yield POSE, outputs.pose(time_ns, motion)
            yield ODOM, outputs.odometry(time_ns, self._name, motion)
            yield TF, outputs.transform(time_ns, self._name, motion)
            yield CLOCK, outputs.clock(time_ns)
        if tick % self._battery_every == 0:
            yield BATTERY, outputs.battery(time_ns, self._name, self._voltage, sum(seen.motor_current), self._cells)
