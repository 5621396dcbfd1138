"""Standard errors of a linear problem with clusters, whose errors are known."""

import numpy as np
import pytest

from lapwing.studies.identification.instrumental_variables import moments

CLUSTERS, ROWS, FREE = 20, 10, 4
SMALL = 1e-3  # scale of the residuals, far below that of the robust loss


def problem(draw, inequality):
    """Return residuals, derivatives, instruments, clusters, and the error of the solution; the true values are 0.

    Errors and regressors are correlated within a cluster. The clusters have log-normal information.
    """
    size = np.exp(inequality * draw.standard_normal((CLUSTERS, 1, 1)))
    x = size * (draw.standard_normal((CLUSTERS, 1, FREE)) + draw.standard_normal((CLUSTERS, ROWS, FREE)))
    z = x + 0.5 * size * draw.standard_normal(x.shape)
    e = SMALL * (draw.standard_normal((CLUSTERS, 1)) + draw.standard_normal((CLUSTERS, ROWS)))
    x, z, e = x.reshape(-1, FREE), z.reshape(-1, FREE), e.ravel()
    solution = -np.linalg.solve(z.T @ x, z.T @ e)
    return e + x @ solution, x, z, np.repeat(np.arange(CLUSTERS), ROWS), solution


@pytest.mark.parametrize("inequality", [0.0, 1.0])
def test_two_standard_errors_cover_95_percent(inequality):
    draw = np.random.default_rng(20)
    ratios = []
    for _ in range(800):
        *linear, solution = problem(draw, inequality)
        ratios.append(solution / moments(*linear).deviation)
    assert np.mean(np.abs(ratios) < 2.0) == pytest.approx(0.9545, abs=0.012)


def test_covariance_is_that_of_the_jackknife():
    residual, x, z, cluster, solution = problem(np.random.default_rng(3), 1.0)
    e = residual - x @ solution
    left_out = []
    for g in range(CLUSTERS):
        rest = cluster != g
        left_out.append(-np.linalg.solve(z[rest].T @ x[rest], z[rest].T @ e[rest]))
    expected = np.cov(np.array(left_out).T) * (CLUSTERS - 1) ** 2 / CLUSTERS
    result = moments(residual, x, z, cluster)
    assert result.correlation == pytest.approx(
        expected / np.sqrt(np.outer(np.diag(expected), np.diag(expected))), abs=1e-3
    )
    ratio = result.deviation / np.sqrt(np.diag(expected))
    assert ratio == pytest.approx(np.full(FREE, ratio[0]), rel=1e-3)
    assert 1.0 < ratio[0] < 1.1


def test_single_cluster_has_no_finite_standard_errors():
    residual, x, z, cluster, _ = problem(np.random.default_rng(3), 0.0)
    assert np.isinf(moments(residual, x, z, 0 * cluster).deviation).all()
