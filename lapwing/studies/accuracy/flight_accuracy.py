"""Error of a scene's own flight: flown as it is and with much finer steps, and compared at every tick.

Both flights are closed loops with the same random numbers. Their difference is the error of the solver, in the state of
each vehicle as it is recorded, with all that the autopilot makes of it. Some closed loops make a difference of a
ten-thousandth of the accuracy in the start larger than the accuracy (`sensitivity`): no solver can be accurate enough.
There the error of the solver is measured under recorded commands (`open_loop`), and the closed loop is shown beside it.
"""

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.diagram.block_diagram import BlockDiagram
from lapwing.cosim.scene import KeyOrigin, Scene, SceneError, with_values
from lapwing.services.common.communication_schema import Communication
from lapwing.services.plant.schema import Solver
from lapwing.services.process_table import foreign_firmware
from lapwing.services.scene_resolver import from_resolved, load, resolve
from lapwing.studies.accuracy.open_loop import PART, fly_parts, inputs_of_plant
from lapwing.studies.accuracy.sensitivity import Signal, first_signal, start_difference, with_start_shifted
from lapwing.studies.accuracy.state_errors import TOPICS, Quantity, differences_of_all, worst_of
from lapwing.studies.flight_data import FlightData
from lapwing.studies.simulate import fly_with_ports

FINER = 8  # times as many steps in a communication step
STRICTER = 1e-3  # times the accuracy, in contact
STRICTEST = 1e-10  # beyond which contact is limited by round-off
MISSING = "missing; set the error to compare with, e.g. --set solver.accuracy=1e-4"
Work = Callable[[Callable[[int], None]], Any]  # flies, and calls its argument with the tick that is reached
Progress = Callable[[RunConfig, str, Work], Any]  # of a run and the description of the work, whose result it returns


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
    part: float | None = None  # [s] length of the parts that `quantities` are measured in; None: of the closed loop
    closed_loop: ClosedLoop | None = None

    @property
    def worst(self) -> Quantity:
        """Quantity with the largest error."""
        return worst_of(self.quantities)

    @property
    def met(self) -> bool:
        """True if no error exceeds what was asked for."""
        return self.worst.error <= self.asked


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
        ValueError: a flight fails, or a foreign firmware flies.
    """
    solver = (scene.vehicles or (scene,))[0][Solver]
    if solver.accuracy is None:
        raise SceneError("solver.accuracy", MISSING, source=KeyOrigin(scene.path))
    setup = resolve(scene)
    if firmware := foreign_firmware(setup):
        raise ValueError(
            f"{scene.path}: no two runs of {firmware} are equal; record one with lapwing run, and check its log"
        )
    step, overrides = _finer(scene, solver.accuracy)
    finer = resolve(load(scene.path, [*scene.overrides, *overrides]))
    name = f"{solver.integrator}, step {1e3 * FINER * step:g} ms"
    finer_name = f"{solver.integrator}, step {1e3 * step:g} ms"
    coarse = _fly(scene, setup, progress, name)
    fine = _fly(scene, finer, progress, finer_name)
    duration = float(min(flight.truth.times[-1] for flight in (*coarse.vehicles, *fine.vehicles)))
    quantities = differences_of_all(coarse.vehicles, fine.vehicles)
    result = FlightAccuracy(solver.accuracy, solver.integrator, FINER * step, step, step_selected, duration, quantities)
    if result.met or not inputs_of_plant(coarse.graph):
        return result
    shift = start_difference(solver.accuracy)
    description = f"{finer_name}, start {shift:g} apart"
    shifted = _fly(scene, with_start_shifted(finer, shift), progress, description)
    apart = worst_of(differences_of_all(shifted.vehicles, fine.vehicles))
    if apart.error <= solver.accuracy:
        return result
    closed_loop = ClosedLoop(quantities, shift, apart, *_cause(coarse, fine, solver.accuracy))
    return result._replace(
        quantities=_in_parts(coarse, finer, progress, finer_name), part=PART, closed_loop=closed_loop
    )


def measure_recorded(
    setup: RunConfig, flown: Mapping[str, Any], progress: Progress, accuracy: float | None = None
) -> FlightAccuracy:
    """Return the accuracy of the solver in a recorded run, whose commands need not be those of Lapwing's autopilot.

    Args:
        setup: configuration of the run, of one vehicle, that ends at its last recorded tick.
        flown: its commands, keyword arguments of `fly_with_ports`.
        progress: see `measure`.
        accuracy: error to compare with; None: that of the run.

    Raises:
        SceneError: neither has an accuracy.
        ValueError: several vehicles, or the flight fails.
    """
    if not setup.vehicle:
        raise ValueError(f"{setup.scene}: has {len(setup.vehicles)} vehicles; expected the log of one vehicle")
    scene = from_resolved(setup.resolved, setup.scene)
    solver, asked = scene[Solver], accuracy or scene[Solver].accuracy
    if asked is None:
        raise SceneError("solver.accuracy", MISSING)
    step, overrides = _finer(scene, asked)
    finer = resolve(from_resolved(with_values(setup.resolved, overrides)))._replace(last_tick=setup.last_tick)
    coarse = _fly(
        scene, setup, progress, f"recorded commands, {solver.integrator}, step {1e3 * FINER * step:g} ms", flown
    )
    quantities = _in_parts(coarse, finer, progress, f"{solver.integrator}, step {1e3 * step:g} ms")
    duration = float(coarse.vehicles[0].truth.times[-1])
    return FlightAccuracy(asked, solver.integrator, FINER * step, step, False, duration, quantities, PART)


def _finer(scene: Scene, accuracy: float) -> tuple[float, list[str]]:
    """Return the step [s] of the finer flight and its overrides."""
    solver = (scene.vehicles or (scene,))[0][Solver]
    step = scene[Communication].interval / (FINER * solver.steps(scene[Communication]))
    return step, [f"solver.step={step!r}", f"solver.accuracy={max(STRICTER * accuracy, STRICTEST)!r}"]


def _in_parts(coarse: _Flight, finer: RunConfig, progress: Progress, name: str) -> list[Quantity]:
    """Return the largest errors of a flight in parts with finer steps."""
    parts = progress(finer, f"{name}, parts of {PART:g} s", lambda show: fly_parts(coarse.graph, finer, TOPICS, show))
    errors = [q for part in parts for q in differences_of_all(coarse.vehicles, part.flights, part.spans)]
    names = dict.fromkeys((q.vehicle, q.name) for q in errors)
    return [worst_of(q for q in errors if (q.vehicle, q.name) == name) for name in names]


def _fly(
    scene: Scene,
    setup: RunConfig,
    progress: Progress,
    description: str,
    flown: Mapping[str, Any] = MappingProxyType({}),
) -> _Flight:
    flights, graph = progress(setup, description, lambda show: fly_with_ports(setup, TOPICS, show, **flown))
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
    return signal, worst_of(differences_of_all(flight.vehicles, exact.vehicles, moment)).error
