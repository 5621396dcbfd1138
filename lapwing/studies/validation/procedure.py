"""Validation of a scene's plant on recorded flights."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import compress
from pathlib import Path

import numpy as np

from lapwing.cosim.scene import Overrides, Scene
from lapwing.flights.log_import.open_flight import open_flight
from lapwing.flights.log_import.recording import Recording
from lapwing.services.common.firmware.motor_order import motors
from lapwing.services.common.firmware.schema import firmware_of
from lapwing.services.common.schemas.vehicle_schema import airframe
from lapwing.services.scene_resolver import load_one
from lapwing.studies.validation.closed_loop import ClosedLoop, fly_setpoints
from lapwing.studies.validation.linear_baseline import linear_fit
from lapwing.studies.validation.plant_rows import PlantRows
from lapwing.studies.validation.prediction_metrics import (
    FIELDS,
    Metric,
    clusters,
    constant_velocity,
    magnitudes,
    noisier,
    pool,
    ratios,
)
from lapwing.studies.validation.start_states import (
    USUAL_TRIM,
    StartStates,
    TrimMemory,
    start_states,
    trim_memory,
    unmeasured_motion,
    with_made_up_motion,
)
from lapwing.studies.validation.windows import Errors, compare, predict, thrust_ratio, window_starts, without_window

USABLE = "use flights that leave the ground"
STRIDE = 5  # samples between the starts of two windows
THINNED = 4  # windows for each one that measures the effect of noise
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
    clusters: int  # number of independent parts: flights, or blocks of few flights
    plant: list[list[Metric]]  # by horizon and field
    baselines: dict[str, list[list[Metric]]]
    ratios: dict[str, list[list[Metric]]]  # error of the plant over that of each baseline
    noise: np.ndarray  # errors that the noise of the measurements alone causes, shape (horizons, fields)
    missing: tuple[str, ...] = ()  # fields that the logs do not have
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
    flights, skipped = read_flights(paths, mapping, report)
    missing = unmeasured_motion(flights)
    flights = [with_made_up_motion(flight, missing) for flight in flights]
    recordings, unused = with_windows(flights, horizons[-1], stride)
    plant = plant_of(scene, recordings, overrides)
    recordings = on_rotors(load_one(scene, overrides), recordings)
    name = Path(str(getattr(scene, "name", scene))).stem
    memory = trim_memory(memory, missing)
    validation = compare_with_flights(name, plant, recordings, horizons, memory, stride, report, unmeasured=missing)
    loops, unflown = [], []
    for k, recording in enumerate(recordings if closed_loop else []):
        report(f"closed loop: {recording.name}", k, len(recordings))
        loop = None if "position" in missing else fly_setpoints(scene, recording, overrides)
        if loop is None:
            lacking = "position" if "position" in missing else "setpoints in the air"
            unflown.append(f"{recording.name}: no {lacking} to fly in closed loop")
        else:
            loops.append(loop)
    return replace(validation, skipped=(*skipped, *unused, *unflown), closed_loop=tuple(loops))


def compare_with_flights(
    name: str,
    plant: PlantRows,
    recordings: list[Recording],
    horizons: tuple[int, ...],
    memory: TrimMemory,
    stride: int,
    report: Callable[[str, int, int], None] = lambda text, done, total: None,
    others: Sequence[Recording] = (),
    unmeasured: tuple[str, ...] = (),
) -> Validation:
    """Compare the predictions of a plant's first parameter set with flights that have windows.

    Args:
        name: name of the scene.
        plant: plant at the interval of the recordings.
        recordings: flights.
        horizons: see `validate`, likewise `memory`, `stride` and `report`.
        others: further flights to which the linear baseline is fitted.
        unmeasured: fields that are not compared, since the flights have made-up values of them.
    """
    every = [*recordings, *others]
    starts = [window_starts(r, horizons[-1], stride) for r in every]
    report("start states", 0, len(recordings))
    flights = []
    for k, (recording, state) in enumerate(zip(recordings, start_states(plant, recordings, memory), strict=True)):
        report(recording.name, k, len(recordings))
        predicted = predict(plant, recording, starts[k], state, horizons)
        errors = compare(recording, starts[k], horizons, predicted)
        ratio = thrust_ratio(recording, starts[k], state, "velocity" not in unmeasured)
        flights.append(FlightErrors(recording, starts[k], errors, state, ratio))
    report("baselines", len(recordings), len(recordings))
    constant = [constant_velocity(f.recording, f.starts, horizons) for f in flights]
    baselines = {"constant_velocity": constant, "linear_fit": linear_fit(every, starts, horizons)[: len(flights)]}
    cluster = clusters([f.starts for f in flights], plant.interval)
    own = _all_magnitudes([f.plant for f in flights])
    own[..., [FIELDS.index(field) for field in unmeasured]] = np.nan
    theirs = {key: _all_magnitudes(errors) for key, errors in baselines.items()}
    return Validation(
        name, plant.interval, horizons, memory, tuple(flights), (), int(cluster.max()) + 1, pool(own, cluster),
        {key: pool(values, cluster) for key, values in theirs.items()},
        {key: ratios(own, values, cluster) for key, values in theirs.items()},
        _noise_errors(plant, flights, horizons, memory), missing=tuple(unmeasured),
    )  # fmt: skip


def _noise_errors(
    plant: PlantRows, flights: Sequence[FlightErrors], horizons: tuple[int, ...], memory: TrimMemory
) -> np.ndarray:
    """Return the mean errors that noise alone causes, shape (horizons, fields). See `measurement_noise`."""
    changes = []
    noisy = [noisier(f.recording, k) for k, f in enumerate(flights)]
    for flight, recording, state in zip(flights, noisy, start_states(plant, noisy, memory), strict=True):
        starts = flight.starts[::THINNED]
        errors = compare(recording, starts, horizons, predict(plant, recording, starts, state, horizons))
        changes.append(Errors(*(a - b[::THINNED] for a, b in zip(errors, flight.plant, strict=True))))
    values = _all_magnitudes(changes)
    return np.array([[m.mean for m in row] for row in pool(values, np.zeros(len(values), int))])


def _all_magnitudes(errors: Sequence[Errors]) -> np.ndarray:
    return np.concatenate([magnitudes(e) for e in errors])


def plant_of(scene: Scene | str | Path, recordings: Sequence[Recording], overrides: Overrides = ()) -> PlantRows:
    """Return the scene's plant at the interval of the recordings.

    Raises:
        ValueError: a recording has another number of motors.
    """
    plant = PlantRows(scene, recordings[0].interval, overrides)
    for recording in recordings:
        if recording.rotors != plant.rotors:
            raise ValueError(
                f"{recording.name}: {recording.rotors} motors, the scene has {plant.rotors}; use the vehicle's scene"
            )
    return plant


def on_rotors(base: Scene, recordings: Sequence[Recording]) -> list[Recording]:
    """Return the flights with the voltages [V] of the scene's rotors, in their order.

    The log of a firmware that flies the scene has the firmware's order.
    """
    frame, firmware = airframe(base), firmware_of(base)
    result = []
    for recording in recordings:
        volts = recording.in_volts(frame.motor.max_voltage)
        if recording.firmware == firmware and recording.rotors == len(frame.rotors.position):
            volts = replace(volts, motor_voltage=volts.motor_voltage[:, list(motors(base).order)])
        result.append(volts)
    return result


def read_flights(
    paths: Sequence[Path], mapping: str | None, report: Callable[[str, int, int], None]
) -> tuple[list[Recording], list[str]]:
    """Read flights with the same rate; return them, and a line for each file that repeats an earlier flight.

    A repeated flight would narrow the confidence intervals, and could be used both to estimate and to test.

    Raises:
        ValueError: a flight cannot be read, or its rate differs from the first one's.
    """
    recordings: list[Recording] = []
    skipped = []
    for k, path in enumerate(paths):
        report(f"reading {path.name}", k, len(paths))
        recording = open_flight(path, mapping)
        if original := next((other.name for other in recordings if recording.repeats(other)), None):
            skipped.append(f"{recording.name}: the same flight as {original}")
            continue
        recordings.append(recording)
        if abs(recording.interval - recordings[0].interval) > 1e-6:
            rates = f"{1.0 / recording.interval:g} Hz, others {1.0 / recordings[0].interval:g} Hz"
            raise ValueError(f"{path}: sampled at {rates}; validate them separately")
    return recordings, skipped


def with_windows(recordings: list[Recording], longest: int, stride: int = STRIDE) -> tuple[list[Recording], list[str]]:
    """Return the flights with windows of `longest` samples in the air, and a line for each other flight.

    Raises:
        ValueError: there is no such flight.
    """
    flies = [len(window_starts(r, longest, stride)) > 0 for r in recordings]
    unused = [without_window(r) for r, flying in zip(recordings, flies, strict=True) if not flying]
    if not any(flies):
        raise ValueError(f"{unused[0]}; {USABLE}")
    return list(compress(recordings, flies)), unused
