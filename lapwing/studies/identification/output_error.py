"""Output-error estimation of plant parameters over multi-step windows.

The plant predicts each window from its measured start under the measured commands; the parameters minimise a robust
sum of squared prediction errors. Only the commands inside a window enter the prediction, not the measured response, so
the feedback of the autopilot does not bias the estimate, unlike that of equation-error regression (Jategaonkar,
Flight Vehicle System Identification, 2015, sections 4 and 9).
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import least_squares
from scipy.signal import savgol_filter

from lapwing.studies.flight_import.recording import Recording
from lapwing.studies.flight_import.rotation_arrays import continuous, unit
from lapwing.studies.identification.flight_parameters import apply_flight_parameters, is_flight_parameter
from lapwing.studies.validation.plant_rows import PlantRows
from lapwing.studies.validation.start_states import NO_TRIM, TrimMemory, start_states
from lapwing.studies.validation.windows import Errors, Span, compare, predict_all, window_starts

STEP = 1e-4  # step of a scaled parameter for derivatives
RANGE = 50.0  # largest ratio, and inverse of the smallest, of a positive parameter to its initial value
HORIZONS = (10, 25, 50)  # samples
LOSS_SCALE = 0.5  # residual, in units of its scale, where the robust loss turns from square to linear
CLUSTER = 1.0  # [s] of flight that counts as one independent observation for standard errors
NO_INFLUENCE = 1e-12  # information relative to the largest, below which a parameter has no influence
TOLERANCE = 1e-8  # relative change of loss and parameters; with 1e-5 the result is a standard error from the minimum
LARGEST = 1e3  # limit of a residual, in units of its scale
FIELDS = ("position", "velocity", "attitude", "rate")
SMOOTHING = 9  # samples of the local parabola whose centre is the start of a window


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
        """
        self.plant, self.flights, self.keys = plant, list(flights), tuple(keys)
        self.start, self.memory, self.horizons = np.array(start, float), memory, horizons
        self.scale = np.where(self.start != 0.0, np.abs(self.start), 1e-2)
        available = [window_starts(f, horizons[-1], 1) for f in self.flights]
        total = sum(map(len, available))
        if total == 0:
            raise ValueError("no flight has a valid window in the air; use flights that leave the ground")
        stride = max(1, total // windows)
        self.windows = [Window(k, a[stride // 2 :: stride]) for k, a in enumerate(available) if len(a)]
        self.weights = np.ones((len(horizons), len(FIELDS)))
        self.weights = 1.0 / self._scales()
        self.evaluations = 0
        self._count = sum(len(w.starts) for w in self.windows) * len(horizons) * len(FIELDS) * 3

    def _scales(self) -> np.ndarray:
        """Return the spread of the errors at the initial values by horizon and field, the scales of the residuals."""
        residual = self._errors([self.start])[0]
        with np.errstate(invalid="ignore"):
            return np.maximum(np.nanmedian(np.abs(residual), axis=(0, 3)) * 1.4826, 1e-9)

    def residuals(self, sets: Sequence[np.ndarray]) -> list[np.ndarray]:
        """Return scaled residuals of each parameter set, shape (windows, h, 4, 3)."""
        return [errors * self.weights[None, :, :, None] for errors in self._errors(sets)]

    def _errors(self, sets: Sequence[np.ndarray]) -> list[np.ndarray]:
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
            result = predict_all(self.plant, [smooth_motion(f) for f in flights], spans, states, self.horizons)
            parts = [
                _stack(compare(flights[s.flight], s.starts, self.horizons, f))
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
            steps = STEP * np.maximum(np.abs(x), 1e-2)
            sets = [x * self.scale, *((x + steps * row) * self.scale for row in np.eye(len(x)))]
            base, *result = (_flat(r) for r in self.residuals(sets))
            if report:
                report(len(calls), x * self.scale, float(np.mean(_loss(base))))
            calls.append(1)
            return np.column_stack([(f - base) / step for f, step in zip(result, steps, strict=True)])

        calls: list[int] = []
        begin = self.start if begin is None else begin
        inner = np.clip(begin / self.scale, bounds[0] / self.scale * (1 + 1e-9), bounds[1] / self.scale * (1 - 1e-9))
        solution = least_squares(
            residual, inner, jac=jacobian, bounds=(bounds[0] / self.scale, bounds[1] / self.scale),
            loss="soft_l1", f_scale=LOSS_SCALE, x_scale="jac", max_nfev=most, ftol=TOLERANCE, xtol=TOLERANCE,
        )  # fmt: skip
        return self._fit(solution.x, jacobian(solution.x))

    def _fit(self, x: np.ndarray, jacobian: np.ndarray) -> Fit:
        """Return the fit with standard errors by the sandwich estimator over clusters of windows."""
        residual = _flat(self.residuals([x * self.scale])[0])
        square = 1.0 + (residual / LOSS_SCALE) ** 2
        information = jacobian.T @ (jacobian * (square**-1.5)[:, None])  # second derivative of the loss
        score = (jacobian * (residual * square**-0.5)[:, None]).reshape(len(self.clusters()), -1, len(x)).sum(axis=1)
        names = self.clusters()
        count = int(names.max()) + 1
        total = np.zeros((count, len(x)))
        np.add.at(total, names, score)
        total -= total.mean(axis=0)
        size = np.diag(information)
        no_influence = size <= NO_INFLUENCE * size.max(initial=0.0)
        scale = np.sqrt(np.where(no_influence, 1.0, size))
        normal = information / np.outer(scale, scale)
        values, vectors = np.linalg.eigh(normal)
        inverse = (vectors / np.maximum(values, 1e-12)) @ vectors.T / np.outer(scale, scale)
        middle = total.T @ total * count / max(count - len(x), 1)
        covariance = inverse @ middle @ inverse
        deviation = np.where(no_influence, np.inf, np.sqrt(np.maximum(np.diag(covariance), 0.0)))
        spread = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
        correlation = np.where(
            no_influence | no_influence[:, None], np.eye(len(x)), covariance / np.outer(spread, spread)
        )
        vague = deviation > 0.5 * np.maximum(np.abs(x), 1e-2)
        mixed = np.abs(correlation - np.eye(len(x))).max(axis=1, initial=0.0) > 0.98
        return Fit(
            self.keys, self.start, x * self.scale, deviation * self.scale, correlation, float(np.mean(_loss(residual))),
            self.evaluations, tuple(k for k, a, b in zip(self.keys, vague, mixed, strict=True) if a or b),
        )  # fmt: skip


def smooth_motion(flight: Recording) -> Recording:
    """Return a flight with motion smoothed over neighbouring samples, without delay.

    The noise of a start state affects both the prediction and its derivatives, which biases time constants and inertia.
    """

    def smooth(values: np.ndarray) -> np.ndarray:
        return savgol_filter(values, SMOOTHING, 2, axis=0) if len(values) >= SMOOTHING else values

    return replace(
        flight,
        position=smooth(flight.position), attitude=unit(smooth(continuous(flight.attitude))),
        velocity=smooth(flight.velocity), omega=smooth(flight.omega),
    )  # fmt: skip


def _stack(e: Errors) -> np.ndarray:
    """Return the errors of all fields, shape (n, h, 4, 3)."""
    return np.stack([getattr(e, name) for name in FIELDS], axis=2)


def _flat(residual: np.ndarray) -> np.ndarray:
    return np.clip(np.nan_to_num(residual, nan=LARGEST, posinf=LARGEST, neginf=-LARGEST), -LARGEST, LARGEST).ravel()


def _loss(residual: np.ndarray) -> Any:
    return 2.0 * LOSS_SCALE**2 * (np.sqrt(1.0 + (residual / LOSS_SCALE) ** 2) - 1.0)
