"""Vote between two or three inertial measurement units (theory, section 3.4).

A reading is good if it is valid, is not stuck, and agrees with the median of the good ones where three units are left.
With two units only missing and stuck readings are detected: a disagreement does not identify the wrong unit.
"""

from typing import NamedTuple

from lapwing.cosim.diagram.compiled_block import CONTINUE, InputSample
from lapwing.dynamics.vector import Vec3
from lapwing.kernels import always_inline
from lapwing.services.common.ports import ImuReading, ImuSelection

RATE_LIMIT, FORCE_LIMIT = 0.1, 1.0  # [rad/s], [m/s^2] deviation from the median of a unit that is wrong
SCORE_BAD, SCORE_FAILED, SCORE_MAX = 10, 100, 1000  # a bad reading adds SCORE_BAD, a good one subtracts 1


class UnitHistory(NamedTuple):
    """Readings of a unit so far."""

    omega: Vec3 = (0.0, 0.0, 0.0)  # [rad/s] last
    force: Vec3 = (0.0, 0.0, 0.0)  # [m/s^2] last
    repeats: int = 0  # consecutive equal readings
    score: int = 0
    failed: bool = False  # SCORE_FAILED was reached, and the score has not been 0 since


class VoteState(NamedTuple):
    """State of the block."""

    first: UnitHistory = UnitHistory()
    second: UnitHistory = UnitHistory()
    third: UnitHistory = UnitHistory()
    unit: int = 1  # in use


class Vote(NamedTuple):
    """Parameters of the block."""

    frozen: int  # consecutive equal readings of a stuck unit


@always_inline
def _median(a: float, b: float, c: float) -> float:
    return max(min(a, b), min(max(a, b), c))


@always_inline
def _agrees(x: Vec3, a: Vec3, b: Vec3, c: Vec3, limit: float) -> bool:
    """Return True if x is within a limit of the median of a, b and c on each axis."""
    return (
        abs(x[0] - _median(a[0], b[0], c[0])) < limit
        and abs(x[1] - _median(a[1], b[1], c[1])) < limit
        and abs(x[2] - _median(a[2], b[2], c[2])) < limit
    )


@always_inline
def _consistent(x: ImuReading, a: ImuReading, b: ImuReading, c: ImuReading) -> bool:
    return _agrees(x.omega_body, a.omega_body, b.omega_body, c.omega_body, RATE_LIMIT) and _agrees(
        x.specific_force_body, a.specific_force_body, b.specific_force_body, c.specific_force_body, FORCE_LIMIT
    )


@always_inline
def _update_history(h: UnitHistory, r: ImuReading) -> UnitHistory:
    """Return the history with the repetitions of a noisy unit counted."""
    same = r.valid and r.omega_variance > 0.0 and (r.omega_body == h.omega or r.specific_force_body == h.force)
    return UnitHistory(r.omega_body, r.specific_force_body, h.repeats + 1 if same else 0, h.score, h.failed)


@always_inline
def _update_score(h: UnitHistory, good: bool) -> UnitHistory:
    score = max(h.score - 1, 0) if good else min(h.score + SCORE_BAD, SCORE_MAX)
    failed = score >= SCORE_FAILED or (h.failed and score > 0)
    return UnitHistory(h.omega, h.force, h.repeats, score, failed)


@always_inline
def _choose_unit(unit: int, good: tuple[bool, bool, bool], a: UnitHistory, b: UnitHistory, c: UnitHistory) -> int:
    """Return the unit in use: the previous unit while it is good, otherwise the first good one."""
    if good[unit - 1]:
        return unit
    if good[0] and not a.failed:
        return 1
    if good[1] and not b.failed:
        return 2
    return 3 if good[2] and not c.failed else unit


@always_inline
def step(p: Vote, s: VoteState, tick: int, inputs: tuple[InputSample, ...]) -> tuple[VoteState, tuple, int]:
    """Output the reading of the unit in use and the result of the vote; a third unit may be absent."""
    x, y, z = inputs[0].value, inputs[1].value, inputs[len(inputs) - 1].value
    three = len(inputs) == 3
    a, b, c = _update_history(s.first, x), _update_history(s.second, y), _update_history(s.third, z)
    good_x = x.valid and a.repeats < p.frozen
    good_y = y.valid and b.repeats < p.frozen
    good_z = three and z.valid and c.repeats < p.frozen
    if good_x and good_y and good_z:
        good_x, good_y, good_z = _consistent(x, x, y, z), _consistent(y, x, y, z), _consistent(z, x, y, z)
    a, b, c = _update_score(a, good_x), _update_score(b, good_y), _update_score(c, good_z or not three)
    unit = _choose_unit(s.unit, (good_x, good_y, good_z), a, b, c)
    reading = x if unit == 1 else (y if unit == 2 else z)
    failed = int(a.failed) + 2 * int(b.failed) + 4 * int(c.failed)
    selection = ImuSelection(unit, failed, unit != s.unit)
    return VoteState(a, b, c, unit), (reading, selection), CONTINUE
