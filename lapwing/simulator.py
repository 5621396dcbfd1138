"""A vehicle that you step yourself, with motor voltages or with setpoints."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from cosim.graph import NEVER, Graph, Service
from cosim.schedule import KEPT, Port
from cosim.setup import Setup
from services.autopilot.core import NO_TRAJECTORY, ORDER, Order
from services.common import ports
from services.common.ports import AutopilotStatus, MotorCommand, Reference, StateEstimate, TrueState
from services.processes import create
from services.table import load, resolve

KEEP = 64  # ticks that can be looked at


class Observation(NamedTuple):
    """What is known after a step."""

    time: float  # [s]
    truth: TrueState  # SI, world ENU, body FLU
    sensors: dict[str, Any]  # the newest reading of each sensor, by its name
    estimate: StateEstimate | None  # of the autopilot; None where motor voltages are given, which need none
    ended: bool  # the run's duration is over


class Given:
    """Stands for the autopilot, or for its commander: gives what the user has asked for."""

    name = "simulator.given"

    def __init__(self, *outputs: Port):
        self.outputs = outputs

    def bind(self, graph: Graph) -> None:
        """Nothing to be known."""

    def act(self, tick: int) -> int:
        """The values are put by the simulator."""
        return NEVER


class Simulator:
    """One vehicle of a scene, from tick to tick.

    ```python
    sim = Simulator("hover", seed=1)
    seen = sim.step(motor_voltages=(33.5, 33.5, 33.5, 33.5))
    seen = sim.reset().step(setpoint=Reference(position_world=(0.0, 0.0, 2.0)), ticks=250)
    ```

    The first step after a reset decides what is given from then on: motor voltages, which go to the plant, or setpoints
    that the scene's autopilot follows.
    """

    def __init__(self, scene: str | Path, overrides: Mapping[str, Any] | Sequence[str] = (), seed: int | None = None):
        """A vehicle at rest where the scene puts it.

        Args:
            scene: path or name of a scene with an autopilot.
            overrides: values by dotted key, or texts KEY=VALUE.
            seed: of all randomness; None: the scene's.

        Raises:
            SceneError: the scene is not sound.
            ValueError: nobody steers in it.
        """
        self._scene, self._overrides = scene, overrides
        self._graph: Graph | None = None
        self._kind = ""
        self._set_up(seed)

    @property
    def setup(self) -> Setup:
        """What is simulated."""
        return self._setup

    def reset(self, seed: int | None = None) -> "Simulator":
        """Begin anew, with another seed where one is given; the simulator itself."""
        if seed is not None:
            self._set_up(seed)
        self._graph = None
        return self

    def step(
        self, motor_voltages: Sequence[float] | None = None, setpoint: Reference | None = None, ticks: int = 1
    ) -> Observation:
        """Go on for some ticks under one command.

        Args:
            motor_voltages: [V] of each motor, in the order of the airframe.
            setpoint: where the vehicle ought to be; exactly one of both.
            ticks: how many; one is `setup.interval` seconds.

        Raises:
            ValueError: none or both are given, the other than before, or not a finite voltage for each motor.
            LockStepError: the state is no longer finite.
        """
        if (motor_voltages is None) == (setpoint is None):
            raise ValueError("step: expected motor_voltages or setpoint, and not both")
        kind = "setpoint" if motor_voltages is None else "motor_voltages"
        if self._graph is None:
            self._graph, self._kind = self._begin(kind), kind
        if kind != self._kind:
            raise ValueError(f"step: expected {self._kind} as before; reset() to go over to {kind}")
        graph = self._graph
        if setpoint is not None:
            graph.put(ORDER, graph.tick, Order(False, setpoint, armed=True))
        stop = min(graph.tick + ticks, self._setup.last_tick + 1)
        while graph.tick < stop and not graph.ended:
            if motor_voltages is not None:
                self._command(graph, tuple(map(float, motor_voltages)))
            graph.advance(stop if motor_voltages is None else graph.tick + 1)
        return self._observe(graph)

    def _set_up(self, seed: int | None) -> None:
        overrides = dict(self._overrides) if isinstance(self._overrides, Mapping) else list(self._overrides)
        scene = load(self._scene, overrides)
        if seed is not None:
            more: Any = {"run.seed": seed} if isinstance(overrides, dict) else [f"run.seed={seed}"]
            scene = load(self._scene, overrides | more if isinstance(overrides, dict) else [*overrides, *more])
        self._setup = resolve(scene)
        if "autopilot" not in self._setup.services:
            raise ValueError(f"{scene.path}: nobody steers there; expected a scene with [autopilot]")

    def _begin(self, kind: str) -> Graph:
        setup = self._setup
        names = [name for name in ("plant", "sensors") if name in setup.services]
        services = [create(setup, name) for name in names]
        if kind == "motor_voltages":
            outputs = [setup.port(ports.ACTUATORS), setup.port(ports.STATUS)]
            services.append(Service("simulator", [Given(*outputs)], []))
            return Graph(setup, services, KEEP)
        autopilot = create(setup, "autopilot")
        given = Given(Port(ORDER, Order(), KEPT), Port(NO_TRAJECTORY, Reference(), KEPT))
        autopilot.parts = [given if part.name == "autopilot.commander" else part for part in autopilot.parts]
        if ports.TRAJECTORY in setup.ports:
            services.append(Service("trajectory", [Given(setup.port(ports.TRAJECTORY))], []))
        return Graph(setup, [*services, autopilot], KEEP)

    def _command(self, graph: Graph, voltages: tuple[float, ...]) -> None:
        like: MotorCommand = self._setup.port(ports.ACTUATORS).like
        if len(voltages) != len(like.motor_voltage):
            raise ValueError(f"motor_voltages: expected {len(like.motor_voltage)} of them, got {len(voltages)}")
        for i, value in enumerate(voltages):
            if not math.isfinite(value):
                raise ValueError(
                    f"motor_voltages[{i}] = {value} at t = {graph.tick * self._setup.interval:g} s: must be finite"
                )
        command = like._replace(motor_voltage=voltages, armed=True)
        delay = next(i.delay for i in self._setup.services["plant"].inputs if i.port == ports.ACTUATORS)
        if graph.tick >= delay:
            graph.put(ports.ACTUATORS, graph.tick - delay, command)
        if graph.tick % self._setup.port(ports.STATUS).period == 0:
            graph.put(ports.STATUS, graph.tick, AutopilotStatus())

    def _observe(self, graph: Graph) -> Observation:
        last = graph.tick - 1
        sensors = self._setup.services["sensors"].ports if "sensors" in self._setup.services else ()
        return Observation(
            last * self._setup.interval,
            graph.latest(ports.TRUTH, last),
            {port.name: graph.latest(port.name, last) for port in sensors},
            graph.latest(ports.ESTIMATE, last) if self._kind == "setpoint" else None,
            graph.ended or graph.tick > self._setup.last_tick,
        )
