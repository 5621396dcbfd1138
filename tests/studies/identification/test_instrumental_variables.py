import numpy as np
import pytest

from lapwing.studies.identification.instrumental_variables import moments

TRUE, WINDOWS, CLUSTERS = np.array([2.0, -0.5]), 400, 20
NAMES = np.arange(WINDOWS) * CLUSTERS // WINDOWS


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


def test_two_standard_errors_cover_95_percent():
    z = np.array([solved(first, second, y) for first, second, y in (regression(s, 0.1) for s in range(300))])
    assert np.mean(np.abs(z) < 2.0) == pytest.approx(0.954, abs=0.027)  # three standard errors of the share
    assert 0.9 < z.std() < 1.1


def test_parameter_without_influence_has_infinite_error_and_no_step():
    first, second, y = regression(1)
    first[:, 1] = second[:, 1] = 0.0
    result = moments(first @ TRUE - y, first, second, NAMES)
    assert result.deviation[1] == np.inf
    assert result.step[1] == 0.0
    assert result.correlation[0, 1] == 0.0


def test_single_cluster_has_no_finite_standard_errors():
    first, second, y = regression(1)
    assert np.isinf(moments(first @ TRUE - y, first, second, 0 * NAMES).deviation).all()
