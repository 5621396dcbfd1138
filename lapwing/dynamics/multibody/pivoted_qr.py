"""Householder QR with column pivoting of a rank-deficient wide matrix, and its two solutions.

For B of shape (n, m) of rank r, B P = Q [R11 R12; 0 0]. Columns are scaled to unit length first, so that one tolerance
fits rows of metres and of radians. Loops run along rows: memory order, vectorised without reordering any sum.
"""

from typing import NamedTuple

import numpy as np

from lapwing.kernels import always_inline, kernel, noinline
from lapwing.kernels.simd import load, splat, store

BLOCK = 16  # width of a vectorised loop; rows are padded with empty columns to a multiple of it


class Factor(NamedTuple):
    """Pivoted QR factorisation of B."""

    upper: np.ndarray  # (n, at least m): R
    reflection: np.ndarray  # (n, n): row k is the k-th vector of Householder, 1 at k, zero before it
    beta: np.ndarray  # (n,) factors of the reflections
    order: np.ndarray  # (m,) column of B at each place: the first `rank` are the independent rows of the problem
    scale: np.ndarray  # (m,) 1 / length of column order[i]; 0 for an empty column
    rank: int


@kernel
def _lengths(b, k, out):
    """Compute the squared length of every column from row k down."""
    out[:] = 0.0
    for i in range(k, b.shape[0]):
        row = b[i]
        for j in range(len(out)):
            out[j] += row[j] * row[j]


@always_inline
def _reflect(b, v, beta, k):
    """Reflect the columns of b from row k down; earlier columns are zero there."""
    n, width = b.shape
    # a row involves two bodies only: most of v is zero at first
    for j in range(k // BLOCK * BLOCK, width, BLOCK):
        w0 = w1 = w2 = w3 = splat(0.0)
        for i in range(k, n):
            f, at = v[i], i * width + j
            if f != 0.0:
                w0 = w0 + f * load(b, at)
                w1 = w1 + f * load(b, at + 4)
                w2 = w2 + f * load(b, at + 8)
                w3 = w3 + f * load(b, at + 12)
        w0, w1, w2, w3 = beta * w0, beta * w1, beta * w2, beta * w3
        for i in range(k, n):
            f, at = v[i], i * width + j
            if f != 0.0:
                store(b, at, load(b, at) - f * w0)
                store(b, at + 4, load(b, at + 4) - f * w1)
                store(b, at + 8, load(b, at + 8) - f * w2)
                store(b, at + 12, load(b, at + 12) - f * w3)


@noinline
def factor(matrix, tolerance, most):
    """Factor a matrix (n, m) with at most `most` independent columns.

    The remainder of a dependent column after elimination is below `tolerance` of its length.
    """
    n, m = matrix.shape
    width = -(-m // BLOCK) * BLOCK
    b, reflection = np.zeros((n, width)), np.zeros((n, n))
    beta, scale, order = np.zeros(n), np.zeros(m), np.arange(m)
    left = np.zeros(width)
    _lengths(matrix, 0, left[:m])
    longest = 0.0
    for j in range(m):
        longest = max(longest, left[j])
    for j in range(m):
        # a column of round-off counts as empty: scaled, it would look independent
        empty = left[j] <= tolerance * tolerance * longest
        scale[j] = 0.0 if empty else 1.0 / np.sqrt(left[j])
        left[j] = 0.0 if empty else 1.0
    for i in range(n):
        for j in range(m):
            b[i, j] = matrix[i, j] * scale[j]
    rank = 0
    for k in range(min(min(n, m), most)):
        pivot = k + np.argmax(left[k:m])
        if left[pivot] < 1e-8:  # the updated lengths have lost their digits
            _lengths(b, k, left)
            pivot = k + np.argmax(left[k:m])
            if left[pivot] <= tolerance * tolerance:
                break
        if pivot != k:
            for i in range(n):
                b[i, k], b[i, pivot] = b[i, pivot], b[i, k]
            order[k], order[pivot] = order[pivot], order[k]
            scale[k], scale[pivot] = scale[pivot], scale[k]
            left[pivot] = left[k]
        rank += 1
        v, length = reflection[k], 0.0
        for i in range(k, n):
            v[i] = b[i, k]
            length += v[i] * v[i]
        length = np.sqrt(length)
        head = -length if v[k] > 0.0 else length
        beta[k] = (head - v[k]) / head
        divisor = 1.0 / (v[k] - head)
        v[k] = 1.0
        for i in range(k + 1, n):
            v[i] *= divisor
        _reflect(b, v, beta[k], k)
        b[k, k] = head
        for i in range(k + 1, n):
            b[i, k] = 0.0
        row = b[k]
        for j in range(width):
            left[j] -= row[j] * row[j]
    return Factor(b, reflection, beta, order, scale, rank)


@noinline
def shortest(f, r):
    """Return the shortest y with B^T y = r on the independent rows: (y of shape (n,), Q^T y, conflict).

    `conflict` is the defect of the dependent equations, scaled to unit length: zero when they agree.
    """
    n, m = len(f.beta), len(f.order)
    z = np.zeros(n)
    partial = np.zeros(m)  # R^T z, gathered row by row
    conflict = 0.0
    for k in range(m):
        right = f.scale[k] * r[f.order[k]]
        if k < f.rank:
            z[k] = (right - partial[k]) / f.upper[k, k]
            for j in range(k + 1, m):
                partial[j] += f.upper[k, j] * z[k]
        else:
            conflict = max(conflict, abs(right - partial[k]))
    y = z.copy()
    for k in range(f.rank - 1, -1, -1):
        total = y[k]
        for i in range(k + 1, n):
            total += f.reflection[k, i] * y[i]
        total *= f.beta[k]
        y[k] -= total
        for i in range(k + 1, n):
            y[i] -= total * f.reflection[k, i]
    return y, z, conflict


@kernel
def _back_substitute(f, x):
    """Solve R11 x = x in place, for one column (rank, c) or several."""
    for k in range(f.rank - 1, -1, -1):
        for c in range(x.shape[1]):
            x[k, c] /= f.upper[k, k]
        for i in range(k):
            for c in range(x.shape[1]):
                x[i, c] -= f.upper[i, k] * x[k, c]


@kernel
def _solve_positive(m, x):
    """Compute m^-1 x in place by Cholesky, m positive definite and overwritten."""
    n = len(x)
    for k in range(n):
        m[k, k] = np.sqrt(m[k, k])
        x[k] /= m[k, k]
        for i in range(k + 1, n):
            m[i, k] /= m[k, k]
            x[i] -= m[i, k] * x[k]
        for i in range(k + 1, n):
            for j in range(k + 1, i + 1):
                m[i, j] -= m[i, k] * m[j, k]
    for k in range(n - 1, -1, -1):
        x[k] /= m[k, k]
        for i in range(k):
            x[i] -= m[k, i] * x[k]


@noinline
def minimum_norm(f, z):
    """Return the shortest x of shape (m,) with B x = y, given z = Q^T y (theory, eq. (8.22))."""
    m = len(f.order)
    r, free = f.rank, m - f.rank
    # column 0: the basic solution; the others: minus the null space's upper part, R11^-1 R12
    work = np.empty((r, 1 + free))
    for k in range(r):
        work[k, 0] = z[k]
        for c in range(free):
            work[k, 1 + c] = f.upper[k, r + c]
    _back_substitute(f, work)
    for k in range(r):
        for c in range(1 + free):
            work[k, c] *= f.scale[k]
    gram, right = np.zeros((free, free)), np.zeros(free)
    for k in range(r):
        for c in range(free):
            right[c] += work[k, 1 + c] * work[k, 0]
            for e in range(free):
                gram[c, e] += work[k, 1 + c] * work[k, 1 + e]
    for c in range(free):
        gram[c, c] += f.scale[r + c] * f.scale[r + c] if f.scale[r + c] > 0.0 else 1.0
    _solve_positive(gram, right)
    x = np.zeros(m)
    for k in range(r):
        x[f.order[k]] = work[k, 0]
        for c in range(free):
            x[f.order[k]] -= work[k, 1 + c] * right[c]
    for c in range(free):
        x[f.order[r + c]] = f.scale[r + c] * right[c]
    return x


@kernel
def basic(f, y):
    """Return the x of shape (m,) with B x = y in the least-squares sense that is zero on all dependent columns."""
    n, m = len(f.beta), len(f.order)
    c = y.copy()
    for k in range(f.rank):
        total = c[k]
        for i in range(k + 1, n):
            total += f.reflection[k, i] * c[i]
        total *= f.beta[k]
        c[k] -= total
        for i in range(k + 1, n):
            c[i] -= total * f.reflection[k, i]
    x = np.zeros(m)
    upper = c[: f.rank].copy().reshape(-1, 1)
    _back_substitute(f, upper)
    for k in range(f.rank):
        x[f.order[k]] = f.scale[k] * upper[k, 0]
    return x
