"""What the estimator believes, against the truth."""

from collections import Counter

import numpy as np
from matplotlib.figure import Figure
from scipy.spatial.transform import Rotation

from studies.flight import Flight
from studies.report.style import BOUND, FLOWN, STEERED, NotRecordedError, line, rows, shade_phases
from studies.topic_view import TopicView

ORDER = 70
TITLE = "Estimator: error and 3-sigma bounds"
NEEDS = ("truth", "estimate")
MODELS = STEERED
_COLUMNS = (("position", "m", "xyz"), ("velocity", "m/s", "xyz"), ("attitude", "rad", "xyz"))


def draw(flight: Flight) -> tuple[Figure, str]:
    """Errors of position, velocity (world frame) and attitude (rotation vector, body frame), a row for each axis."""
    error, sigma = errors(flight), deviations(flight.estimate)
    if not sigma.any():
        raise NotRecordedError("the estimate states no uncertainty (it is the truth)")
    figure, axes = rows(3, columns=3, height=1.8)
    t = flight.estimate.stamps
    for column, (quantity, unit, names) in enumerate(_COLUMNS):
        axes[0, column].set_title(f"{quantity} error [{unit}]")
        for row, name in enumerate(names):
            axis, index = axes[row, column], 3 * column + row
            axis.fill_between(t, -3 * sigma[:, index], 3 * sigma[:, index], color=BOUND, alpha=0.16, linewidth=0)
            line(axis, t, error[:, index], color=FLOWN, linewidth=0.8)
            axis.set_ylabel(name, rotation=0)
            # A touch-down's short peak must not flatten the flight: the scale leaves out 3 % of the samples.
            scale = 1.3 * max(np.quantile(np.abs(error[:, index]), 0.97), np.quantile(3 * sigma[:, index], 0.95), 1e-12)
            axis.set_ylim(-scale, scale)
            peak = f"largest {np.abs(error[:, index]).max():.2g}"
            axis.text(0.02, 0.97, peak, transform=axis.transAxes, ha="left", va="top", fontsize=8, color="#555555")
    shade_phases(axes, flight)
    inside = np.mean(np.abs(error) <= 3 * sigma)
    return figure, (
        "Estimate minus truth at the estimate's own time, within three standard deviations as the estimator says "
        f"(shaded); {100 * inside:.1f} % of the errors lie inside. "
        "The scale leaves out the largest 3 %. Attitude as rotation vector in the body frame. " + refusals(flight)
    )


def deviations(estimate: TopicView) -> np.ndarray:
    """The standard deviations of position [m], velocity [m/s], attitude [rad], shape (n, 9)."""
    return np.hstack([estimate.position_std, estimate.velocity_std, estimate.attitude_std])


def errors(flight: Flight) -> np.ndarray:
    """Estimate minus truth [m], [m/s], [rad], shape (n, 9); the attitude's is log(R_true^T R_estimate)."""
    stamps, wanted = flight.truth.stamps, flight.estimate.stamps
    later = np.searchsorted(stamps, wanted).clip(1, len(stamps) - 1)
    nearer = stamps[later] - wanted > wanted - stamps[later - 1]
    at = later - nearer
    both = flight.truth, flight.estimate
    true, estimated = (np.hstack([view.position, view.velocity]) for view in both)
    R_true, R_estimate = (Rotation.from_quat(view.orientation) for view in both)
    return np.column_stack([estimated - true[at], (R_true[at].inv() * R_estimate).as_rotvec()])


def refusals(flight: Flight) -> str:
    """How often the measurements of each source were refused, as a sentence."""
    count = Counter(source for sources in flight.estimate.rejected for source in sources)
    said = ", ".join(f"{source} {times}" for source, times in count.most_common())
    return f"Measurements refused: {said or 'none'}."
