"""Small matrices against LAPACK."""

import numpy as np
import pytest

from lapwing.dynamics import small_matrices


def _random(*shape, seed=0):
    return np.random.default_rng(seed).normal(size=shape)


@pytest.mark.parametrize("n", [1, 2, 3, 4, 8])
def test_solution_and_inverse_match_lapack(n):
    a, b = _random(n, n), _random(n, 3, seed=1)
    assert small_matrices.solve(a, b) == pytest.approx(np.linalg.solve(a, b), rel=1e-10)
    assert small_matrices.inverse(a) == pytest.approx(np.linalg.inv(a), rel=1e-10)


def test_pivoting_handles_leading_zero():
    assert small_matrices.inverse([[0.0, 2.0], [4.0, 0.0]]).tolist() == [[0.0, 0.25], [0.5, 0.0]]


def test_matrix_without_inverse_is_rejected():
    with pytest.raises(small_matrices.SingularMatrixError):
        small_matrices.inverse([[1.0, 2.0], [2.0, 4.0]])


def test_product_matches_blas():
    a, b = _random(3, 5), _random(5, 4, seed=1)
    assert small_matrices.product(a, b) == pytest.approx(a @ b, rel=1e-13)
    assert small_matrices.dot(a[0], b[:, 0]) == pytest.approx(a[0] @ b[:, 0], rel=1e-13)
    assert small_matrices.length([3.0, 4.0]) == 5.0


@pytest.mark.parametrize("n", [1, 2, 3, 6])
def test_eigenvalues_match_lapack(n):
    a = _random(n, n)
    assert small_matrices.symmetric_eigenvalues(a + a.T) == pytest.approx(np.linalg.eigvalsh(a + a.T), abs=1e-13)


def test_eigenvalues_of_diagonal_matrix_are_exact():
    assert small_matrices.symmetric_eigenvalues(np.diag([3.0, 1.0, 2.0])) == [1.0, 2.0, 3.0]
