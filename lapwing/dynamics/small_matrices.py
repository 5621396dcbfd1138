"""Linear algebra of small matrices in plain double arithmetic, with results independent of BLAS and LAPACK.

For parameters that are computed once at the start of a run; up to about ten rows. Sums run in the order of the index.
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike


class SingularMatrixError(ValueError):
    """The matrix has no inverse."""


def _rows(a: ArrayLike) -> list[list[float]]:
    return np.asarray(a, float).tolist()


def _dot(a: Sequence[float], b: Sequence[float]) -> float:
    total = 0.0
    for x, y in zip(a, b, strict=True):
        total += x * y
    return total


def product(a: ArrayLike, b: ArrayLike) -> np.ndarray:
    """Return the matrix product, shape (n, m), of matrices of shapes (n, k) and (k, m)."""
    columns = _rows(np.transpose(np.asarray(b, float)))
    return np.array([[_dot(row, column) for column in columns] for row in _rows(a)])


def dot(a: ArrayLike, b: ArrayLike) -> float:
    """Return the scalar product of two vectors, shape (n,)."""
    return _dot(np.asarray(a, float).tolist(), np.asarray(b, float).tolist())


def length(a: ArrayLike) -> float:
    """Return the Euclidean length of a vector, shape (n,)."""
    return math.sqrt(dot(a, a))


def solve(a: ArrayLike, b: ArrayLike) -> np.ndarray:
    """Return x, shape (n, m), of a x = b by Gaussian elimination with partial pivoting.

    Args:
        a: shape (n, n).
        b: shape (n, m).

    Raises:
        SingularMatrixError: a has no inverse.
    """
    rows = [left + right for left, right in zip(_rows(a), _rows(b), strict=True)]
    n = len(rows)
    for k in range(n):
        pivot = max(range(k, n), key=lambda i: abs(rows[i][k]))
        if rows[pivot][k] == 0.0:
            raise SingularMatrixError("matrix has no inverse; check for rows that depend on each other")
        rows[k], rows[pivot] = rows[pivot], rows[k]
        for i in range(k + 1, n):
            factor = rows[i][k] / rows[k][k]
            rows[i] = [x - factor * y for x, y in zip(rows[i], rows[k], strict=True)]
    solution: list[list[float]] = [[]] * n
    for k in reversed(range(n)):
        values = rows[k][n:]
        for j in range(k + 1, n):
            values = [x - rows[k][j] * y for x, y in zip(values, solution[j], strict=True)]
        solution[k] = [x / rows[k][k] for x in values]
    return np.array(solution)


def inverse(a: ArrayLike) -> np.ndarray:
    """Return the inverse of a matrix, shape (n, n).

    Raises:
        SingularMatrixError: it has no inverse.
    """
    return solve(a, np.eye(len(_rows(a))))


def symmetric_eigenvalues(a: ArrayLike) -> list[float]:
    """Return the eigenvalues of a symmetric matrix, shape (n, n), in ascending order, by Jacobi's rotations.

    Golub and Van Loan, "Matrix Computations", 4th edition, section 8.5.
    """
    m = _rows(a)
    n = len(m)
    for _ in range(60):
        rest = max((abs(m[i][j]) for i in range(n) for j in range(i)), default=0.0)
        if rest <= 1e-17 * max(abs(m[i][i]) for i in range(n)):
            break
        for i in range(n):
            for j in range(i):
                if m[i][j] != 0.0:
                    _rotate(m, i, j)
    return sorted(m[i][i] for i in range(n))


def _rotate(m: list[list[float]], i: int, j: int) -> None:
    """Make element (i, j) of a symmetric matrix 0 by a rotation in place."""
    ratio = (m[j][j] - m[i][i]) / (2.0 * m[i][j])
    if abs(ratio) > 1e150:
        t = 0.5 / ratio
    else:
        t = (1.0 if ratio >= 0.0 else -1.0) / (abs(ratio) + math.sqrt(ratio * ratio + 1.0))
    c = 1.0 / math.sqrt(t * t + 1.0)
    s = t * c
    for row in m:
        row[i], row[j] = c * row[i] - s * row[j], s * row[i] + c * row[j]
    m[i], m[j] = (
        [c * x - s * y for x, y in zip(m[i], m[j], strict=True)],
        [s * x + c * y for x, y in zip(m[i], m[j], strict=True)],
    )
    m[i][j] = m[j][i] = 0.0
