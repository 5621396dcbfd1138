"""Effect of resets, invalid values, dropouts and wrong instances in a log on `lapwing identify`.

    python -m benchmarks.identification_faults [--seconds S] [--windows N]

Writes two simulated flights as ULog files for each fault, and estimates three parameters, whose true values are known:
from all samples of the first instances, as without the checks of the import, and from what the import believes.
"""

import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

from lapwing.flights.log_import import channels
from lapwing.flights.log_import.open_flight import open_flight
from lapwing.flights.log_import.recording import LONGEST_HOLD, Recording, Series
from lapwing.flights.rotation_arrays import from_vector, product
from lapwing.services.scene_resolver import load_one
from lapwing.studies.identification.output_error import Fit, OutputError
from lapwing.studies.identification.procedure import start_value
from lapwing.studies.validation.plant_rows import PlantRows
from lapwing.studies.validation.start_states import NO_TRIM

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "flights"))
sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "flights" / "log_import"))
from flight_recordings import BATTERY, INTERVAL, simulated
from flight_writers import ULOG, ned, write_ulog_topics
from test_log_doubts import FLAGS, LOCAL

from benchmarks._command import command_line

SCENE, SEEDS = "crazyflie_21", [1, 2]
KEYS = ("effects.rotor_quadratic.thrust_constant", "airframe.motor.time_constant", "airframe.mass.inertia.0")
EVERY = 2.0  # [s] between two resets or dropouts
DROPOUT = 0.41  # [s]
WANDER = 0.5  # [m/s^2] acceleration of an estimate without position


def events(flight: Recording) -> np.ndarray:
    """Return the number of events up to each sample, shape (n,)."""
    return np.arange(len(flight)) // round(EVERY / INTERVAL)


def clean(path: Path, flight: Recording) -> Path:
    return write_ulog_topics(path, flight)


def position_resets(path: Path, flight: Recording) -> Path:
    moved = flight.position + np.outer(events(flight) % 2, [3.0, -2.0, 0.0])
    return write_ulog_topics(path, replace(flight, position=moved))


def yaw_resets(path: Path, flight: Recording) -> Path:
    turn = from_vector(np.outer(np.radians(40.0) * (events(flight) % 2), [0.0, 0.0, 1.0]))
    return write_ulog_topics(path, replace(flight, attitude=product(turn, flight.attitude)))


def invalid_position(path: Path, flight: Recording) -> Path:
    t = INTERVAL * np.arange(len(flight)) - 5.0
    lost = (t >= 0.0) & (t < 5.0)
    drift = np.outer(np.where(lost, t, 0.0), [WANDER, 0.0, 0.0])
    wrong = replace(flight, velocity=flight.velocity + drift, position=flight.position + 0.5 * drift * t[:, None])
    v = ned(wrong)

    def row(k: int) -> list[float]:
        return [*v["position"][k], *v["velocity"][k], not lost[k], True, not lost[k], True, 0]

    return write_ulog_topics(path, wrong, [(LOCAL, 0, f"{ULOG[LOCAL]}{FLAGS}", "6f5B", row)])


def dropouts(path: Path, flight: Recording) -> Path:
    period, length = round(EVERY / INTERVAL), round(DROPOUT / INTERVAL)
    return write_ulog_topics(path, flight, lost={k for k in range(period, len(flight)) if k % period < length})


def idle_battery(path: Path, flight: Recording) -> Path:
    power = ULOG["battery_status"]
    rows: list[Callable[[int], tuple[float, float]]] = [lambda k: (0.0, 0.0), lambda k: (BATTERY, 2.0)]
    return write_ulog_topics(path, flight, [("battery_status", n, power, "2f", row) for n, row in enumerate(rows)])


def idle_motors(path: Path, flight: Recording) -> Path:
    v, outputs = ned(flight), "float[4] control;"
    return write_ulog_topics(
        path, flight,
        [("actuator_motors", 0, outputs, "4f", lambda k: (0.0,) * 4),
         ("actuator_motors", 1, outputs, "4f", lambda k: v["duty"][k])],
    )  # fmt: skip


FAULTS = (clean, position_resets, yaw_resets, invalid_position, dropouts, idle_battery, idle_motors)


@contextmanager
def unchecked() -> Iterator[None]:
    """Import all finite samples of the first instances, over gaps of up to `LONGEST_HOLD`."""

    def near(series: Series, grid: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        after = np.clip(np.searchsorted(series.time, grid), 1, len(series.time) - 1)
        return series.time[after] - series.time[after - 1] > LONGEST_HOLD, np.zeros(len(grid), bool)

    changes: dict[str, Any] = {
        "choose": lambda path, sources, choices: ({name: s[0] for name, s in sources.items() if s}, []),
        "with_jumps": lambda chosen: {name: replace(s, doubts={}, resets={}) for name, s in chosen.items()},
        "near": near,
    }
    with patch.multiple(channels, **changes):
        yield


def estimate(paths: list[Path], start: list[float], windows: int) -> Fit | str:
    """Return the estimates, or the message of the refusal."""
    try:
        flights = [open_flight(path) for path in paths]
        return OutputError(PlantRows(SCENE, INTERVAL), flights, KEYS, start, windows, NO_TRIM).solve()
    except ValueError as error:
        return str(error).rpartition("/")[2]


def shown(result: Fit | str, true: np.ndarray) -> str:
    """Return the errors of the estimates in percent, and the largest in standard errors."""
    if isinstance(result, str):
        return result
    error = result.values - true
    percents = ", ".join(f"{value:+.1f}" for value in 100.0 * error / true)
    return f"{percents} %; {np.abs(error / result.standard_errors).max():.1f} standard errors"


def main(seconds: float = 16.0, windows: int = 150) -> None:
    scene = load_one(SCENE, ())
    true = np.array([start_value(scene, key) for key in KEYS])
    flights = simulated(PlantRows(SCENE, INTERVAL), seconds, SEEDS)
    print(f"errors of {', '.join(KEYS)}")
    with tempfile.TemporaryDirectory() as folder:
        for write in FAULTS:
            paths = [write(Path(folder) / f"{write.__name__}_{k}.ulg", flight) for k, flight in enumerate(flights)]
            start = list(1.05 * true)
            with unchecked():
                before = estimate(paths, start, windows)
            after = estimate(paths, start, windows)
            print(f"{write.__name__}: before {shown(before, true)}; after {shown(after, true)}", flush=True)


if __name__ == "__main__":
    command_line(main)
