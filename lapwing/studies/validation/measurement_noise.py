"""White noise of the measured motion, and the prediction errors that it alone causes.

A window starts in a measured state and ends at a measured one, and the trim follows from measurements. So even the true
model has errors. They are those that the same noise, added once more, adds to a prediction.
"""

from dataclasses import replace

import numpy as np

from lapwing.flights.log_import.recording import Recording
from lapwing.flights.rotation_arrays import conjugate, from_vector, product, rotation_vector

ORDER, GAIN = 4, 70.0**0.5  # difference in which smooth motion vanishes, and its gain for white noise
NORMAL = 1.4826  # standard deviation over median of the absolute values


def noisier(flight: Recording, seed: int = 1) -> Recording:
    """Return the flight with noise of its own size added to motion and specific force, independent at each sample."""
    draw = np.random.default_rng(seed)
    vectors = {name: getattr(flight, name) for name in ("position", "velocity", "omega", "specific_force")}
    noise = {name: _deviation(v, flight.valid, ORDER) * draw.standard_normal(v.shape) for name, v in vectors.items()}
    turn = np.zeros((len(flight), 3))
    turn[1:] = rotation_vector(product(conjugate(flight.attitude[:-1]), flight.attitude[1:]))
    tilt = _deviation(turn, flight.valid, ORDER - 1) * draw.standard_normal(turn.shape)
    attitude = product(flight.attitude, from_vector(tilt))
    return replace(flight, attitude=attitude, **{name: v + noise[name] for name, v in vectors.items()})


def _deviation(values: np.ndarray, valid: np.ndarray, order: int) -> np.ndarray:
    """Return the standard deviation of the white noise of each column, shape (k,); 0 for too few valid samples."""
    whole = np.convolve(valid, np.ones(ORDER + 1), "valid") > ORDER + 0.5
    differences = np.diff(values, n=order, axis=0)[ORDER - order :]
    known = differences[whole & np.isfinite(differences).all(axis=1)]
    return NORMAL * np.median(np.abs(known), axis=0) / GAIN if len(known) else np.zeros(values.shape[1])
