"""Validation of a scene's plant on recorded flights."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lapwing.cosim.scene import Overrides, Scene
from lapwing.studies import json_file
from lapwing.studies.flight_import.open_flight import open_flight
from lapwing.studies.flight_import.recording import Recording
from lapwing.studies.validation.closed_loop import ClosedLoop, fly_setpoints
from lapwing.studies.validation.linear_baseline import linear_fit
from lapwing.studies.validation.plant_rows import PlantRows
from lapwing.studies.validation.prediction_metrics import FIELDS, Metric, constant_velocity, magnitudes, pool_flights
from lapwing.studies.validation.start_states import USUAL_TRIM, StartStates, TrimMemory, start_states
from lapwing.studies.validation.windows import Errors, compare, predict, thrust_ratio, window_starts, without_window

USABLE = "use flights with position and attitude that leave the ground"
STRIDE = 5  # samples between the starts of two windows
SAME_VEHICLE = 0.25  # largest difference of the thrust ratio from 1; 0.12 in 44 flights of one Crazyflie


@dataclass(frozen=True)
class FlightErrors:
    """Prediction errors of one flight."""

    recording: Recording
    starts: np.ndarray  # first samples of the windows
    plant: Errors
    states: StartStates
    thrust_ratio: float  # predicted over measured specific force along body z; NaN if the vehicle falls


@dataclass(frozen=True)
class Validation:
    """Prediction errors of a scene's plant over flights."""

    scene: str
    interval: float  # [s] duration of a step
    horizons: tuple[int, ...]  # [steps]
    memory: TrimMemory
    flights: tuple[FlightErrors, ...]
    skipped: tuple[str, ...]  # a line for each flight that is excluded, or not simulated in closed loop
    plant: list[list[Metric]]  # by horizon and field
    baselines: dict[str, list[list[Metric]]]
    closed_loop: tuple[ClosedLoop, ...] = ()

    @property
    def windows(self) -> int:
        """Number of windows."""
        return sum(len(f.starts) for f in self.flights)

    @property
    def warnings(self) -> tuple[str, ...]:
        """A line for each flight that looks like one of another vehicle."""
        return tuple(
            f"{f.recording.name}: the motor commands produce {f.thrust_ratio:.2f} times the measured specific force; "
            f"check that {self.scene} is the vehicle of this log"
            for f in self.flights
            if abs(f.thrust_ratio - 1.0) > SAME_VEHICLE
        )


def validate(
    scene: Scene | str | Path,
    paths: Sequence[Path],
    mapping: str | None,
    horizons: tuple[int, ...],
    overrides: Overrides = (),
    memory: TrimMemory = USUAL_TRIM,
    stride: int = STRIDE,
    closed_loop: bool = False,
    report: Callable[[str, int, int], None] = lambda text, done, total: None,
) -> Validation:
    """Predict all windows of all flights, and compare them with the measurements.

    Args:
        scene: scene with the vehicle's plant.
        paths: files of flights, all with the same sampling rate.
        mapping: mapping of raw files, see `open_flight`.
        horizons: steps after which to compare, ascending.
        overrides: overrides of the scene.
        memory: time constants of the trim.
        stride: samples between the starts of two windows.
        closed_loop: True to simulate the recorded setpoints with the scene's autopilot, too.
        report: called with a description of the progress, the number of finished flights, and the total.

    Raises:
        ValueError: a flight cannot be read, none has a window in the air, or rates or rotors differ.
    """
    recordings, skipped = read_flights(paths, mapping, report)
    interval = recordings[0].interval
    used, starts, unused = [], [], []
    for recording in recordings:
        result = window_starts(recording, horizons[-1], stride)
        if len(result):
            used.append(recording)
            starts.append(result)
        else:
            unused.append(without_window(recording))
    if not used:
        raise ValueError(f"{unused[0]}; {USABLE}")
    skipped += unused
    plant = PlantRows(scene, interval, overrides)
    for recording in used:
        if recording.rotors != plant.rotors:
            raise ValueError(
                f"{recording.name}: {recording.rotors} motors, the scene has {plant.rotors}; use the vehicle's scene"
            )
    report("start states", 0, len(used))
    states = start_states(plant, used, memory)
    flights = []
    for k, (recording, s, state) in enumerate(zip(used, starts, states, strict=True)):
        report(recording.name, k, len(used))
        errors = compare(recording, s, horizons, predict(plant, recording, s, state, horizons))
        flights.append(FlightErrors(recording, s, errors, state, thrust_ratio(recording, s, state)))
    report("baselines", len(used), len(used))
    constant = [constant_velocity(r, s, horizons) for r, s in zip(used, starts, strict=True)]
    baselines = {"constant_velocity": constant, "linear_fit": linear_fit(used, starts, horizons)}
    loops = []
    for k, recording in enumerate(used if closed_loop else []):
        report(f"closed loop: {recording.name}", k, len(used))
        loop = fly_setpoints(scene, recording, overrides)
        if loop is None:
            skipped.append(f"{recording.name}: no setpoints in the air to fly in closed loop")
        else:
            loops.append(loop)
    return Validation(
        str(Path(str(getattr(scene, "name", scene))).stem), interval, horizons, memory, tuple(flights), tuple(skipped),
        pool_flights([magnitudes(f.plant) for f in flights]),
        {name: pool_flights([magnitudes(e) for e in errors]) for name, errors in baselines.items()}, tuple(loops),
    )  # fmt: skip


def read_flights(
    paths: Sequence[Path], mapping: str | None, report: Callable[[str, int, int], None]
) -> tuple[list[Recording], list[str]]:
    """Read flights with the same rate; return them, and a line for each file that repeats an earlier flight.

    A repeated flight would narrow the confidence intervals, and could be used both to estimate and to test.

    Raises:
        ValueError: a flight cannot be read, or its rate differs from the first one's.
    """
    recordings: list[Recording] = []
    repeated = []
    for k, path in enumerate(paths):
        report(f"reading {path.name}", k, len(paths))
        recording = open_flight(path, mapping)
        if original := next((other.name for other in recordings if recording.repeats(other)), None):
            repeated.append(f"{recording.name}: the same flight as {original}")
            continue
        recordings.append(recording)
        if abs(recording.interval - recordings[0].interval) > 1e-6:
            rates = f"{1.0 / recording.interval:g} Hz, others {1.0 / recordings[0].interval:g} Hz"
            raise ValueError(f"{path}: sampled at {rates}; validate them separately")
    return recordings, repeated


def write_json(path: Path, validation: Validation) -> None:
    """Write errors, confidence intervals and baselines by horizon."""
    rows = []
    for k, steps in enumerate(validation.horizons):
        row: dict = {"steps": steps, "time": steps * validation.interval, "windows": validation.windows}
        row |= _values(validation.plant[k])
        row["confidence_95"] = {name: [m.low, m.high] for name, m in zip(FIELDS, validation.plant[k], strict=True)}
        row["baselines"] = {name: _values(rows_of[k]) for name, rows_of in validation.baselines.items()}
        rows.append(row)
    flights = {f.recording.name: _flight(validation, f) for f in validation.flights}
    content = {
        "scene": validation.scene,
        "trim": validation.memory,
        "horizons": rows,
        "flights": flights,
        "skipped": validation.skipped,
        "warnings": validation.warnings,
    }
    if validation.closed_loop:
        content["closed_loop"] = [
            {
                "flight": c.name,
                "seconds": c.time[-1],
                "difference": c.difference,
                "tracking_error": {name: c.tracking_error(getattr(c, name)) for name in ("simulated", "recorded")},
            }
            for c in validation.closed_loop
        ]
    json_file.write_json(path, content)


def _flight(validation: Validation, flight: FlightErrors) -> dict:
    means = _values(pool_flights([magnitudes(flight.plant)[:, -1:]])[0])
    return {
        "windows": len(flight.starts),
        **means,
        "thrust_ratio": flight.thrust_ratio,
        "faults": flight.recording.faults,
        "notes": flight.recording.notes,
    }


def _values(metrics: list[Metric]) -> dict[str, float]:
    return {name: m.mean for name, m in zip(FIELDS, metrics, strict=True)}
