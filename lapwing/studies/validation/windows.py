"""Prediction windows: where they begin, and what the plant predicts over them."""

from typing import NamedTuple

import numpy as np

from lapwing.studies.flight_import.recording import Recording
from lapwing.studies.flight_import.rotation_arrays import conjugate, product, rotate, rotation_vector
from lapwing.studies.validation.plant_rows import PlantRows
from lapwing.studies.validation.start_states import MOTION, StartStates

LOWEST = 0.3  # [m] above the ground, below which a window is left out
PAST = 20  # samples before a window that must be valid, for the rotor speeds and the trim
BATCH = 16_384  # windows stepped at once


class Errors(NamedTuple):
    """Predicted less measured at each horizon; h horizons."""

    position: np.ndarray  # [m] world, shape (n, h, 3)
    velocity: np.ndarray  # [m/s] world, shape (n, h, 3)
    attitude: np.ndarray  # [rad] rotation vector from the measured to the predicted body, shape (n, h, 3)
    rate: np.ndarray  # [rad/s] body, shape (n, h, 3)
    specific_force: np.ndarray  # [m/s^2] body, mean over the last tick, shape (n, h, 3); NaN where not measured


def window_starts(flight: Recording, longest: int, stride: int, lowest: float = LOWEST) -> np.ndarray:
    """Return the samples at which a window can begin: valid and in the air from the past to its end."""
    height = flight.position[:, 2]
    sound = flight.valid & (height > lowest) & (flight.motor_voltage.max(axis=1) > 0.0)
    count = np.concatenate([[0], np.cumsum(~sound)])
    starts = np.arange(PAST, len(flight) - longest, stride)
    return starts[count[starts + longest + 1] == count[starts - PAST]]


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
        Position, attitude, velocity and omega at each horizon, and the acceleration of the last tick [m/s^2] world;
        shape (n, h, 16).
    """
    out = np.empty((len(starts), len(horizons), MOTION + 3))
    measured = np.column_stack([flight.position, flight.attitude, flight.velocity, flight.omega])
    for low in range(0, len(starts), BATCH):
        s = starts[low : low + BATCH]
        blocks = plant.start(np.full(len(s), parameter_set))
        plant.write(blocks, slice(0, MOTION), measured[s])
        plant.write(blocks, slice(MOTION, MOTION + plant.rotors), states.rotor_speed[parameter_set, s])
        plant.add_wrench(blocks, states.force[parameter_set, s], states.torque[parameter_set, s])
        row = 0
        for k in range(horizons[-1]):
            last = k + 1 == horizons[row]
            before = plant.read(blocks, slice(7, 10), len(s)).copy() if last else None
            plant.advance(blocks, flight.motor_voltage[s + k])
            if last:
                now = plant.read(blocks, slice(0, MOTION), len(s))
                out[low : low + len(s), row, :MOTION] = now
                out[low : low + len(s), row, MOTION:] = (now[:, 7:10] - before) / plant.interval
                row += 1
    return out


def compare(flight: Recording, starts: np.ndarray, horizons: tuple[int, ...], predicted: np.ndarray) -> Errors:
    """Return predicted less measured."""
    at = starts[:, None] + np.array(horizons)
    attitude = product(conjugate(flight.attitude[at]), predicted[..., 3:7])
    upward = np.array([0.0, 0.0, 9.80665])
    middle = _in_body(predicted[..., 3:7], predicted[..., 13:16] + upward)
    force = 0.5 * (flight.specific_force[at] + flight.specific_force[at - 1])
    return Errors(
        predicted[..., :3] - flight.position[at],
        predicted[..., 7:10] - flight.velocity[at],
        rotation_vector(attitude),
        predicted[..., 10:13] - flight.omega[at],
        middle - force,
    )


def _in_body(attitude: np.ndarray, vector: np.ndarray) -> np.ndarray:
    """Return world vectors in body coordinates."""

    return rotate(conjugate(attitude), vector)
