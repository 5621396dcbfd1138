import numpy as np
import pytest

from lapwing.studies.identification.instrumental_variables import moments

TRUE, WINDOWS, CLUSTERS = np.array([2.0, -0.5]), 400, 20
NAMES = np.arange(WINDOWS) * CLUSTERS // WINDOWS
ROWS, FREE = 10, 4  # of each of the clusters of unequal information
SMALL = 1e-3  # scale of the residuals, far below that of the robust loss


def regression(seed, noise=0.4):
    """Return measured regressors, others with independent noise, and observations of a linear model."""
    draw = np.random.default_rng(seed)
    x = draw.standard_normal((WINDOWS, 2))
    first, second = (x + noise * draw.standard_normal(x.shape) for _ in range(2))
    return first, second, x @ TRUE + 0.1 * draw.standard_normal(WINDOWS)


def solved(first, instruments, y):
    values = TRUE.copy()
    for _ in range(12):
        result = moments(first @ values - y, first, instruments, NAMES)
        values = values + result.step
    return (values - TRUE) / result.deviation


def test_noisy_regressors_bias_only_without_instruments():
    draws = [regression(seed) for seed in range(40)]
    biased = np.array([solved(first, first, y) for first, _, y in draws])
    sound = np.array([solved(first, second, y) for first, second, y in draws])
    assert biased[:, 0].mean() < -2.0
    assert np.abs(sound.mean(axis=0)).max() < 3.0 / np.sqrt(40.0)


def test_parameter_without_influence_has_infinite_error_and_no_step():
    first, second, y = regression(1)
    first[:, 1] = second[:, 1] = 0.0
    result = moments(first @ TRUE - y, first, second, NAMES)
    assert result.deviation[1] == np.inf
    assert result.step[1] == 0.0
    assert result.correlation[0, 1] == 0.0


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
