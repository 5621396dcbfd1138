"""Start states of prediction windows: rotor speeds from past commands, trim from past residuals.

Of flights without position, velocity or attitude, gyroscope, accelerometer and motor commands determine the rest. Rate
and specific force in body axes depend on the motor commands and the rate, hardly on the rest of the motion. So the
windows start with made-up values of the missing quantities, at rest, and only measured signals are compared.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from scipy.signal import lfilter

from lapwing.flights.log_import.recording import Recording
from lapwing.flights.rotation_arrays import conjugate, from_vector, product, rotate
from lapwing.studies.validation.plant_rows import MOTION, PlantRows

PIECE = 400  # samples per piece of a flight; pieces are stepped in parallel
WARM_UP = 100  # samples before a piece during which the rotor speeds settle
GROUNDED = 0.1  # [m] height below which a sample is raised, to avoid the cost of ground contact
LIFT = 10.0  # [m] height by which such a sample is raised
CHUNK = 50  # samples per call of the batch executor


class TrimMemory(NamedTuple):
    """Time constants of the trim."""

    force: float = 0.15  # [s] time constant of the mean of past residual forces; 0: no trim
    torque: float = 10.0  # [s] time constant for residual torques


NO_TRIM = TrimMemory(0.0, 0.0)
USUAL_TRIM = TrimMemory()


class StartStates(NamedTuple):
    """Initial data of a window, except the measured motion, for all samples of a flight and all parameter sets."""

    rotor_speed: np.ndarray  # [rad/s], shape (sets, n, rotors)
    force: np.ndarray  # [N] body, trim from the samples up to this one, shape (sets, n, 3)
    torque: np.ndarray  # [N m] body, trim likewise, shape (sets, n, 3)
    residual: np.ndarray  # [m/s^2] and [rad/s^2] body, measured minus predicted over the next tick, shape (sets, n, 6)


def start_states(plant: PlantRows, flights: list[Recording], memory: TrimMemory) -> list[StartStates]:
    """Step the plant along each flight, with its motion reset to the measured one at each sample.

    A residual belongs to the tick after its sample and needs the next sample. So the trim at a sample only uses the
    residuals of earlier ticks, without later measurements.

    Args:
        plant: plant with its parameter sets.
        flights: recordings sampled at the plant's tick.
        memory: time constants of the trim.
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
        sample = first + np.arange(low, min(low + CHUNK, longest))[:, None]
        rows = offset + np.clip(sample, 0, length - 1)
        all_rows = np.tile(rows, (1, sets))
        trace = plant.advance_along(blocks, padded[1][all_rows], padded[0][all_rows])
        before = np.concatenate([rotors[None], trace[:-1, :, MOTION:]])
        rotors = trace[-1, :, MOTION:]
        tick, lane = np.nonzero((sample >= first) & (sample < length))
        row = rows[tick, lane]
        for k in range(sets):
            speed[k, row] = before[tick, k * lanes + lane]
            after[k, row] = trace[tick, k * lanes + lane, 7:MOTION]
    out, start = [], 0
    for flight, own_motion in zip(flights, motion, strict=True):
        span = slice(start, start := start + len(flight))
        out.append(_trim(plant, flight, own_motion, speed[:, span], after[:, span], memory))
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
    usable = np.r_[flight.valid[:-1] & flight.valid[1:], False]
    weight = np.r_[0.0, usable[:-1]]
    past = np.concatenate([np.zeros((len(after), 1, 6)), residual[:, :-1]], axis=1) * weight[:, None]
    trim = np.empty_like(past)
    for part, constant in ((slice(0, 3), memory.force), (slice(3, 6), memory.torque)):
        if constant <= 0.0:
            trim[..., part] = 0.0
            continue
        decay = np.exp(-interval / constant)
        total = lfilter([1.0], [1.0, -decay], past[..., part], axis=1)
        count = lfilter([1.0], [1.0, -decay], weight)
        trim[..., part] = total / np.maximum(count, 1.0)[:, None]
    force = trim[..., :3] * plant.mass[:, None, None]
    torque = np.einsum("sij,snj->sni", plant.inertia, trim[..., 3:])
    return StartStates(speed, force, torque, residual)


TORQUE_MEMORY = 0.3  # [s] of the trim, which then contains the moment of the drag at the unknown velocity
HEIGHT = 10.0  # [m] made up, clear of the ground
ALOFT = 0.5  # share of the median motor voltage below which the vehicle may stand on the ground
MASS, DRAG, TORQUE = (
    "mass: only thrust over mass follows from the accelerometer",
    "drag: the velocity is not measured",
    "inertia and torque constant: only the ratio to thrust over mass, and of both about z",
)


def unmeasured_motion(flights: Sequence[Recording]) -> tuple[str, ...]:
    """Return which of position, velocity and attitude cannot be compared.

    Empty if a flight has all of them: others are left out. Without an attitude, predictions in the world have no axes.
    """
    if any(not flight.missing for flight in flights):
        return ()
    missing = {name for flight in flights for name in flight.missing}
    return tuple(n for n in ("position", "velocity", "attitude") if n in missing or "attitude" in missing)


def with_made_up_motion(flight: Recording, unmeasured: Sequence[str]) -> Recording:
    """Return a flight in the air with made-up values of some quantities: at rest, and the attitude of the gyroscope."""
    if not unmeasured:
        return flight
    n = len(flight)
    made_up: dict[str, Any] = {"position": np.tile([0.0, 0.0, HEIGHT], (n, 1)), "velocity": np.zeros((n, 3))}
    if "attitude" in unmeasured:
        turn = from_vector(np.nan_to_num(flight.omega) * flight.interval)
        made_up["attitude"] = np.tile([1.0, 0.0, 0.0, 0.0], (n, 1))
        for k in range(1, n):
            made_up["attitude"][k] = product(made_up["attitude"][k - 1], turn[k - 1])
    mean = flight.motor_voltage.mean(axis=1)
    running = mean > ALOFT * np.median(mean[mean > 0.0]) if (mean > 0.0).any() else np.zeros(n, bool)
    return replace(flight, **{name: made_up[name] for name in unmeasured}, valid=flight.valid & running)


def trim_memory(memory: TrimMemory, unmeasured: Sequence[str]) -> TrimMemory:
    """Return the time constants of the trim: residual forces need a velocity."""
    return TrimMemory(0.0, min(memory.torque, TORQUE_MEMORY)) if "velocity" in unmeasured else memory


def unknown_parameters(flights: Sequence[Recording], unmeasured: Sequence[str]) -> tuple[str, ...]:
    """Return what such flights do not determine, a line each."""
    if not unmeasured:
        return ()
    has_force = any(np.isfinite(flight.specific_force).any() for flight in flights)
    mass = MASS if has_force or "velocity" not in unmeasured else "thrust over mass: there is no accelerometer"
    return (mass, *((DRAG,) if "velocity" in unmeasured else ()), TORQUE)
