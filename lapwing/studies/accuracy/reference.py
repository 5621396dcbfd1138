"""References independent of the integrators: SciPy's DOP853 on attitudes as matrices."""

from collections.abc import Callable

import numpy as np
from scipy.integrate import solve_ivp

TOLERANCE = 1e-13
DOP853 = f"SciPy DOP853 at {TOLERANCE:g} on rotation matrices, independent equations"


def dop853(rate: Callable[[float, np.ndarray], np.ndarray], start: np.ndarray, duration: float) -> np.ndarray:
    """Return the final coordinates of y' = rate(t, y) from `start` after a duration.

    Raises:
        ValueError: the integration fails.
    """
    result = solve_ivp(rate, (0.0, duration), start, method="DOP853", rtol=TOLERANCE, atol=0.1 * TOLERANCE)
    if not result.success:
        raise ValueError(f"reference: {result.message}")
    return result.y[:, -1]


def attitude_rate(R: np.ndarray, omega_body: np.ndarray) -> np.ndarray:
    """Return R' = R hat(omega) of a row-major matrix, shape (9,)."""
    x, y, z = omega_body
    return (R.reshape(3, 3) @ np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])).ravel()


def to_world(R: np.ndarray, v_body: np.ndarray) -> np.ndarray:
    """Return body vectors in the world, shape (k, 3), for matrices (k, 9) and vectors (k, 3)."""
    return np.einsum("kij,kj->ki", R.reshape(-1, 3, 3), v_body)
