"""Parameters and standard errors by instrumental variables, for a robust loss.

The noise of a measured start enters a prediction and its derivatives alike, so that the minimum of a sum of squares is
biased as in regression on noisy regressors. Instruments are derivatives at starts from other samples, whose noise is
independent of that of the prediction (Söderström and Stoica, System Identification, 1989, chapter 8).
"""

from typing import NamedTuple

import numpy as np
from scipy.stats import norm
from scipy.stats import t as student

LOSS_SCALE = 0.5  # residual, in units of its scale, where the robust loss turns from square to linear
NO_INFLUENCE = 1e-12  # of the largest information, below which a parameter changes no prediction
SINGULAR = 1e-4  # singular value of the scaled information below which a direction is not corrected
SMALLEST = 1e-12  # singular value that counts in the covariance


class Moments(NamedTuple):
    """Linearised moment equations of k parameters."""

    step: np.ndarray  # to their solution, at most one standard error, shape (k,)
    deviation: np.ndarray  # standard errors, shape (k,); infinite without influence
    correlation: np.ndarray  # shape (k, k)


def loss(residual: np.ndarray) -> np.ndarray:
    """Return the soft L1 loss of each residual."""
    return 2.0 * LOSS_SCALE**2 * (np.sqrt(1.0 + (residual / LOSS_SCALE) ** 2) - 1.0)


def moments(residual: np.ndarray, derivatives: np.ndarray, instruments: np.ndarray, clusters: np.ndarray) -> Moments:
    """Return the step that makes instruments and residuals uncorrelated, and the errors of its solution.

    Standard errors come from the sandwich estimator over clusters, with the small-sample factor n / (n - k) of the
    variance for n clusters. They are scaled so that two of them cover as much of Student's distribution as of a
    normal one; with a single cluster they are infinite.

    Args:
        residual: shape (m,).
        derivatives: of the residuals by the parameters, shape (m, k).
        instruments: the same at other starts, shape (m, k).
        clusters: index of the cluster of each window, shape (windows,); m is a multiple of windows.
    """
    k = derivatives.shape[1]
    square = 1.0 + (residual / LOSS_SCALE) ** 2
    weight = (square**-1.5)[:, None]  # second derivative of the loss
    total = np.zeros((int(clusters.max()) + 1, k))
    score = (instruments * (residual * square**-0.5)[:, None]).reshape(len(clusters), -1, k).sum(axis=1)
    np.add.at(total, clusters, score)
    size = (derivatives**2 * weight).sum(axis=0)
    dead = size <= NO_INFLUENCE * size.max(initial=0.0)
    scale = np.sqrt(np.where(dead, 1.0, size))
    information = instruments.T @ (derivatives * weight) / np.outer(scale, scale)
    left, values, right = np.linalg.svd(information)
    inverse = (right.T / np.maximum(values, SMALLEST)) @ left.T / np.outer(scale, scale)
    centred = total - total.mean(axis=0)
    factor = len(total) / max(len(total) - k, 1)
    covariance = inverse @ (centred.T @ centred * factor) @ inverse.T
    spread = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    correlation = np.where(dead | dead[:, None], np.eye(k), covariance / np.outer(spread, spread))
    unknown = dead | (len(total) == 1)  # one cluster has no spread
    deviation = np.where(unknown, np.inf, spread * student.ppf(norm.cdf(2.0), max(len(total) - k, 1)) / 2.0)
    known = np.where(values > SINGULAR, 1.0 / np.maximum(values, SINGULAR), 0.0)
    step = -((right.T * known) @ left.T / np.outer(scale, scale)) @ total.sum(axis=0)
    return Moments(np.clip(step, -deviation, deviation), deviation, correlation)
