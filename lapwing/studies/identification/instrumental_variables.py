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

    The covariance is that of the jackknife over n clusters, linearised: without cluster g, whose share of the
    information is A_g and of the moments s_g, the solution moves by (A - A_g)^-1 s_g. In the sandwich estimator a
    cluster of much information draws the solution to its own errors, and these seem smaller than they are; the factor
    n / (n - k) corrects that for equal clusters alone (MacKinnon, Nielsen and Webb, Journal of Econometrics 232, 2023,
    section 3). Standard errors are scaled so that two of them cover as much of Student's distribution with n - 1
    degrees of freedom as of a normal one; with a single cluster they are infinite.

    Args:
        residual: shape (m,).
        derivatives: of the residuals by the parameters, shape (m, k).
        instruments: the same at other starts, shape (m, k).
        clusters: index of the cluster of each window, shape (windows,); m is a multiple of windows.
    """
    k = derivatives.shape[1]
    square = 1.0 + (residual / LOSS_SCALE) ** 2
    weight = (square**-1.5)[:, None]  # second derivative of the loss
    size = (derivatives**2 * weight).sum(axis=0)
    dead = size <= NO_INFLUENCE * size.max(initial=0.0)
    scale = np.sqrt(np.where(dead, 1.0, size))
    score = (instruments * (residual * square**-0.5)[:, None] / scale).reshape(len(clusters), -1, k)
    n = int(clusters.max()) + 1
    total, shares = np.zeros((n, k)), np.zeros((n, k, k))
    np.add.at(total, clusters, score.sum(axis=1))
    pair = (v.reshape(len(clusters), -1, k) for v in (instruments / scale, derivatives * weight / scale))
    np.add.at(shares, clusters, np.einsum("wmi,wmj->wij", *pair))
    information = shares.sum(axis=0)
    left, values, right = np.linalg.svd(information)
    rest_left, rest_values, rest_right = np.linalg.svd(information - shares)
    moved = np.einsum("gji,gj,glj,gl->gi", rest_right, 1.0 / np.maximum(rest_values, SMALLEST), rest_left, total)
    moved = (moved - moved.mean(axis=0)) / scale
    covariance = moved.T @ moved * (n - 1) / n
    spread = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    correlation = np.where(dead | dead[:, None], np.eye(k), covariance / np.outer(spread, spread))
    widening = student.ppf(norm.cdf(2.0), n - 1) / 2.0 if n > 1 else np.inf
    deviation = np.where(dead, np.inf, spread * widening)
    known = np.where(values > SINGULAR, 1.0 / np.maximum(values, SINGULAR), 0.0)
    step = -((right.T * known) @ left.T @ total.sum(axis=0)) / scale
    return Moments(np.clip(step, -deviation, deviation), deviation, correlation)
