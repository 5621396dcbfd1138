"""Prediction windows of recordings, and the plant's prediction over them."""

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from lapwing.flights.log_import.recording import LOWEST, Recording
from lapwing.flights.rotation_arrays import conjugate, product, rotation_vector, specific_force
from lapwing.studies.validation.plant_rows import MOTION, PlantRows
from lapwing.studies.validation.start_states import StartStates

PAST = 20  # number of samples before a window that must be valid, for rotor speeds and trim
POWER, WIDTH = MOTION + 3, MOTION + 4  # column of the power, and number of columns, of a prediction
BATCH = 16_384  # windows per batch


class Errors(NamedTuple):
    """Predicted minus measured values of n windows at h horizons."""

    position: np.ndarray  # [m] world, shape (n, h, 3)
    velocity: np.ndarray  # [m/s] world, shape (n, h, 3)
    attitude: np.ndarray  # [rad] rotation vector from the measured to the predicted body, shape (n, h, 3)
    rate: np.ndarray  # [rad/s] body, shape (n, h, 3)
    specific_force: np.ndarray  # [m/s^2] body, mean over the last tick, shape (n, h, 3); NaN where not measured
    power: np.ndarray  # [W] electrical power of the motors, shape (n, h, 1); NaN where not measured


def window_starts(flight: Recording, longest: int, stride: int) -> np.ndarray:
    """Return the possible first samples of windows: valid and airborne from `PAST` samples before to the end."""
    height = flight.position[:, 2]
    usable = flight.valid & (height > LOWEST) & (flight.motor_voltage.max(axis=1) > 0.0)
    count = np.concatenate([[0], np.cumsum(~usable)])
    starts = np.arange(PAST, len(flight) - longest, stride)
    return starts[count[starts + longest + 1] == count[starts - PAST]]


def without_window(flight: Recording) -> str:
    """Return the message on a flight in which `window_starts` finds no window."""
    reasons = [f"no {', '.join(flight.missing)}"] if flight.missing else []
    reasons += [flight.obstacle] if flight.obstacle else []
    return f"{flight.name}: {' and '.join(reasons) or 'no valid window in the air'}"


def thrust_ratio(flight: Recording, starts: np.ndarray, states: StartStates, by_velocity: bool) -> float:
    """Return the ratio of predicted to measured specific force along body z, of their medians over the windows.

    Both follow from the change of velocity over the first sample of each window, so the ratio needs no accelerometer,
    unless `by_velocity` is False. It is 1 for the scene's own vehicle, and thrust over mass of the scene over that of
    any other vehicle in hover. NaN if the measured force is not positive.
    """
    acceleration = (flight.velocity[starts + 1] - flight.velocity[starts]) / flight.interval
    measured = specific_force(flight.attitude[starts], acceleration)[:, 2]
    predicted = measured - states.residual[0, starts, 2]
    force = float(np.median(measured if by_velocity else flight.specific_force[starts, 2]))
    return float(np.median(predicted)) / force if force > 0.0 else np.nan


def predict(
    plant: PlantRows,
    flight: Recording,
    starts: np.ndarray,
    states: StartStates,
    horizons: tuple[int, ...],
    parameter_set: int = 0,
) -> np.ndarray:
    """Step the plant from the measured states under the measured commands.

    Returns:
        Position, attitude, velocity and omega at each horizon, the acceleration of the last tick [m/s^2] world, and the
        power [W], NaN if no flight has measured it; shape (n, h, 17).
    """
    return predict_all(plant, [flight], [Span(0, starts, parameter_set)], [states], horizons)[0]


class Span(NamedTuple):
    """Windows of one flight to predict with one parameter set."""

    flight: int
    starts: np.ndarray
    parameter_set: int


def predict_all(
    plant: PlantRows,
    flights: Sequence[Recording],
    spans: Sequence[Span],
    states: Sequence[StartStates],
    horizons: tuple[int, ...],
) -> list[np.ndarray]:
    """Predict windows of many flights and parameter sets in parallel. See `predict` for the result of each span.

    Args:
        plant: plant with its parameter sets.
        flights: recordings.
        spans: windows to predict, with flight and parameter set.
        states: start states of each flight.
        horizons: samples after which to predict, ascending.
    """
    flight = np.concatenate([np.full(len(s.starts), s.flight) for s in spans])
    set_index = np.concatenate([np.full(len(s.starts), s.parameter_set) for s in spans])
    start = np.concatenate([s.starts for s in spans])
    first = np.concatenate([[0], np.cumsum([len(r) for r in flights])])
    measured = np.concatenate([np.column_stack([r.position, r.attitude, r.velocity, r.omega]) for r in flights])
    volts = np.concatenate([r.motor_voltage for r in flights])
    first_rows = first[flight] + start
    speed, force, torque = (
        np.concatenate([getattr(s, name) for s in states], axis=1) for name in ("rotor_speed", "force", "torque")
    )
    out = np.full((len(start), len(horizons), WIDTH), np.nan)
    ends = np.array(horizons)
    powered = any(np.isfinite(r.power).any() for r in flights)
    for low in range(0, len(start), BATCH):
        part = slice(low, low + BATCH)
        rows, sets = first_rows[part], set_index[part]
        blocks = plant.start(sets)
        plant.write(blocks, slice(0, MOTION), measured[rows])
        plant.write(blocks, slice(MOTION, MOTION + plant.rotors), speed[sets, rows])
        plant.add_wrench(blocks, force[sets, rows], torque[sets, rows])
        traces = []
        for k, (begin, end) in enumerate(pairwise([0, *horizons])):
            traces.append(plant.advance_along(blocks, volts[rows + np.arange(begin, end)[:, None]]))
            if powered:
                out[part, k, POWER] = plant.power(blocks, len(rows))
        trace = np.concatenate(traces)
        velocity = np.concatenate([measured[None, rows, 7:10], trace[..., 7:10]])
        out[part, :, :MOTION] = trace[ends - 1, :, :MOTION].swapaxes(0, 1)
        out[part, :, MOTION:POWER] = ((velocity[ends] - velocity[ends - 1]) / plant.interval).swapaxes(0, 1)
    edges = np.cumsum([len(s.starts) for s in spans])[:-1]
    return np.split(out, edges)


def compare(flight: Recording, starts: np.ndarray, horizons: tuple[int, ...], predicted: np.ndarray) -> Errors:
    """Return predicted minus measured values."""
    at = starts[:, None] + np.array(horizons)
    attitude = product(conjugate(flight.attitude[at]), predicted[..., 3:7])
    middle = specific_force(predicted[..., 3:7], predicted[..., 13:16])
    force = 0.5 * (flight.specific_force[at] + flight.specific_force[at - 1])
    return Errors(
        predicted[..., :3] - flight.position[at],
        predicted[..., 7:10] - flight.velocity[at],
        rotation_vector(attitude),
        predicted[..., 10:13] - flight.omega[at],
        middle - force,
        predicted[..., POWER:WIDTH] - _power(flight)[at][..., None],
    )


def _power(flight: Recording) -> np.ndarray:
    return flight.power if len(flight.power) == len(flight) else np.full(len(flight), np.nan)
