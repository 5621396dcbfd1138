"""Error of a scene's flight: comparison with much finer steps at every tick.

Both flights are closed loops with the same random numbers. Their difference is the error of the solver in the recorded
state of each vehicle, including the response of the autopilot. Some closed loops amplify an initial difference of a
ten-thousandth of the accuracy beyond the accuracy (`sensitivity`), so no solver can meet it. Then the error of the
solver is measured under recorded commands (`open_loop`), and that of the closed loop is reported in addition.

Quantities that the plant holds over a communication step (discrete states of effects, states of neighbours) have their
own error: the plant is repeated under the recorded commands with `FASTER` updates in a communication step.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import Any, NamedTuple

from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.diagram.block_diagram import BlockDiagram
from lapwing.cosim.scene import KeyOrigin, Scene, SceneError, with_values
from lapwing.flights.flight_data import FlightData
from lapwing.services.common.schemas.communication_schema import Communication
from lapwing.services.plant.schema import LEAST_ACCURACIES, Solver
from lapwing.services.process_table import foreign_firmware
from lapwing.services.scene_resolver import from_resolved, load, resolve
from lapwing.studies.accuracy.error_budget import rate_overrides
from lapwing.studies.accuracy.open_loop import PART_LENGTH, Parts, fly_parts, inputs_of_plant, starts_of_parts
from lapwing.studies.accuracy.sensitivity import Signal, first_signal, start_difference, with_start_shifted
from lapwing.studies.accuracy.state_errors import TOPICS, Quantity, differences_of_all, worst_of
from lapwing.studies.simulate import fly_with_ports

FINER = 8  # factor of the number of steps in the finer flight
FASTER = 8  # updates of the plant in a communication step of the scene, to measure what it holds
MOST_UPDATES = 10_000  # [Hz]
STRICTER = 1e-3  # factor of the accuracy in contact
STRICTEST = LEAST_ACCURACIES["ground_contact"]  # limit of the accuracy in contact by round-off
MISSING = "missing; set the error to compare with, e.g. --set solver.accuracy=1e-4"
WorkFunction = Callable[[Callable[[int], None]], Any]  # flies, and calls its argument with the current tick
Progress = Callable[[RunConfig, str, WorkFunction], Any]  # (run, description, work) -> result of the work


class ClosedLoop(NamedTuple):
    """Flights of a closed loop that amplifies any difference beyond the accuracy."""

    quantities: list[Quantity]  # differences between the flight and the one with finer steps
    start_difference: float  # relative, between the initial states of two flights with the finer steps
    difference: Quantity  # largest difference between these two flights
    signal: Signal | None  # first output of sensors or autopilot that differs by more than the accuracy
    true_difference: float  # largest difference of the true state at that time


class FlightAccuracy(NamedTuple):
    """Accuracy of a flight."""

    accuracy: float  # required, relative to 1 + size
    integrator: str
    step: float  # [s]
    reference_step: float  # [s]
    step_selected: bool  # False if the scene sets it, independent of the accuracy
    duration: float  # [s] common to both flights
    quantities: list[Quantity]  # errors that decide
    part_length: float | None = None  # [s] length of the parts for `quantities`; None: entire closed loop
    closed_loop: ClosedLoop | None = None
    update_rate: float = math.nan  # [Hz] of the plant
    held: Sequence[Quantity] = ()  # errors by quantities held over a communication step; empty: not measured

    @property
    def worst(self) -> Quantity:
        """Quantity with the largest error."""
        return worst_of(self.quantities)

    @property
    def met(self) -> bool:
        """True if no error exceeds the accuracy."""
        return worst_of([*self.quantities, *self.held]).error <= self.accuracy


class _Flight(NamedTuple):
    config: RunConfig
    vehicles: list[FlightData]
    diagram: BlockDiagram


def measure(scene: Scene, progress: Progress, step_selected: bool = False) -> FlightAccuracy:
    """Return the accuracy of a scene with a selected solver.

    Args:
        scene: any scene.
        progress: executes work on a run and shows its progress with a description.
        step_selected: True if the step was selected for the accuracy.

    Raises:
        SceneError: the scene has no accuracy.
        ValueError: a flight fails, or a foreign firmware flies.
    """
    solver = scene.each_vehicle[0][Solver]
    if solver.accuracy is None:
        raise SceneError("solver.accuracy", MISSING, source=KeyOrigin(scene.path))
    config = resolve(scene)
    if firmware := foreign_firmware(config):
        raise ValueError(f"{scene.path}: {firmware} flies it; record a flight with lapwing run, and check its log")
    step, overrides = _finer(scene, solver.accuracy)
    finer = resolve(load(scene.path, [*scene.overrides, *overrides]))
    name = f"{solver.integrator}, step {1e3 * FINER * step:g} ms"
    finer_name = f"{solver.integrator}, step {1e3 * step:g} ms"
    coarse = _fly(scene, config, progress, name)
    fine = _fly(scene, finer, progress, finer_name)
    duration = float(min(flight.truth.times[-1] for flight in (*coarse.vehicles, *fine.vehicles)))
    quantities = differences_of_all(coarse.vehicles, fine.vehicles)
    result = FlightAccuracy(solver.accuracy, solver.integrator, FINER * step, step, step_selected, duration, quantities)
    if not inputs_of_plant(coarse.diagram):
        return result
    faster = _faster(scene, finer, lambda more: load(scene.path, [*scene.overrides, *overrides, *more]))
    solver_errors, held = _in_parts(coarse, finer, faster, progress, finer_name)
    result = result._replace(update_rate=1.0 / config.interval, held=held)
    if result.worst.error <= solver.accuracy:
        return result
    shift = start_difference(solver.accuracy)
    description = f"{finer_name}, start shifted by {shift:g}"
    shifted = _fly(scene, with_start_shifted(finer, shift), progress, description)
    difference = worst_of(differences_of_all(shifted.vehicles, fine.vehicles))
    if difference.error <= solver.accuracy:
        return result
    closed_loop = ClosedLoop(quantities, shift, difference, *_first_signal(coarse, fine, solver.accuracy))
    return result._replace(quantities=solver_errors, part_length=PART_LENGTH, closed_loop=closed_loop)


def error_of_neighbours(scene: Scene) -> float:
    """Return the largest error by states of neighbours that are held over a communication step, in the scene's flight.

    It is 0 for a flight that fails, and if the rate is too high to be measured (`MOST_UPDATES`).
    """
    _, overrides = _finer(scene, scene.each_vehicle[0][Solver].accuracy or 1.0)
    finer = resolve(load(scene, overrides))
    faster = _faster(scene.each_vehicle[0], finer, lambda more: load(scene, [*overrides, *more]))
    flights, diagram = fly_with_ports(finer, TOPICS)
    if faster is None or any(flight.failure for flight in flights):
        return 0.0
    _, held = _in_parts(
        _Flight(finer, flights, diagram), finer, faster, lambda _, __, work: work(lambda tick: None), ""
    )
    return worst_of(held).error


def measure_recorded(
    config: RunConfig, commands: Mapping[str, Any], progress: Progress, accuracy: float | None = None
) -> FlightAccuracy:
    """Return the accuracy of the solver in a recorded run, under its commands from any autopilot.

    Args:
        config: configuration of the run, of one vehicle, that ends at its last recorded tick.
        commands: recorded commands, keyword arguments of `fly_with_ports`.
        progress: see `measure`.
        accuracy: error to compare with; None: the accuracy of the run.

    Raises:
        SceneError: neither has an accuracy.
        ValueError: several vehicles, or the flight fails.
    """
    if not config.vehicle:
        raise ValueError(f"{config.scene}: has {len(config.vehicles)} vehicles; expected the log of one vehicle")
    scene = from_resolved(config.resolved, config.scene)
    solver, accuracy = scene[Solver], accuracy or scene[Solver].accuracy
    if accuracy is None:
        raise SceneError("solver.accuracy", MISSING)
    step, overrides = _finer(scene, accuracy)

    def changed(more: list[str]) -> Scene:
        return from_resolved(with_values(config.resolved, [*overrides, *more]))

    finer = resolve(changed([]))._replace(last_tick=config.last_tick)
    faster = _faster(scene, finer, changed)
    coarse = _fly(
        scene, config, progress, f"recorded commands, {solver.integrator}, step {1e3 * FINER * step:g} ms", commands
    )
    quantities, held = _in_parts(coarse, finer, faster, progress, f"{solver.integrator}, step {1e3 * step:g} ms")
    duration = float(coarse.vehicles[0].truth.times[-1])
    return FlightAccuracy(
        accuracy, solver.integrator, FINER * step, step, False, duration, quantities, PART_LENGTH, None,
        1.0 / config.interval, held,
    )  # fmt: skip


def _finer(scene: Scene, accuracy: float) -> tuple[float, list[str]]:
    """Return the step [s] of the finer flight and its overrides."""
    solver = scene.each_vehicle[0][Solver]
    step = scene[Communication].interval / (FINER * solver.steps(scene[Communication]))
    return step, [f"solver.step={step!r}", f"solver.accuracy={max(STRICTER * accuracy, STRICTEST)!r}"]


def _faster(scene: Scene, finer: RunConfig, changed: Callable[[list[str]], Scene]) -> RunConfig | None:
    """Return the finer configuration with more updates of the plant; None above `MOST_UPDATES`."""
    rate = FASTER * scene[Communication].rate
    if rate > MOST_UPDATES:
        return None
    return resolve(changed(rate_overrides(scene, rate)))._replace(last_tick=FASTER * (finer.last_tick + 1) - 1)


def _in_parts(
    coarse: _Flight, finer: RunConfig, faster: RunConfig | None, progress: Progress, name: str
) -> tuple[list[Quantity], list[Quantity]]:
    """Return the largest errors of a flight in parts with finer steps, and those of them with more updates."""

    starts = starts_of_parts(coarse.diagram)

    def fly(config: RunConfig, what: str) -> tuple[Parts, Parts]:
        text = f"{name}, {what} of {PART_LENGTH:g} s"
        result: tuple[Parts, Parts] = progress(
            finer, text, lambda show: fly_parts(coarse.diagram, starts, config, TOPICS, show)
        )
        return result

    parts = fly(finer, "parts")
    solver = [q for part in parts for q in differences_of_all(coarse.vehicles, part.flights, part.spans)]
    held = []
    if faster is not None:
        updated = fly(faster, "more updates in parts")
        for part, other in zip(parts, updated, strict=True):
            held += differences_of_all(part.flights, other.flights, part.spans)
    return _largest(solver), _largest(held)


def _largest(errors: list[Quantity]) -> list[Quantity]:
    """Return the largest error of each quantity and vehicle."""
    names = dict.fromkeys((q.vehicle, q.name) for q in errors)
    return [worst_of(q for q in errors if (q.vehicle, q.name) == name) for name in names]


def _fly(
    scene: Scene,
    config: RunConfig,
    progress: Progress,
    description: str,
    commands: Mapping[str, Any] = MappingProxyType({}),
) -> _Flight:
    flights, diagram = progress(config, description, lambda show: fly_with_ports(config, TOPICS, show, **commands))
    for flight in flights:
        if flight.failure:
            raise ValueError(f"{scene.path}: {flight.failure}")
    return _Flight(config, flights, diagram)


def _first_signal(flight: _Flight, exact: _Flight, limit: float) -> tuple[Signal | None, float]:
    """Return the first signal that differs by more than a limit, and the largest true difference at that time."""
    signal = first_signal(flight.diagram, exact.diagram, limit)
    if signal is None:
        return None, 0.0
    tick = 0.5 * flight.config.interval
    moment = [(signal.time - tick, signal.time + tick)]
    return signal, worst_of(differences_of_all(flight.vehicles, exact.vehicles, moment)).error
