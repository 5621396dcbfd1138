"""SciPy's solve_ivp on quaternion and angular velocity, with a compiled right-hand side."""

from collections.abc import Callable
from typing import Any

import numba
import numpy as np
from scipy.integrate import solve_ivp

from benchmarks._simulators import matrix, outcome
from lapwing.studies.accuracy.problem import SolverMethod
from lapwing.studies.accuracy.systems import free_rigid_body, gyrostat, heavy_top

NAME, MODULE = "SciPy", "scipy"
METHODS = {"DOP853": 8, "Radau": 5}
CASES: dict[str, Any] = {}  # of the stability study
TOLERANCES = tuple(10.0**-k for k in range(1, 14))
# inertia, constant rotor momentum, arm times weight; start, end
PROBLEMS = {
    "free_rigid_body": (free_rigid_body.INERTIA, (0.0, 0.0, 0.0), 0.0, free_rigid_body),
    "heavy_top": (heavy_top.INERTIA, (0.0, 0.0, 0.0), heavy_top.ARM * heavy_top.MASS * heavy_top.GRAVITY, heavy_top),
    "gyrostat_steady": (gyrostat.STEADY.inertia, gyrostat.STEADY.rotor_momentum, 0.0, gyrostat),
}


@numba.njit(error_model="numpy")
def rate(t, s, inertia, h, moment):
    w, x, y, z, a, b, c = s
    la, lb, lc = inertia[0] * a + h[0], inertia[1] * b + h[1], inertia[2] * c + h[2]
    # weight at the end of an arm along body x: the torque is (0, u_z, -u_y) times the moment, u up in the body
    up_y, up_z = 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)
    return np.array([
        0.5 * (-x * a - y * b - z * c), 0.5 * (w * a + y * c - z * b),
        0.5 * (w * b + z * a - x * c), 0.5 * (w * c + x * b - y * a),
        (lb * c - lc * b) / inertia[0],
        (lc * a - la * c + moment * up_z) / inertia[1],
        (la * b - lb * a - moment * up_y) / inertia[2],
    ])  # fmt: skip


def methods(case: str) -> list[SolverMethod]:
    inertia, h, moment, module = PROBLEMS[case]
    start = np.array([*module.START.attitude, *module.START.omega_body])
    numbers = (np.array(inertia), np.array(h), moment)

    def solver_method(method: str) -> SolverMethod:
        def prepare(tolerance: float) -> Callable[[], Any]:
            keys = {"method": method, "rtol": max(tolerance, 3e-14), "atol": tolerance, "args": numbers}
            return lambda: solve_ivp(rate, (0.0, module.DURATION), start, **keys)

        def read(tolerance: float, result: Any) -> Any:
            end = result.y[:, -1]
            return outcome(module.DURATION, matrix(end[:4]), end[4:], result.nfev) if result.success else None

        return SolverMethod(f"SciPy {method}", METHODS[method], "tol", TOLERANCES, prepare, read, lambda: None)

    rate(0.0, start, *numbers)
    return [solver_method(method) for method in METHODS]
