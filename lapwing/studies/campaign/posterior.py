"""Joint distribution of the parameters that `lapwing identify` has estimated, for vehicles drawn from it."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from lapwing.dynamics.vehicles.airframe import load_airframe
from lapwing.studies.campaign.distributions import KINDS, Distribution, lognormal

TABLE = "posterior"  # of an airframe file
SMALLEST = 1e-12  # eigenvalue of a correlation matrix, whose rounding may make it negative


def table(keys: Mapping[str, str], mean: np.ndarray, covariance: np.ndarray) -> dict[str, Any]:
    """Return the table of an airframe file.

    Args:
        keys: kind of distribution by key.
        mean: shape (k,).
        covariance: shape (k, k).
    """
    spread = np.sqrt(np.diag(covariance))
    correlations = covariance / np.outer(spread, spread)
    lists = {"mean": mean.tolist(), "covariance": covariance.tolist(), "correlations": correlations.tolist()}
    return {"keys": list(keys), "distributions": list(keys.values()), **lists}


def posterior(path: str | Path) -> dict[str, Distribution]:
    """Return the correlated distributions of the parameters in a file of `lapwing identify`, by scene key.

    Drawn together, they have the mean and the covariance of the estimates. Parameters that must be positive are
    log-normal. Use them as `vary` of a campaign, a `BatchSimulator` or environments.

    Args:
        path: the airframe file that `lapwing identify --out` has written.

    Raises:
        ValueError: the file is no airframe, or has no posterior.
    """
    entry = load_airframe(path).posterior
    if entry is None:
        raise ValueError(
            f"{path}: no estimates in [{TABLE}]; expected a file that `lapwing identify --out` has written"
        )
    mean, covariance = np.array(entry.mean), np.array(entry.covariance)
    weights = _weights(_log_scale(entry.distributions, mean, covariance)).tolist()
    spread = np.sqrt(np.diag(covariance)).tolist()
    return {
        key: KINDS[kind](m, s, {other: w for other, w in zip(entry.keys, row, strict=True) if w != 0.0})
        for key, kind, m, s, row in zip(entry.keys, entry.distributions, entry.mean, spread, weights, strict=True)
    }


def _log_scale(kinds: Sequence[str], mean: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """Return the covariance of the normal numbers: of the parameters, or the logarithms of log-normal ones."""
    positive = np.array([kind == lognormal.__name__ for kind in kinds])
    relative = covariance / np.where(positive, mean, 1.0)[:, None] / np.where(positive, mean, 1.0)
    return np.where(np.outer(positive, positive), np.log1p(np.maximum(relative, SMALLEST - 1.0)), relative)


def _weights(covariance: np.ndarray) -> np.ndarray:
    """Return the lower triangular matrix L with L L^T = correlation matrix, shape (k, k)."""
    spread = np.sqrt(np.diag(covariance))
    values, vectors = np.linalg.eigh(covariance / np.outer(spread, spread))
    nearest = (vectors * np.maximum(values, SMALLEST)) @ vectors.T
    lower = np.linalg.cholesky(nearest)
    return np.asarray(lower / np.linalg.norm(lower, axis=1, keepdims=True))
