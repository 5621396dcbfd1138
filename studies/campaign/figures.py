"""What one flight of a campaign comes to."""

from typing import NamedTuple

import numpy as np

from studies import tracking
from studies.campaign.record import FlightRecord, Flown

HARD = 2.0  # [m/s] downwards at the first touch: a crash
UPSIDE = 0.0  # cosine of the tilt below which the vehicle has turned over: a crash
SURE = 3.0  # standard deviations of its own that the estimate is given


class Figures(NamedTuple):
    """Figures of merit of a flight."""

    seed: int
    rmse: dict[str, float]  # [m], [rad] of the reference against the truth
    rmse_estimate: dict[str, float]  # of the reference against the estimate
    worst: float  # [m] largest distance from the path
    inside: tuple[float, float, float]  # share of the flight with the truth within 3 sigma of the estimate: x, y, z
    touchdown: float  # [m/s] speed downwards at the hardest touch
    energy: float  # [J] electrical
    duration: float  # [s]
    crash: str  # "", or how


def figures(seed: int, flown: Flown, interval: float) -> Figures:
    """The figures of a flight whose ticks take `interval` seconds."""
    r = flown.record
    reference = np.column_stack([r.setpoint_world[:, :3], r.tilt_reference, r.setpoint_world[:, 3]])
    true = tracking.errors(reference, r.position_world, _angles(r.attitude), r.armed)
    believed = tracking.errors(reference, r.estimated_world, _angles(r.estimated_attitude), r.armed)
    off = np.abs(r.estimated_world - r.position_world)[r.armed]
    inside = (off <= SURE * r.position_std[r.armed]).mean(axis=0) if r.armed.any() else np.full(3, np.nan)
    touchdown = _touchdown(r)
    return Figures(
        seed,
        tracking.rmse(true),
        tracking.rmse(believed),
        float(np.linalg.norm(true[:, :3], axis=1).max(initial=0.0)),
        (float(inside[0]), float(inside[1]), float(inside[2])),
        touchdown,
        float(r.power.sum() * interval),
        len(r.power) * interval,
        _crash(flown, touchdown),
    )


def _angles(wxyz: np.ndarray) -> np.ndarray:
    return tracking.roll_pitch_yaw(wxyz[:, [1, 2, 3, 0]])


def _touchdown(r: FlightRecord) -> float:
    """The greatest speed downwards [m/s] one tick before a touch; 0 without a touch."""
    touched = np.flatnonzero(r.in_contact[1:] & ~r.in_contact[:-1])
    return float(max(-r.velocity_world[touched, 2].min(initial=0.0), 0.0))


def _crash(flown: Flown, touchdown: float) -> str:
    r = flown.record
    x, y = r.attitude[:, 1], r.attitude[:, 2]
    if not flown.finite:
        return "numbers are not finite"
    if (1.0 - 2.0 * (x * x + y * y) < UPSIDE).any():
        return "turned over"
    if touchdown > HARD:
        return f"hit the ground at {touchdown:.1f} m/s"
    return "" if flown.finished else "the mission did not end"
