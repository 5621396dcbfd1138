"""Error of a scene's own flight: flown as it is and with much finer steps, and compared at every tick.

Both flights are closed loops with the same random numbers. Their difference is the error of the solver, in the state of
each vehicle as it is recorded, with all that the autopilot makes of it.
"""

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
from rich.box import SIMPLE
from rich.console import Console
from rich.table import Table

from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.scene import KeyOrigin, Scene, SceneError
from lapwing.messages.topics import BATTERY, TRUTH
from lapwing.services.common.communication_schema import Communication
from lapwing.services.plant.schema import Solver
from lapwing.services.scene_resolver import load, resolve
from lapwing.studies import json_file
from lapwing.studies.accuracy.coordinates import matrices
from lapwing.studies.flight_data import FlightData

FINER = 8  # times as many steps in a communication step
STRICTER = 1e-3  # times the accuracy, in contact
STRICTEST = 1e-10  # beyond which contact is limited by round-off
TOPICS = (TRUTH, BATTERY)
BATTERY_FIELDS = ("voltage", "charge")  # of BatteryState; its current jumps where a motor is switched off

Fly = Callable[[RunConfig, str], list[FlightData]]  # of a run and its description


class Quantity(NamedTuple):
    """Largest error of one part of a vehicle's state, of its numbers relative to 1 + their size."""

    vehicle: str
    name: str
    error: float
    time: float  # [s] of the moment


class FlightAccuracy(NamedTuple):
    """Accuracy of a flight."""

    asked: float
    integrator: str
    step: float  # [s]
    reference_step: float  # [s]
    step_selected: bool  # False if the scene sets it, whatever accuracy is asked
    duration: float  # [s] that both flights last
    quantities: list[Quantity]

    @property
    def worst(self) -> Quantity:
        """Quantity with the largest error."""
        return max(self.quantities, key=lambda quantity: quantity.error)


def measure(scene: Scene, fly: Fly, step_selected: bool = False) -> FlightAccuracy:
    """Return the accuracy of a scene with a selected solver.

    Args:
        scene: any scene.
        fly: flies a run and returns the flights of its vehicles with `TOPICS`.
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
    finer = load(scene.path, [*scene.overrides, f"solver.step={step!r}", f"solver.accuracy={strict!r}"])
    coarse, fine = _flights(scene, fly), _flights(finer, fly)
    quantities = [q for pair in zip(coarse, fine, strict=True) for q in differences(*pair)]
    duration = min(flight.truth.times[-1] for flight in (*coarse, *fine))
    step_used = FINER * step
    return FlightAccuracy(
        solver.accuracy, solver.integrator, step_used, step, step_selected, float(duration), quantities
    )


def _flights(scene: Scene, fly: Fly) -> list[FlightData]:
    solver = (scene.vehicles or (scene,))[0][Solver]
    flights = fly(resolve(scene), f"{solver.integrator}, step {1e3 * solver.step:g} ms")
    for flight in flights:
        if flight.failure:
            raise ValueError(f"{scene.path}: {flight.failure}")
    return flights


def differences(flight: FlightData, exact: FlightData) -> list[Quantity]:
    """Return the largest error of each part of the state, at the ticks that both flights have."""
    pairs: dict[str, tuple[np.ndarray, np.ndarray, np.ndarray]] = {}
    times = flight.truth.times
    for name, field in (
        ("position", "position"),
        ("attitude", "orientation"),
        ("velocity", "velocity"),
        ("body rates", "angular_velocity"),
        ("rotor speed", "rotor_speed"),
    ):
        a, b = np.asarray(getattr(flight.truth, field)), np.asarray(getattr(exact.truth, field))
        pairs[name] = times, *((matrices(a), matrices(b)) if field == "orientation" else (a, b))
    if flight.has("battery"):
        for field in BATTERY_FIELDS:
            a, b = (np.asarray(getattr(each.topic("battery"), field)) for each in (flight, exact))
            pairs[f"battery {field}"] = flight.times("battery"), a, b
    return [
        Quantity(flight.vehicle, name, *largest)
        for name, (at, a, b) in pairs.items()
        if (largest := _largest(at, a, b)) is not None
    ]


def _largest(times: np.ndarray, a: np.ndarray, b: np.ndarray) -> tuple[float, float] | None:
    """Return (largest error, its time [s]); None of what the vehicle does not have."""
    n = min(len(a), len(b))
    a, b = a[:n].reshape(n, -1), b[:n].reshape(n, -1)
    if not a.size or not np.isfinite(b).all():
        return None
    errors = (np.abs(a - b) / (1.0 + np.abs(b))).max(axis=1)
    return float(errors.max()), float(times[errors.argmax()])


def show(console: Console, result: FlightAccuracy) -> None:
    """Print the errors as one table."""
    fleet = len({quantity.vehicle for quantity in result.quantities}) > 1
    table = Table(box=SIMPLE, pad_edge=False)
    for name in ("quantity", "largest error", "got / asked", "at (s)"):
        table.add_column(name, justify="left" if name == "quantity" else "right", no_wrap=True)
    for q in result.quantities:
        label = f"{q.vehicle}: {q.name}" if fleet else q.name
        table.add_row(label, f"{q.error:.1e}", f"{q.error / result.asked:.2g}", f"{q.time:.3f}")
    console.print(
        f"{result.integrator}, step {1e3 * result.step:g} ms, against steps of {1e3 * result.reference_step:g} ms; "
        f"{result.duration:g} s, errors relative to 1 + size",
        highlight=False,
    )
    console.print(table)
    worst = result.worst
    verdict = "met" if worst.error <= result.asked else "missed"
    console.print(
        f"accuracy {verdict}: asked {result.asked:g}, got {worst.error:.1e} ({worst.name}, {worst.time:.3f} s)",
        highlight=False,
    )
    if verdict == "missed" and not result.step_selected:
        cause = f"solver.step: set to {result.step:g} s, which does not depend on the accuracy"
        console.print(f"{cause}; remove it, and a step is selected", highlight=False, soft_wrap=True)


def write_json(path: Path, result: FlightAccuracy) -> None:
    """Write the errors."""
    json_file.write_json(path, {**result._asdict(), "got": result.worst.error, "worst": result.worst})
