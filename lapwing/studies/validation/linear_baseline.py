"""Best linear prediction: a regression from the start state and the commands of the window to the change of state.

It uses no physical model. Where it predicts better than the plant, the model misses an effect that is in the data. Each
flight is predicted by coefficients fitted to the other flights, and a part of a single flight by those of the rest.
"""

from itertools import pairwise

import numpy as np

from lapwing.flights.log_import.recording import Recording
from lapwing.flights.rotation_arrays import conjugate, from_vector, product, rotate, rotation_vector
from lapwing.studies.validation.windows import POWER, WIDTH, Errors, compare

SLICE = 5  # samples of commands averaged by one regressor
RIDGE = 1e-3  # ridge parameter over the number of windows, for standardised regressors
PARTS = 5  # of a single flight
SMALLEST = 1e-6  # [SI] standard deviation of a regressor below which it counts as constant
UP = np.array([0.0, 0.0, 1.0])


def linear_fit(flights: list[Recording], starts: list[np.ndarray], horizons: tuple[int, ...]) -> list[Errors]:
    """Return the errors of the linear prediction of each flight by a fit to the others."""
    if len(flights) == 1 and len(starts[0]) > 1:
        parts = np.array_split(starts[0], min(PARTS, len(starts[0])))
        errors = linear_fit(flights * len(parts), parts, horizons)
        return [Errors(*map(np.concatenate, zip(*errors, strict=True)))]
    regressors = [_regressors(f, s, horizons[-1]) for f, s in zip(flights, starts, strict=True)]
    targets = [_targets(f, s, horizons) for f, s in zip(flights, starts, strict=True)]
    spread = np.concatenate(regressors).std(axis=0)
    scale = np.where(spread > SMALLEST, spread, 1.0)
    regressors = [r / scale for r in regressors]
    moments = np.array([r.T @ r for r in regressors])
    products = [r.T @ t for r, t in zip(regressors, targets, strict=True)]
    whole, whole_product, count = moments.sum(axis=0), sum(products), sum(map(len, starts))
    out = []
    for k, (flight, s) in enumerate(zip(flights, starts, strict=True)):
        moment = whole - moments[k] + RIDGE * count * np.eye(len(whole))
        gain = np.linalg.solve(moment, whole_product - products[k])
        change = (regressors[k] @ gain).reshape(len(s), len(horizons), 12)
        out.append(compare(flight, s, horizons, _predict(flight, s, horizons, change)))
    return out


def _regressors(flight: Recording, starts: np.ndarray, longest: int) -> np.ndarray:
    back = conjugate(flight.attitude[starts])
    state = [flight.omega[starts], rotate(back, flight.velocity[starts]), rotate(back, np.tile(UP, (len(starts), 1)))]
    thrust = np.concatenate([np.zeros((1, flight.rotors)), np.cumsum(flight.motor_voltage**2, axis=0)])
    edges = np.arange(-2 * SLICE, longest + 1, SLICE)
    commands = [(thrust[starts + b] - thrust[starts + a]) / SLICE for a, b in pairwise(edges)]
    return np.column_stack([*state, *commands, np.ones(len(starts))])


def _targets(flight: Recording, starts: np.ndarray, horizons: tuple[int, ...]) -> np.ndarray:
    """Return changes in initial body axes: position beyond constant velocity, velocity, attitude, rate."""
    out = []
    start = flight.attitude[starts]
    for h in horizons:
        drift = flight.position[starts + h] - flight.position[starts] - h * flight.interval * flight.velocity[starts]
        out += [
            rotate(conjugate(start), drift),
            rotate(conjugate(start), flight.velocity[starts + h] - flight.velocity[starts]),
            rotation_vector(product(conjugate(start), flight.attitude[starts + h])),
            flight.omega[starts + h],
        ]
    return np.column_stack(out)


def _predict(flight: Recording, starts: np.ndarray, horizons: tuple[int, ...], change: np.ndarray) -> np.ndarray:
    predicted = np.zeros((*change.shape[:2], WIDTH))
    predicted[..., POWER] = np.nan
    start, velocity = flight.attitude[starts][:, None], flight.velocity[starts][:, None]
    time = (np.array(horizons) * flight.interval)[:, None]
    turn = np.broadcast_to(start, (*change.shape[:2], 4))
    predicted[..., :3] = flight.position[starts][:, None] + velocity * time + rotate(turn, change[..., :3])
    predicted[..., 7:10] = velocity + rotate(turn, change[..., 3:6])
    predicted[..., 3:7] = product(turn, from_vector(change[..., 6:9]))
    predicted[..., 10:13] = change[..., 9:12]
    return predicted
