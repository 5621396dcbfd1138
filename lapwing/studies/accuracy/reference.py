"""References that share nothing with the integrators: SciPy's DOP853 on attitudes as nine numbers."""

from collections.abc import Callable

import numpy as np
from scipy.integrate import solve_ivp

TOLERANCE = 1e-13
DOP853 = f"SciPy DOP853 at {TOLERANCE:g} on rotation matrices, equations written apart"


def dop853(rate: Callable[[float, np.ndarray], np.ndarray], start: np.ndarray, duration: float) -> np.ndarray:
    """Return the coordinates at the end of a run whose coordinates change by `rate(t, y)`."""
    result = solve_ivp(rate, (0.0, duration), start, method="DOP853", rtol=TOLERANCE, atol=0.1 * TOLERANCE)
    if not result.success:
        raise ValueError(f"reference: {result.message}")
    return result.y[:, -1]


def attitude_rate(R: np.ndarray, omega_body: np.ndarray) -> np.ndarray:
    """Return R' = R hat(omega) of a matrix in row order, shape (9,)."""
    x, y, z = omega_body
    return (R.reshape(3, 3) @ np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])).ravel()


def to_world(R: np.ndarray, v_body: np.ndarray) -> np.ndarray:
    """Rotate body vectors into the world, shapes (k, 9) and (k, 3)."""
    return np.einsum("kij,kj->ki", R.reshape(-1, 3, 3), v_body)
