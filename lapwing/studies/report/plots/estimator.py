"""Estimation errors and their standard deviations."""

from collections import Counter

import numpy as np

from lapwing.studies.flight_data import FlightData
from lapwing.studies.report.flight_phases import DEGREES, over
from lapwing.studies.report.plot import Band, Line, NotRecordedError, Panel, Plot
from lapwing.studies.report.style import STEERED
from lapwing.studies.topic_view import TopicView

ORDER = 70
TITLE = "Estimator: error and 3-sigma bounds"
NEEDS = ("ground_truth", "estimate")
MODELS = STEERED
_COLUMNS = (("position", "m", 1.0), ("velocity", "m/s", 1.0), ("attitude", "°", DEGREES))


def draw(flight: FlightData) -> Plot:
    """Plot errors of position, velocity (world frame) and attitude (rotation vector, body frame), a row per axis."""
    error, sigma = errors(flight), deviations(flight.estimate)
    if not sigma.any():
        raise NotRecordedError("the estimate states no uncertainty (it is the truth)")
    inside = np.mean(np.abs(error) <= 3 * sigma)
    t, panels, cut = flight.estimate.stamps, [], 0
    for column, (quantity, unit, scale) in enumerate(_COLUMNS):
        for row, name in enumerate("xyz"):
            off, bound = (scale * values[:, 3 * column + row] for values in (error, 3 * sigma))
            # A touch-down's short peak must not flatten the flight: the scale leaves out 3 % of the samples.
            half = 1.3 * max(np.quantile(np.abs(off), 0.97), np.quantile(bound, 0.95), 1e-12)
            largest = np.abs(off).max()
            cut += int(np.sum(np.abs(off) > half))
            beyond = f"max {largest:.2g}" + (" ▲" if largest > half else "")
            marks = Band(t, -bound, bound, "3 sigma"), Line(t, off, "estimate minus truth", width=1.0)
            label = f"{quantity} {name} [{unit}]"
            panels.append(Panel(marks, label, title=beyond, row=row, column=column, y_range=(-half, half)))
    note = f"{cut} samples lie beyond the scales of their panels (▲)" if cut else "Nothing lies beyond the scales"
    caption = (
        "Estimate minus truth at the estimate's own time, within three standard deviations as the estimator says "
        f"(shaded); {100 * inside:.1f} % of the errors lie inside. {note}. "
        "Attitude as rotation vector in the body frame. " + refusals(flight)
    )
    return Plot(tuple(panels), caption, 6.6, (1.0,) * 3, (1.0,) * 3, **over(flight))


def deviations(estimate: TopicView) -> np.ndarray:
    """Return the standard deviations of position [m], velocity [m/s], attitude [rad], shape (n, 9)."""
    return np.hstack([estimate.position_std, estimate.velocity_std, estimate.attitude_std])


def errors(flight: FlightData) -> np.ndarray:
    """Estimate minus truth [m], [m/s], [rad], shape (n, 9); the attitude's is log(R_true^T R_estimate)."""
    from scipy.spatial.transform import Rotation  # 0.2 s, which only reports that draw this wait for

    stamps, own = flight.truth.stamps, flight.estimate.stamps
    later = np.searchsorted(stamps, own).clip(1, len(stamps) - 1)
    nearer = stamps[later] - own > own - stamps[later - 1]
    at = later - nearer
    both = flight.truth, flight.estimate
    true, estimated = (np.hstack([view.position, view.velocity]) for view in both)
    R_true, R_estimate = (Rotation.from_quat(view.orientation) for view in both)
    return np.column_stack([estimated - true[at], (R_true[at].inv() * R_estimate).as_rotvec()])


def refusals(flight: FlightData) -> str:
    """Return the share of rejected measurements of each source as a sentence."""
    count = Counter(source for sources in flight.estimate.rejected_sources for source in sources)
    note = ", ".join(f"{source} {times}" for source, times in count.most_common())
    return f"Measurements rejected: {note or 'none'}."
