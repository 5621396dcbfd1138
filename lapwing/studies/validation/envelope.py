"""Prediction errors over the flight envelope, residual spectra, and effects that would explain the residuals."""

from typing import NamedTuple

import numpy as np
from scipy.signal import welch

from lapwing.flights.rotation_arrays import conjugate, rotate
from lapwing.studies.validation.prediction_metrics import magnitudes
from lapwing.studies.validation.procedure import FlightErrors, Validation

BINS = 10
FEWEST = 30  # minimum number of windows in a bin
SEGMENT = 256  # samples per segment of a spectrum
CHANNELS = ("x", "y", "z")


class Trend(NamedTuple):
    """Mean errors at the last horizon by bins of one quantity."""

    label: str
    centres: np.ndarray  # shape (bins,)
    errors: np.ndarray  # shape (bins, fields)


class Explanation(NamedTuple):
    """Share of the residuals' variance that a regressor explains."""

    cause: str
    force: float  # [%]
    torque: float  # [%]


def trends(validation: Validation) -> list[Trend]:
    """Return the errors at the last horizon over speed, climb, height and battery voltage."""
    quantities = {
        "speed [m/s]": lambda f: np.linalg.norm(f.recording.velocity[f.starts], axis=1),
        "climb rate [m/s]": lambda f: f.recording.velocity[f.starts, 2],
        "height [m]": lambda f: f.recording.position[f.starts, 2],
        "battery voltage [V]": lambda f: f.recording.battery_voltage[f.starts],
    }
    errors = np.concatenate([magnitudes(f.plant)[:, -1] for f in validation.flights])
    out = []
    for label, quantity in quantities.items():
        values = np.concatenate([quantity(f) for f in validation.flights])
        if not np.isfinite(values).all() or np.ptp(values) == 0.0:
            continue
        low, high = np.quantile(values, [0.005, 0.995])
        edges = np.linspace(float(low), float(high), BINS + 1)
        index = np.digitize(values, edges) - 1
        bins = [k for k in range(BINS) if (index == k).sum() >= FEWEST]
        if bins:
            with np.errstate(invalid="ignore"):  # unmeasured quantities are NaN
                sums = [np.nansum(errors[index == k], axis=0) for k in bins]
                means = np.array(sums) / [np.isfinite(errors[index == k]).sum(axis=0) for k in bins]
            out.append(Trend(label, 0.5 * (edges[:-1] + edges[1:])[bins], means))
    return out


def residual_spectra(validation: Validation) -> tuple[np.ndarray, np.ndarray]:
    """Return frequencies [Hz] and the mean power spectra of residual accelerations, shape (n,) and (n, 6)."""
    total, count, frequency = 0.0, 0, np.empty(0)
    for flight in validation.flights:
        span = slice(int(flight.starts[0]), int(flight.starts[-1]) + 1)
        residual = flight.states.residual[0, span]
        if len(residual) < SEGMENT:
            continue
        frequency, power = welch(residual, 1.0 / validation.interval, nperseg=SEGMENT, axis=0)
        total, count = total + power * len(residual), count + len(residual)
    return (frequency, np.asarray(total) / count) if count else (frequency, np.empty((0, 6)))


def explanations(validation: Validation) -> list[Explanation]:
    """Return the share of the residual accelerations' variance that each single candidate explains, best first."""
    candidates = {
        "body velocity (drag, rotor drag)": lambda f, v: v,
        "velocity squared (fuselage drag)": lambda f, v: v * np.linalg.norm(v, axis=1, keepdims=True),
        "body rates (rotational damping)": lambda f, v: f.recording.omega[f.starts],
        "motor voltages (unequal motors)": lambda f, v: f.recording.motor_voltage[f.starts] ** 2,
        "change of motor voltages (motor lag)": _voltage_change,
        "battery voltage (resistance)": lambda f, v: f.recording.battery_voltage[f.starts, None],
        "height (ground effect)": lambda f, v: 1.0 / np.maximum(f.recording.position[f.starts, 2:3], 0.1) ** 2,
        "flight (payload, trim, motors)": lambda f, v: np.empty((len(v), 0)),
    }
    residual = np.concatenate([f.states.residual[0, f.starts] for f in validation.flights])
    residual = np.clip(residual, *np.quantile(residual, [0.01, 0.99], axis=0))
    owner = np.repeat(np.arange(len(validation.flights)), [len(f.starts) for f in validation.flights])
    out = []
    for cause, regressor in candidates.items():
        parts = []
        for flight in validation.flights:
            back = conjugate(flight.recording.attitude[flight.starts])
            parts.append(regressor(flight, rotate(back, flight.recording.velocity[flight.starts])))
        matrix = np.concatenate(parts)
        if not matrix.shape[1]:
            matrix = np.eye(len(validation.flights))[owner]
        if np.isfinite(matrix).all() and np.ptp(matrix, axis=0).any():  # made-up motion is constant
            out.append(Explanation(cause, _share(matrix, residual[:, :3]), _share(matrix, residual[:, 3:])))
    return sorted(out, key=lambda e: -(e.force + e.torque))


def _voltage_change(flight: FlightErrors, _: np.ndarray) -> np.ndarray:
    voltage = flight.recording.motor_voltage
    return voltage[flight.starts] - voltage[flight.starts - 5]


def _share(matrix: np.ndarray, target: np.ndarray) -> float:
    centred = target - target.mean(axis=0)
    matrix = matrix - matrix.mean(axis=0)
    gain = np.linalg.lstsq(matrix, centred, rcond=None)[0]
    unexplained = ((centred - matrix @ gain) ** 2).sum(axis=0) / np.maximum((centred**2).sum(axis=0), 1e-300)
    return float(100.0 * (1.0 - unexplained.mean()))
