"""Start states of prediction windows: rotor speeds from past commands, trim from past residuals."""

from typing import NamedTuple

import numpy as np
from scipy.signal import lfilter

from lapwing.studies.flight_import.recording import Recording
from lapwing.studies.flight_import.rotation_arrays import conjugate, rotate
from lapwing.studies.validation.plant_rows import MOTION, PlantRows

PIECE = 400  # samples of a piece of a flight; pieces are stepped side by side
WARM_UP = 100  # samples before a piece in which the rotor speeds settle
GROUNDED = 0.1  # [m] height below which a sample is lifted, so that contact is not computed for nothing
LIFT = 10.0  # [m]
CHUNK = 50  # samples stepped at once


class TrimMemory(NamedTuple):
    """Memory length of the trim."""

    force: float = 0.15  # [s] time constant of the mean of past residual forces; 0: no trim
    torque: float = 10.0  # [s] the same of residual torques


NO_TRIM = TrimMemory(0.0, 0.0)
USUAL_TRIM = TrimMemory()


class StartStates(NamedTuple):
    """Initial data of a window besides the measured motion, for every sample of a flight and every parameter set."""

    rotor_speed: np.ndarray  # [rad/s], shape (sets, n, rotors)
    force: np.ndarray  # [N] body, trim by the samples up to this one, shape (sets, n, 3)
    torque: np.ndarray  # [N m] body, the same
    residual: np.ndarray  # [m/s^2] and [rad/s^2] body, measured less predicted over the next tick, shape (sets, n, 6)


def start_states(plant: PlantRows, flights: list[Recording], memory: TrimMemory) -> list[StartStates]:
    """Step the plant along each flight, its motion reset to the measured one at every sample.

    A residual belongs to the tick after its sample and needs the sample after that. So the trim at a sample uses the
    residuals of earlier ticks only, and nothing measured later.

    Args:
        plant: with its parameter sets.
        flights: sampled at the plant's tick.
        memory: of the trim.
    """
    pieces = [(f, s) for f, flight in enumerate(flights) for s in range(0, len(flight), PIECE)]
    sets, lanes = len(plant.rows), len(pieces)
    motion = [np.column_stack([r.position, r.attitude, r.velocity, r.omega]) for r in flights]
    motion = [_without_gaps(m, r.valid) for m, r in zip(motion, flights, strict=True)]
    for m in motion:
        m[m[:, 2] < GROUNDED, 2] += LIFT
    first = np.array([s for _, s in pieces])
    owner = np.array([f for f, _ in pieces])
    length = np.array([len(r) for r in flights])[owner]
    padded = np.concatenate(motion), np.concatenate([r.motor_voltage for r in flights])
    offset = np.concatenate([[0], np.cumsum([len(r) for r in flights])])[owner]
    blocks = plant.start(np.repeat(np.arange(sets), lanes))
    speed = np.zeros((sets, sum(map(len, flights)), plant.rotors))
    after = np.zeros((sets, speed.shape[1], 6))
    begin = np.maximum(first - WARM_UP, 0)
    rotors = np.tile(padded[1][offset + begin] * plant.speed_per_volt, (sets, 1))
    plant.write(blocks, slice(MOTION, MOTION + plant.rotors), rotors)
    longest = min(PIECE, int(length.max()))
    for low in range(-WARM_UP, longest, CHUNK):
        place = first + np.arange(low, min(low + CHUNK, longest))[:, None]
        at = offset + np.clip(place, 0, length - 1)
        every = np.tile(at, (1, sets))
        trace = plant.advance_along(blocks, padded[1][every], padded[0][every])
        before = np.concatenate([rotors[None], trace[:-1, :, MOTION:]])
        rotors = trace[-1, :, MOTION:]
        tick, lane = np.nonzero((place >= first) & (place < length))
        row = at[tick, lane]
        for k in range(sets):
            speed[k, row] = before[tick, k * lanes + lane]
            after[k, row] = trace[tick, k * lanes + lane, 7:MOTION]
    out, start = [], 0
    for flight, moved in zip(flights, motion, strict=True):
        span = slice(start, start := start + len(flight))
        out.append(_trim(plant, flight, moved, speed[:, span], after[:, span], memory))
    return out


def _without_gaps(values: np.ndarray, valid: np.ndarray) -> np.ndarray:
    """Return the values with invalid rows replaced by the last valid one, or the first."""
    index = np.maximum.accumulate(np.where(valid, np.arange(len(valid)), -1))
    if (index < 0).all():
        return np.nan_to_num(values)
    return values[np.where(index < 0, np.flatnonzero(valid)[0], index)]


def _trim(
    plant: PlantRows, flight: Recording, motion: np.ndarray, speed: np.ndarray, after: np.ndarray, memory: TrimMemory
) -> StartStates:
    interval, n = plant.interval, len(flight)
    residual = np.zeros((len(after), n, 6))
    change = (motion[1:, 7:] - after[:, :-1]) / interval
    residual[:, :-1, :3] = rotate(np.broadcast_to(conjugate(motion[:-1, 3:7]), (*change.shape[:2], 4)), change[..., :3])
    residual[:, :-1, 3:] = change[..., 3:]
    sound = np.r_[flight.valid[:-1] & flight.valid[1:], False]
    weight = np.r_[0.0, sound[:-1]]
    past = np.concatenate([np.zeros((len(after), 1, 6)), residual[:, :-1]], axis=1) * weight[:, None]
    trim = np.empty_like(past)
    for part, constant in ((slice(0, 3), memory.force), (slice(3, 6), memory.torque)):
        if constant <= 0.0:
            trim[..., part] = 0.0
            continue
        keep = np.exp(-interval / constant)
        total = lfilter([1.0], [1.0, -keep], past[..., part], axis=1)
        count = lfilter([1.0], [1.0, -keep], weight)
        trim[..., part] = total / np.maximum(count, 1.0)[:, None]
    force = trim[..., :3] * plant.mass[:, None, None]
    torque = np.einsum("sij,snj->sni", plant.inertia, trim[..., 3:])
    return StartStates(speed, force, torque, residual)
