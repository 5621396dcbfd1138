"""Simulator of one vehicle for user code, which steps it with motor voltages or setpoints."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from lapwing.api.short_errors import short_errors
from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.diagram.block_diagram import BlockDiagram, ExternalBlock, Service
from lapwing.cosim.diagram.tick_schedule import LATCHED, Port
from lapwing.cosim.scene import KeyOrigin, Overrides, Scene, SceneError
from lapwing.kernels.row_packing import pack_row, row_width
from lapwing.runs.observer import notify_on_compile
from lapwing.runs.solver import with_solver
from lapwing.runs.work_progress import WorkProgress
from lapwing.services.autopilot.block import NO_TRAJECTORY, ORDER, ControllerInput
from lapwing.services.common import ports
from lapwing.services.common.ports import AutopilotStatus, MotorCommand, Setpoint, StateEstimate, TrueState
from lapwing.services.process_table import create, foreign_firmware
from lapwing.services.scene_resolver import load, load_one, resolve

KEEP = 64  # [ticks] history of port values
LOOK = 250  # [ticks] between two updates of the progress bar


class Observation(NamedTuple):
    """Time, true state, readings and estimate after a step of the simulator."""

    time: float  # [s] simulation time
    truth: TrueState  # SI, world ENU, body FLU
    sensors: dict[str, Any]  # newest reading of each sensor by name
    estimate: StateEstimate | None  # estimate of the autopilot; None with motor voltages
    done: bool  # True at the end of the run, or if the state is invalid


def _validate_setpoint(setpoint: Setpoint) -> Setpoint:
    """Return a valid setpoint; raise ValueError if a field is not a number."""
    try:
        result = Setpoint(*(tuple(map(float, v)) if hasattr(v, "__len__") else v for v in setpoint))  # type: ignore[arg-type]
        row = pack_row(result)
    except (TypeError, ValueError):
        row = np.empty(0)
    if not isinstance(setpoint, Setpoint) or len(row) != row_width(Setpoint()) or not np.isfinite(row).all():
        raise ValueError(f"setpoint: expected a Setpoint of finite numbers, got {setpoint!r}")
    return result


class Simulator:
    """Simulation of one vehicle of a scene, step by step.

    ```python
    sim = Simulator("hover", seed=1)
    observation = sim.step(motor_voltages=(33.5, 33.5, 33.5, 33.5))
    observation = sim.reset().step(setpoint=Setpoint(position_world=(0.0, 0.0, 2.0)), ticks=250)
    ```

    The first step after a reset selects the kind of command: motor voltages for the plant, or setpoints for the
    autopilot of the scene.
    """

    @short_errors
    def __init__(self, scene: Scene | str | Path, overrides: Overrides = (), seed: int | None = None):
        """Create a vehicle at rest at its initial position.

        Args:
            scene: path or name of a scene with an autopilot, or a loaded one.
            overrides: values by dotted key, or texts KEY=VALUE.
            seed: seed of all random numbers; None for that of the scene.

        Raises:
            SceneError: the scene is invalid, or has no autopilot.
        """
        self._scene = with_solver(load_one(scene, overrides))
        self._diagram: BlockDiagram | None = None
        self._kind = ""
        self._set_up(seed)

    @property
    def config(self) -> RunConfig:
        """Run configuration that is simulated."""
        return self._config

    def reset(self, seed: int | None = None) -> "Simulator":
        """Start again at tick 0, with another `seed` unless it is None. Return this simulator."""
        if seed is not None:
            self._set_up(seed)
        self._diagram = None
        return self

    def step(
        self, motor_voltages: Sequence[float] | None = None, setpoint: Setpoint | None = None, ticks: int = 1
    ) -> Observation:
        """Advance by `ticks` under one command.

        Args:
            motor_voltages: [V] of each motor, in the order of the airframe; shape (4,) of a quadrotor.
            setpoint: desired state, a `lapwing.Setpoint`; exactly one of the two commands is required.
            ticks: number of ticks, at least 1; a tick is `config.interval` [s].

        Raises:
            ValueError: not exactly one command, another kind than before, or invalid values.
            LockStepError: the state is no longer finite.
        """
        if (motor_voltages is None) == (setpoint is None):
            raise ValueError("step: expected motor_voltages or setpoint, and not both")
        if not isinstance(ticks, int) or ticks < 1:
            raise ValueError(f"step: expected ticks = 1, 2, ..., got {ticks!r}")
        kind = "setpoint" if motor_voltages is None else "motor_voltages"
        if self._diagram is None:
            with WorkProgress(self._config.scene, 1.0, "s") as bar, notify_on_compile(self._config, bar.compiling):
                self._diagram, self._kind = self._begin(kind), kind
        if kind != self._kind:
            raise ValueError(f"step: expected {self._kind} as before; call reset() to change to {kind}")
        diagram = self._diagram
        if setpoint is not None:
            diagram.put(ORDER, diagram.tick, ControllerInput(False, _validate_setpoint(setpoint), armed=True))
        voltages = () if motor_voltages is None else self._voltages(motor_voltages)
        stop = min(diagram.tick + ticks, self._config.last_tick + 1)
        if stop - diagram.tick > LOOK:
            self._advance_long(diagram, voltages if motor_voltages is not None else None, stop)
        else:
            self._advance(diagram, voltages if motor_voltages is not None else None, stop)
        return self._observe(diagram)

    def _advance(self, diagram: BlockDiagram, voltages: tuple[float, ...] | None, stop: int) -> None:
        while diagram.tick < stop and not diagram.ended:
            if voltages is not None:
                self._command(diagram, voltages)
            diagram.advance(stop if voltages is None else diagram.tick + 1)

    def _advance_long(self, diagram: BlockDiagram, voltages: tuple[float, ...] | None, stop: int) -> None:
        """Advance with a progress bar."""
        first, interval = diagram.tick, self._config.interval
        with WorkProgress(self._config.scene, (stop - first) * interval, "s") as bar:
            while diagram.tick < stop and not diagram.ended:
                self._advance(diagram, voltages, min(diagram.tick + LOOK, stop))
                bar.show((diagram.tick - first) * interval)

    def _set_up(self, seed: int | None) -> None:
        scene = load(self._scene, () if seed is None else {"run.seed": seed})
        self._config = resolve(scene)
        if firmware := foreign_firmware(self._config):
            message, expected = f"{firmware} flies the vehicle", 'autopilot.firmware = "lapwing"'
            raise SceneError("autopilot.firmware", message, expected, KeyOrigin(scene.path))
        if "autopilot" not in self._config.services:
            raise SceneError(
                "autopilot", "the scene has no autopilot", "a scene with [autopilot]", KeyOrigin(scene.path)
            )

    def _begin(self, kind: str) -> BlockDiagram:
        config = self._config
        names = [name for name in ("plant", "sensors") if name in config.services]
        services = [create(config, name) for name in names]
        if kind == "motor_voltages":
            outputs = [config.port(ports.ACTUATORS), config.port(ports.STATUS)]
            services.append(Service("simulator", [ExternalBlock("simulator.given", *outputs)], []))
            return BlockDiagram(config, services, KEEP)
        autopilot = create(config, "autopilot")
        command_block = ExternalBlock(
            "simulator.given", Port(ORDER, ControllerInput(), LATCHED), Port(NO_TRAJECTORY, Setpoint(), LATCHED)
        )
        autopilot.blocks = [
            command_block if block.name == "autopilot.commander" else block for block in autopilot.blocks
        ]
        if ports.TRAJECTORY in config.ports:
            services.append(
                Service("trajectory", [ExternalBlock("simulator.given", config.port(ports.TRAJECTORY))], [])
            )
        return BlockDiagram(config, [*services, autopilot], KEEP)

    def _voltages(self, values: Sequence[float]) -> tuple[float, ...]:
        n = len(self._config.port(ports.ACTUATORS).example.motor_voltage)
        try:
            result = tuple(map(float, values))
        except (TypeError, ValueError):
            result = ()
        if len(result) != n:
            raise ValueError(f"motor_voltages: expected {n} numbers [V], got {values!r}")
        return result

    def _command(self, diagram: BlockDiagram, voltages: tuple[float, ...]) -> None:
        example: MotorCommand = self._config.port(ports.ACTUATORS).example
        for i, value in enumerate(voltages):
            if not math.isfinite(value):
                raise ValueError(
                    f"motor_voltages[{i}] = {value} at t = {diagram.tick * self._config.interval:g} s: must be finite"
                )
        command = example._replace(motor_voltage=voltages, armed=True)
        delay = next(i.delay for i in self._config.services["plant"].inputs if i.port == ports.ACTUATORS)
        if diagram.tick >= delay:
            diagram.put(ports.ACTUATORS, diagram.tick - delay, command)
        diagram.put(ports.STATUS, diagram.tick, AutopilotStatus())

    def _observe(self, diagram: BlockDiagram) -> Observation:
        last = diagram.tick - 1
        sensors = self._config.services["sensors"].ports if "sensors" in self._config.services else ()
        return Observation(
            last * self._config.interval,
            diagram.latest(ports.TRUTH, last),
            {port.name: diagram.latest(port.name, last) for port in sensors},
            diagram.latest(ports.ESTIMATE, last) if self._kind == "setpoint" else None,
            diagram.ended or diagram.tick > self._config.last_tick,
        )
