"""Estimation errors and their standard deviations."""

from collections import Counter

import numpy as np

from lapwing.flights.flight_data import FlightData
from lapwing.flights.rotation_arrays import conjugate, from_xyzw, product, rotation_vector
from lapwing.flights.topic_view import TopicView
from lapwing.views.report.flight_phases import DEGREES, over
from lapwing.views.report.plot import Band, Line, NotRecordedError, Panel, Plot
from lapwing.views.report.style import STEERED

ORDER = 70
TITLE = "Estimator: error and 3-sigma bounds"
NEEDS = ("ground_truth", "estimate")
MODELS = STEERED
_COLUMNS = (("position", "m", 1.0), ("velocity", "m/s", 1.0), ("attitude", "°", DEGREES))


def draw(flight: FlightData) -> Plot:
    """Plot errors of position, velocity (world frame) and attitude (rotation vector, body frame), a row per axis."""
    sigma = deviations(flight.estimate)
    if not sigma.any():
        raise NotRecordedError("the estimate has no standard deviations (it is the truth)")
    error = errors(flight)
    inside = np.mean(np.abs(error) <= 3 * sigma)
    t, panels, cut = flight.estimate.stamps, [], 0
    for column, (quantity, unit, scale) in enumerate(_COLUMNS):
        for row, name in enumerate("xyz"):
            deviation, bound = (scale * values[:, 3 * column + row] for values in (error, 3 * sigma))
            # The scale excludes 3 % of the samples, so that a short peak at touch-down does not flatten the flight.
            half = 1.3 * max(np.quantile(np.abs(deviation), 0.97), np.quantile(bound, 0.95), 1e-12)
            largest = np.abs(deviation).max()
            cut += int(np.sum(np.abs(deviation) > half))
            title = f"max {largest:.2g}" + (" ▲" if largest > half else "")
            marks = Band(t, -bound, bound, "3 sigma"), Line(t, deviation, "estimate minus truth", width=1.0)
            label = f"{quantity} {name} [{unit}]"
            panels.append(Panel(marks, label, title=title, row=row, column=column, y_range=(-half, half)))
    note = f"{cut} samples exceed the scales of their panels (▲)" if cut else "No sample exceeds the scales"
    caption = (
        "Estimate minus truth at the time of the estimate, and three standard deviations of the estimator (shaded); "
        f"{100 * inside:.1f} % of the errors lie within them. {note}. "
        "Attitude as rotation vector in the body frame. " + rejections(flight)
    )
    return Plot(tuple(panels), caption, 6.6, (1.0,) * 3, (1.0,) * 3, **over(flight))


def deviations(estimate: TopicView) -> np.ndarray:
    """Return the standard deviations of position [m], velocity [m/s], attitude [rad], shape (n, 9)."""
    return np.hstack([estimate.position_std, estimate.velocity_std, estimate.attitude_std])


def errors(flight: FlightData) -> np.ndarray:
    """Return estimate minus truth [m], [m/s], [rad], shape (n, 9); the attitude's is log(R_true^T R_estimate)."""
    stamps, own = flight.truth.stamps, flight.estimate.stamps
    later = np.searchsorted(stamps, own).clip(1, len(stamps) - 1)
    nearer = stamps[later] - own > own - stamps[later - 1]
    rows = later - nearer
    both = flight.truth, flight.estimate
    true, estimated = (np.hstack([view.position, view.velocity]) for view in both)
    start, end = from_xyzw(flight.truth.orientation[rows]), from_xyzw(flight.estimate.orientation)
    return np.column_stack([estimated - true[rows], rotation_vector(product(conjugate(start), end))])


def rejections(flight: FlightData) -> str:
    """Return the number of rejected measurements of each source as a sentence."""
    count = Counter(source for sources in flight.estimate.rejected_sources for source in sources)
    note = ", ".join(f"{source} {number}" for source, number in count.most_common())
    return f"Measurements rejected: {note or 'none'}."
