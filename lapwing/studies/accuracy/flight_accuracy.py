"""Error of a scene's own flight: flown as it is and with much finer steps, and compared at every tick.

Both flights are closed loops with the same random numbers. Their difference is the error of the solver, in the state of
each vehicle as it is recorded, with all that the autopilot makes of it. Some closed loops make a difference of a
ten-thousandth of the accuracy in the start larger than the accuracy (`sensitivity`): no solver can be accurate enough.
There the error of the solver is measured under recorded commands (`open_loop`), and the closed loop is shown beside it.
"""

from collections.abc import Callable, Iterable, Iterator
from typing import Any, NamedTuple

import numpy as np

from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.diagram.block_diagram import BlockDiagram
from lapwing.cosim.scene import KeyOrigin, Scene, SceneError
from lapwing.messages.topics import BATTERY, TRUTH
from lapwing.services.common.communication_schema import Communication
from lapwing.services.plant.schema import Solver
from lapwing.services.scene_resolver import load, resolve
from lapwing.studies.accuracy.coordinates import matrices
from lapwing.studies.accuracy.open_loop import PART, fly_parts, inputs_of_plant
from lapwing.studies.accuracy.sensitivity import Signal, first_signal, start_difference, with_start_shifted
from lapwing.studies.flight_data import FlightData
from lapwing.studies.simulate import fly_with_ports

FINER = 8  # times as many steps in a communication step
STRICTER = 1e-3  # times the accuracy, in contact
STRICTEST = 1e-10  # beyond which contact is limited by round-off
TOPICS = (TRUTH, BATTERY)
BATTERY_FIELDS = ("voltage", "charge")  # of BatteryState; its current jumps where a motor is switched off
STATE_FIELDS = (
    ("position", "position"),
    ("attitude", "orientation"),
    ("velocity", "velocity"),
    ("body rates", "angular_velocity"),
    ("rotor speed", "rotor_speed"),
)  # name, field of the topic

Work = Callable[[Callable[[int], None]], Any]  # flies, and calls its argument with the tick that is reached
Progress = Callable[[RunConfig, str, Work], Any]  # of a run and the description of the work, whose result it returns
Errors = tuple[str, np.ndarray, np.ndarray]  # name of a quantity, times [s], errors


class Quantity(NamedTuple):
    """Largest error of one part of a vehicle's state, of its numbers relative to 1 + their size."""

    vehicle: str
    name: str
    error: float
    time: float  # [s] of the moment


class ClosedLoop(NamedTuple):
    """Flights of a closed loop that makes any difference larger than the error asked for."""

    quantities: list[Quantity]  # differences between the flight and the one with finer steps
    start_apart: float  # relative, between the starts of two flights with the finer steps
    apart: Quantity  # largest difference between these two
    signal: Signal | None  # first output of sensors or autopilot that differs by more than the error asked for
    true_difference: float  # largest one in the true state at that moment


class FlightAccuracy(NamedTuple):
    """Accuracy of a flight."""

    asked: float
    integrator: str
    step: float  # [s]
    reference_step: float  # [s]
    step_selected: bool  # False if the scene sets it, whatever accuracy is asked
    duration: float  # [s] that both flights last
    quantities: list[Quantity]  # that count
    closed_loop: ClosedLoop | None = None  # None: `quantities` are those of the closed loop
    part: float = PART  # [s] length of the parts that `quantities` are measured in, otherwise

    @property
    def worst(self) -> Quantity:
        """Quantity with the largest error."""
        return worst_of(self.quantities)

    @property
    def met(self) -> bool:
        """True if no error exceeds what was asked for."""
        return self.worst.error <= self.asked


def worst_of(quantities: Iterable[Quantity]) -> Quantity:
    """Return the quantity with the largest error."""
    return max(quantities, key=lambda quantity: quantity.error)


class _Flight(NamedTuple):
    setup: RunConfig
    vehicles: list[FlightData]
    graph: BlockDiagram


def measure(scene: Scene, progress: Progress, step_selected: bool = False) -> FlightAccuracy:
    """Return the accuracy of a scene with a selected solver.

    Args:
        scene: any scene.
        progress: does the work on a run with a description, and shows it.
        step_selected: True if its step was selected for its accuracy.

    Raises:
        SceneError: the scene asks for no accuracy.
        ValueError: a flight fails.
    """
    solver = (scene.vehicles or (scene,))[0][Solver]
    if solver.accuracy is None:
        message = "missing; set the error to compare with, e.g. --set solver.accuracy=1e-4"
        raise SceneError("solver.accuracy", message, source=KeyOrigin(scene.path))
    interval = scene[Communication].interval
    step = interval / (FINER * solver.steps(scene[Communication]))
    strict = max(STRICTER * solver.accuracy, STRICTEST)
    finer = resolve(load(scene.path, [*scene.overrides, f"solver.step={step!r}", f"solver.accuracy={strict!r}"]))
    name = f"{solver.integrator}, step {1e3 * FINER * step:g} ms"
    finer_name = f"{solver.integrator}, step {1e3 * step:g} ms"
    coarse = _fly(scene, resolve(scene), progress, name)
    fine = _fly(scene, finer, progress, finer_name)
    duration = float(min(flight.truth.times[-1] for flight in (*coarse.vehicles, *fine.vehicles)))
    quantities = _differences(coarse.vehicles, fine.vehicles)
    result = FlightAccuracy(solver.accuracy, solver.integrator, FINER * step, step, step_selected, duration, quantities)
    if result.met or not inputs_of_plant(coarse.graph):
        return result
    shift = start_difference(solver.accuracy)
    description = f"{finer_name}, start {shift:g} apart"
    shifted = _fly(scene, with_start_shifted(finer, shift), progress, description)
    apart = worst_of(_differences(shifted.vehicles, fine.vehicles))
    if apart.error <= solver.accuracy:
        return result
    closed_loop = ClosedLoop(quantities, shift, apart, *_cause(coarse, fine, solver.accuracy))
    parts = progress(
        finer, f"{finer_name}, parts of {PART:g} s", lambda show: fly_parts(coarse.graph, finer, TOPICS, show)
    )
    errors = [q for part in parts for q in _differences(coarse.vehicles, part.flights, part.spans)]
    names = dict.fromkeys((q.vehicle, q.name) for q in errors)
    largest = [worst_of(q for q in errors if (q.vehicle, q.name) == name) for name in names]
    return result._replace(quantities=largest, closed_loop=closed_loop)


def _fly(scene: Scene, setup: RunConfig, progress: Progress, description: str) -> _Flight:
    flights, graph = progress(setup, description, lambda show: fly_with_ports(setup, TOPICS, show))
    for flight in flights:
        if flight.failure:
            raise ValueError(f"{scene.path}: {flight.failure}")
    return _Flight(setup, flights, graph)


def _cause(flight: _Flight, exact: _Flight, limit: float) -> tuple[Signal | None, float]:
    """Return the first signal that differs by more than a limit, and the largest true difference at that moment."""
    signal = first_signal(flight.graph, exact.graph, limit)
    if signal is None:
        return None, 0.0
    tick = 0.5 * flight.setup.interval
    moment = [(signal.time - tick, signal.time + tick)]
    return signal, worst_of(_differences(flight.vehicles, exact.vehicles, moment)).error


def _differences(
    flights: Iterable[FlightData], exact: Iterable[FlightData], spans: list[tuple[float, float]] | None = None
) -> list[Quantity]:
    return [q for pair in zip(flights, exact, strict=True) for q in differences(*pair, spans)]


def differences(
    flight: FlightData, exact: FlightData, spans: list[tuple[float, float]] | None = None
) -> list[Quantity]:
    """Return the largest error of each part of the state, at the ticks that both flights have.

    Args:
        flight: any flight.
        exact: the flight to compare with.
        spans: [s] only the moments between these times, end exclusive, in order; None: all.
    """
    result = []
    for name, times, errors in _errors(flight, exact):
        if spans is not None:
            inside = np.searchsorted(np.ravel(spans), times, side="right") % 2 == 1
            times, errors = times[inside], errors[inside]
        if len(times):
            result.append(Quantity(flight.vehicle, name, float(errors.max()), float(times[errors.argmax()])))
    return result


def _errors(flight: FlightData, exact: FlightData) -> Iterator[Errors]:
    """Yield the error of each part of the state, at the ticks that both flights have."""
    for name, field in STATE_FIELDS:
        a, b = (np.asarray(getattr(each.truth, field)) for each in (flight, exact))
        if field == "orientation":
            a, b = matrices(a), matrices(b)
        yield from _error(name, flight.truth.times, a, b)
    if flight.has("battery"):
        for field in BATTERY_FIELDS:
            a, b = (np.asarray(getattr(each.topic("battery"), field)) for each in (flight, exact))
            yield from _error(f"battery {field}", flight.times("battery"), a, b)


def _error(name: str, times: np.ndarray, a: np.ndarray, b: np.ndarray) -> Iterator[Errors]:
    """Yield the error of one part of the state, unless the vehicle does not have it."""
    n = min(len(a), len(b))
    a, b = a[:n].reshape(n, -1), b[:n].reshape(n, -1)
    if a.size and np.isfinite(b).all():
        yield name, times[:n], (np.abs(a - b) / (1.0 + np.abs(b))).max(axis=1)
