"""Output-error estimation of plant parameters over multi-step windows.

The plant predicts each window from its measured start under the measured commands; the parameters minimise a robust
sum of squared prediction errors. Only the commands inside a window enter the prediction, not the measured response, so
the feedback of the autopilot does not bias the estimate, unlike that of equation-error regression (Jategaonkar,
Flight Vehicle System Identification, 2015, sections 4 and 9).
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.ndimage import correlate1d
from scipy.optimize import least_squares

from lapwing.flights.log_import.recording import Recording
from lapwing.flights.rotation_arrays import continuous, unit
from lapwing.studies.identification.flight_parameters import apply_flight_parameters, is_flight_parameter
from lapwing.studies.identification.instrumental_variables import LOSS_SCALE, Moments, loss, moments
from lapwing.studies.validation.plant_rows import PlantRows
from lapwing.studies.validation.start_states import NO_TRIM, TrimMemory, start_states
from lapwing.studies.validation.windows import Errors, Span, compare, predict_all, window_starts

STEP = 1e-4  # step of a scaled parameter for derivatives
RANGE = 50.0  # largest ratio, and inverse of the smallest, of a positive parameter to its initial value
HORIZONS = (10, 25, 50)  # samples
CLUSTER = 1.0  # [s] of flight that counts as one independent observation for standard errors
TOLERANCE = 1e-8  # of the relative change of loss and parameters; 1e-5 stops a standard error short of the minimum
LARGEST = 1e3  # residual, in units of its scale
FIELDS = ("position", "velocity", "attitude", "rate")
START = tuple(range(-4, 5))  # samples whose parabola gives the start of a window
INSTRUMENT = (*range(-9, -4), *range(5, 10))  # samples of another start, with independent noise


class Window(NamedTuple):
    """Windows of one flight."""

    flight: int
    starts: np.ndarray


class Fit(NamedTuple):
    """Estimated parameters."""

    keys: tuple[str, ...]
    start: np.ndarray  # initial values
    values: np.ndarray
    standard_errors: np.ndarray  # with clusters over time spans of flights, not samples
    correlations: np.ndarray  # shape (k, k)
    cost: float  # robust mean of squared scaled residuals
    evaluations: int
    undetermined: tuple[str, ...]  # keys that the flights do not determine


class OutputError:
    """Estimation problem: residuals of all windows as a function of the parameters."""

    def __init__(
        self,
        plant: PlantRows,
        flights: Sequence[Recording],
        keys: Sequence[str],
        start: Sequence[float],
        windows: int = 1500,
        memory: TrimMemory = NO_TRIM,
        horizons: tuple[int, ...] = HORIZONS,
        fields: tuple[str, ...] = FIELDS,
    ):
        """Select windows with minimum overlap.

        Args:
            plant: plant of the scene, at the interval of the recordings.
            flights: training flights.
            keys: free parameters: keys of the scene, or of `flight_parameters`.
            start: initial values.
            windows: approximate number of windows.
            memory: memory of the trim.
            horizons: samples after which errors count.
            fields: fields of `Errors` that count.
        """
        self.fields = fields
        self.plant, self.flights, self.keys = plant, list(flights), tuple(keys)
        self.start, self.memory, self.horizons = np.array(start, float), memory, horizons
        self.scale = np.where(self.start != 0.0, np.abs(self.start), 1e-2)
        available = [window_starts(f, horizons[-1], 1) for f in self.flights]
        total = sum(map(len, available))
        if total == 0:
            raise ValueError("no flight has a valid window in the air; use flights that leave the ground")
        stride = max(1, total // windows)
        self.windows = [Window(k, a[stride // 2 :: stride]) for k, a in enumerate(available) if len(a)]
        self.weights = np.ones((len(horizons), len(fields)))
        self.weights = 1.0 / self._scales()
        self.evaluations = 0
        self._count = sum(len(w.starts) for w in self.windows) * len(horizons) * len(fields) * 3

    def _scales(self) -> np.ndarray:
        """Return the spread of the errors at the initial values by horizon and field, the scales of the residuals."""
        residual = self._errors([self.start])[0]
        with np.errstate(invalid="ignore"):
            return np.maximum(np.nanmedian(np.abs(residual), axis=(0, 3)) * 1.4826, 1e-9)

    def residuals(self, sets: Sequence[np.ndarray], samples: tuple[int, ...] = START) -> list[np.ndarray]:
        """Return scaled residuals of each parameter set, shape (windows, h, fields, 3)."""
        return [errors * self.weights[None, :, :, None] for errors in self._errors(sets, samples)]

    def derivatives(self, x: np.ndarray, samples: tuple[int, ...] = START) -> tuple[np.ndarray, np.ndarray]:
        """Return the residuals at scaled parameters x, shape (m,), and their derivatives, shape (m, k)."""
        steps = STEP * np.maximum(np.abs(x), 1e-2)
        sets = [x * self.scale, *((x + steps * row) * self.scale for row in np.eye(len(x)))]
        base, *result = (_flat(r) for r in self.residuals(sets, samples))
        return base, np.column_stack([(f - base) / step for f, step in zip(result, steps, strict=True)])

    def _errors(self, sets: Sequence[np.ndarray], samples: tuple[int, ...] = START) -> list[np.ndarray]:
        own = [k for k, key in enumerate(self.keys) if not is_flight_parameter(key)]
        groups: dict[tuple, list[int]] = {}
        for i, values in enumerate(sets):
            rest = tuple((self.keys[k], float(values[k])) for k in range(len(self.keys)) if k not in own)
            groups.setdefault(rest, []).append(i)
        out: list[np.ndarray | None] = [None] * len(sets)
        for rest, members in groups.items():
            flights = [apply_flight_parameters(f, dict(rest)) for f in self.flights]
            self.plant.set_parameters([{self.keys[k]: float(sets[i][k]) for k in own} for i in members])
            states = start_states(self.plant, flights, self.memory)
            spans = [Span(w.flight, w.starts, j) for j in range(len(members)) for w in self.windows]
            result = predict_all(self.plant, [smooth_motion(f, samples) for f in flights], spans, states, self.horizons)
            parts = [
                _stack(compare(flights[s.flight], s.starts, self.horizons, f), self.fields)
                for s, f in zip(spans, result, strict=True)
            ]
            for j, i in enumerate(members):
                out[i] = np.concatenate(parts[j * len(self.windows) : (j + 1) * len(self.windows)])
        return [values for values in out if values is not None]

    def clusters(self) -> np.ndarray:
        """Return the index of each window's cluster, which is a flight and a time span."""
        span = round(CLUSTER / self.plant.interval)
        names = np.concatenate([flight * 1_000_000 + starts // span for flight, starts in self.windows])
        return np.unique(names, return_inverse=True)[1]

    def solve(
        self,
        begin: np.ndarray | None = None,
        most: int = 20,
        report: Callable[[int, np.ndarray, float], None] | None = None,
    ) -> Fit:
        """Minimise the robust loss.

        Args:
            begin: initial values; None: those of the problem.
            most: maximum number of evaluations of the derivatives.
            report: called after each step with its number, the values, and the cost.
        """
        bounds = np.array([(s / RANGE, s * RANGE) if s > 0.0 else (-np.inf, np.inf) for s in self.start]).T

        def residual(x: np.ndarray) -> np.ndarray:
            self.evaluations += 1
            try:
                return _flat(self.residuals([x * self.scale])[0])
            except ValueError:  # values that the scene rejects: the solver shortens the step
                return np.full(self._count, LARGEST)

        def jacobian(x: np.ndarray) -> np.ndarray:
            base, derivatives = self.derivatives(x)
            if report:
                report(len(calls), x * self.scale, float(np.mean(loss(base))))
            calls.append(1)
            return derivatives

        calls: list[int] = []
        begin = self.start if begin is None else begin
        inner = np.clip(begin / self.scale, bounds[0] / self.scale * (1 + 1e-9), bounds[1] / self.scale * (1 - 1e-9))
        solution = least_squares(
            residual, inner, jac=jacobian, bounds=(bounds[0] / self.scale, bounds[1] / self.scale),
            loss="soft_l1", f_scale=LOSS_SCALE, x_scale="jac", max_nfev=most, ftol=TOLERANCE, xtol=TOLERANCE,
        )  # fmt: skip
        return self._fit(solution.x, bounds / self.scale)

    def _moments(self, x: np.ndarray) -> tuple[np.ndarray, Moments]:
        """Return the residuals at x, and the moment equations with instruments."""
        residual, derivatives = self.derivatives(x)
        return residual, moments(residual, derivatives, self.derivatives(x, INSTRUMENT)[1], self.clusters())

    def _fit(self, x: np.ndarray, bounds: np.ndarray) -> Fit:
        """Return the fit at the minimum x, corrected for the noise of the starts, with standard errors."""
        x = np.clip(x + self._moments(x)[1].step, *bounds)
        residual, (_, deviation, correlation) = self._moments(x)
        vague = deviation > 0.5 * np.maximum(np.abs(x), 1e-2)
        mixed = np.abs(correlation - np.eye(len(x))).max(axis=1, initial=0.0) > 0.98
        return Fit(
            self.keys, self.start, x * self.scale, deviation * self.scale, correlation, float(np.mean(loss(residual))),
            self.evaluations, tuple(k for k, a, b in zip(self.keys, vague, mixed, strict=True) if a or b),
        )  # fmt: skip


def smooth_motion(flight: Recording, samples: tuple[int, ...] = START) -> Recording:
    """Return a flight whose motion is the middle of parabolas through neighbouring samples, without delay.

    Args:
        flight: recording.
        samples: offsets of the neighbours, symmetric.
    """
    reach = max(samples)
    if len(flight) <= 2 * reach:
        return flight
    weights = np.zeros(2 * reach + 1)
    weights[np.array(samples) + reach] = np.linalg.pinv(np.vander(samples, 3))[-1]

    def smooth(values: np.ndarray) -> np.ndarray:
        return correlate1d(values, weights, axis=0, mode="nearest")

    return replace(
        flight,
        position=smooth(flight.position), attitude=unit(smooth(continuous(flight.attitude))),
        velocity=smooth(flight.velocity), omega=smooth(flight.omega),
    )  # fmt: skip


def _stack(e: Errors, fields: tuple[str, ...]) -> np.ndarray:
    """Return the errors of some fields, shape (n, h, fields, 3)."""
    return np.stack([getattr(e, name) for name in fields], axis=2)


def _flat(residual: np.ndarray) -> np.ndarray:
    return np.clip(np.nan_to_num(residual, nan=LARGEST, posinf=LARGEST, neginf=-LARGEST), -LARGEST, LARGEST).ravel()
