"""What the estimator believes, against the truth."""

from collections import Counter

import numpy as np
from matplotlib.figure import Figure
from scipy.spatial.transform import Rotation

from studies.flown import Flown
from studies.report.style import BOUND, FLOWN, STEERED, NotRecordedError, line, rows, shade_phases

ORDER = 70
TITLE = "Estimator: error and 3-sigma bounds"
NEEDS = ("truth", "estimate")
MODELS = STEERED
_COLUMNS = (("position", "m", "xyz"), ("velocity", "m/s", "xyz"), ("attitude", "rad", "xyz"))


def draw(flown: Flown) -> tuple[Figure, str]:
    """Errors of position, velocity (world frame) and attitude (rotation vector, body frame), a row for each axis."""
    error, sigma = errors(flown), flown.column("estimate", deviations)
    if not sigma.any():
        raise NotRecordedError("the estimate states no uncertainty (it is the truth)")
    figure, axes = rows(3, columns=3, height=1.8)
    t = flown.stamps("estimate")
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
    shade_phases(axes, flown)
    inside = np.mean(np.abs(error) <= 3 * sigma)
    return figure, (
        "Estimate minus truth at the estimate's own time, within three standard deviations as the estimator says "
        f"(shaded); {100 * inside:.1f} % of the errors lie inside. "
        "The scale leaves out the largest 3 %. Attitude as rotation vector in the body frame. " + refusals(flown)
    )


def deviations(message) -> tuple[float, ...]:
    """The nine standard deviations of an Estimate: position, velocity, attitude."""
    return (*message.position_std, *message.velocity_std, *message.attitude_std)


def errors(flown: Flown) -> np.ndarray:
    """Estimate minus truth [m], [m/s], [rad], shape (n, 9); the attitude's is log(R_true^T R_estimate)."""
    stamps = flown.stamps("truth")
    later = np.searchsorted(stamps, flown.stamps("estimate")).clip(1, len(stamps) - 1)
    nearer = stamps[later] - flown.stamps("estimate") > flown.stamps("estimate") - stamps[later - 1]
    at = later - nearer
    true, believed = (flown.column(topic, lambda m: (*m.pose.position, *m.velocity)) for topic in ("truth", "estimate"))
    R_true, R_estimate = (
        Rotation.from_quat(flown.column(topic, lambda m: m.pose.orientation)) for topic in ("truth", "estimate")
    )
    return np.column_stack([believed - true[at], (R_true[at].inv() * R_estimate).as_rotvec()])


def refusals(flown: Flown) -> str:
    """How often the measurements of each source were refused, as a sentence."""
    count = Counter(
        source for sources in flown.column("estimate", lambda m: " ".join(m.rejected)) for source in sources.split()
    )
    said = ", ".join(f"{source} {times}" for source, times in count.most_common())
    return f"Measurements refused: {said or 'none'}."
