"""Event-located reference of a landing: smooth pieces by SciPy's DOP853, transitions of each foot by root finding.

The cases of `reference_equations` change only at events. Steps integrate the change from an origin, which is a sum of
two doubles, so that the sums of thousands of steps do not round off.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.integrate import DOP853
from scipy.optimize import brentq

from lapwing.studies.accuracy.landings.reference_equations import (
    BEYOND,
    FLOOR,
    TOP,
    LandingBody,
    LandingGround,
    cases_at,
    margins,
    rate,
)

TOLERANCE = 1e-12  # of a step, relative to 1 + size
LEAST_RELATIVE = 2.3e-14  # relative tolerance of a change, which is small; DOP853 accepts no smaller one
LONGEST = 1e-3  # [s] limit of a step, so that no foot touches and leaves within one
GRAZING = 2e-3  # [m] from the ground or a wall, within which a step is searched for contacts


class _Origin(NamedTuple):
    """State from which a step starts, as the sum of two doubles."""

    value: np.ndarray
    rest: np.ndarray

    def plus(self, change: np.ndarray) -> np.ndarray:
        """Return the rounded state after a change."""
        return self.value + (self.rest + change)

    def moved(self, change: np.ndarray) -> "_Origin":
        """Return the origin after a change."""
        value, rest = _exact_sum(self.value, change)
        return _Origin(*_exact_sum(value, rest + self.rest))


def _exact_sum(a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return (rounded sum, its rounding error)."""
    total = a + b
    part = total - a
    return total, (a - (total - part)) + (b - part)


class _Piece:
    """Smooth piece between two events: steps of the change from an origin that moves along."""

    def __init__(
        self, body: LandingBody, ground: LandingGround, cases: np.ndarray, origin: _Origin, tolerance: float
    ) -> None:
        self.body, self.ground, self.cases, self.origin = body, ground, cases, origin
        self.tolerance = tolerance

    def solver(self, t: float, end: float, first_step: float | None) -> DOP853:
        """Return the solver of changes from the origin at time t [s]."""
        return DOP853(
            lambda _, change: rate(self.body, self.ground, self.cases, self.origin.plus(change)),
            t, np.zeros_like(self.origin.value), end, rtol=LEAST_RELATIVE,
            atol=self.tolerance * (1.0 + np.abs(self.origin.value)), max_step=LONGEST, first_step=first_step,
        )  # fmt: skip

    def change_until(self, solver: DOP853, t: float) -> np.ndarray:
        """Return the change until a time within the last step, integrated again: more exact than its interpolation."""
        if t <= solver.t_old:
            return np.zeros_like(self.origin.value)
        again = self.solver(solver.t_old, t, t - solver.t_old)
        while again.status == "running":
            again.step()
        return again.y

    def first_crossing(self, solver: DOP853) -> tuple[float, np.ndarray] | None:
        """Return (time, cases that change) of the first event within the last step; None if there is none."""

        def wrong(change: np.ndarray) -> np.ndarray:
            """Positive where a case does not hold any more; the friction of points that do not press has none."""
            values = margins(self.body, self.ground, self.cases, self.origin.plus(change))
            result = np.where(self.cases, -1.0, 1.0) * values
            result[1:BEYOND, ~self.cases[0]] = -1.0  # in the air only the touch and the faces count
            result[3, ~self.cases[2]] = -1.0
            result[TOP:, ~self.cases[BEYOND]] = -1.0  # faces of the step count behind its wall
            return result

        at_end = wrong(solver.y)
        points = [solver.t]
        end_margins = margins(self.body, self.ground, self.cases, self.origin.plus(solver.y))
        dense = None
        if np.abs(end_margins[[0, BEYOND]]).min() < GRAZING:
            dense = solver.dense_output()
            points = list(np.linspace(solver.t_old, solver.t, 9)[1:])
        before = solver.t_old
        for point in points:
            values = at_end if point == solver.t else wrong(dense(point))  # type: ignore[misc]
            if (values > 0.0).any():
                dense = dense or solver.dense_output()
                roots = [
                    (_root(wrong, dense, before, point, k), k) for k in zip(*np.nonzero(values > 0.0), strict=True)
                ]
                t = min(roots)[0]
                changed = np.zeros_like(self.cases)
                for root, k in roots:
                    changed[k] = root == t
                return t, changed
            before = point
        return None


def landing(
    body: LandingBody, ground: LandingGround, start: np.ndarray, times: np.ndarray, tolerance: float = TOLERANCE
) -> tuple[np.ndarray, int]:
    """Return (states at `times`, of which the first is `start`; number of events).

    Raises:
        ValueError: the integration fails.
    """
    out = np.empty((len(times), len(start)))
    out[0] = start
    t, origin, row, events = float(times[0]), _Origin(start, np.zeros_like(start)), 1, 0
    cases, step = cases_at(body, ground, start), None
    while row < len(times):
        piece = _Piece(body, ground, cases, origin, tolerance)
        solver = piece.solver(t, float(times[-1]), step and min(step, float(times[-1]) - t))
        crossed = None
        while crossed is None and row < len(times):
            if message := solver.step():
                raise ValueError(f"reference: {message}")
            crossed = piece.first_crossing(solver)
            limit = crossed[0] if crossed else solver.t
            while row < len(times) and times[row] <= limit:
                out[row] = piece.origin.plus(piece.change_until(solver, float(times[row])))
                row += 1
            if not crossed:
                piece.origin, solver.y = piece.origin.moved(solver.y), np.zeros_like(start)
        if crossed:
            step = max(1e-9, 0.2 * (solver.t - solver.t_old))
            t, changed = crossed
            origin = piece.origin.moved(piece.change_until(solver, t))
            cases = _cases_after(body, ground, cases, changed, origin.value)
            events += 1
    return out, events


def _cases_after(
    body: LandingBody, ground: LandingGround, before: np.ndarray, changed: np.ndarray, y: np.ndarray
) -> np.ndarray:
    """Return the cases after an event."""
    cases = before ^ changed
    rotation = changed[BEYOND:].any(axis=0)  # at another face the cases are determined again
    for row in (FLOOR, TOP):  # the distance from the wall depends on the case of the ground
        cases[row, changed[BEYOND]] = (margins(body, ground, cases, y) > 0.0)[row, changed[BEYOND]]
    for _ in range(2):
        cases[:BEYOND, rotation] = (margins(body, ground, cases, y) > 0.0)[:BEYOND, rotation]
    new_contact = cases[0] & (changed[0] | changed[2])  # new contacts
    now = margins(body, ground, cases, y) > 0.0
    now[3] |= new_contact  # a point slides until it carries load
    now[2] |= changed[0]
    cases[1:BEYOND, new_contact] = np.where(changed[1:, new_contact], cases[1:, new_contact], now[1:, new_contact])[
        : BEYOND - 1
    ]
    return cases


def _root(
    wrong: Callable[[np.ndarray], np.ndarray], dense: Callable[[float], np.ndarray], before: float, after: float,
    k: tuple[int, ...],
) -> float:  # fmt: skip
    """Return the time at which a value becomes positive; that before if it is positive there, by round-off."""
    if wrong(dense(before))[k] >= 0.0:
        return before
    return float(brentq(lambda t: wrong(dense(t))[k], before, after, xtol=1e-16, rtol=1e-15))
