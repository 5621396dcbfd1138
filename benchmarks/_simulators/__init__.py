"""Other simulators on Lapwing's problems; a simulator whose package is not installed is skipped.

A file for each has `NAME` and `MODULE` (the package whose version is printed), `methods(case)`: its methods on a
problem of the accuracy study, none if it cannot represent the problem, and `CASES`: for each case of `lapwing
stability` that it can run, a function that returns the error of each method by row.
"""

from collections.abc import Mapping
from types import ModuleType

import numpy as np

from lapwing.dynamics import discovery
from lapwing.studies.accuracy.coordinates import matrices
from lapwing.studies.accuracy.problem import SolverRun

Errors = Mapping[str, Mapping[str, float]]  # errors by row and method


def installed() -> list[ModuleType]:
    """Return the modules of the installed simulators; print the names of the others."""
    modules = []
    for name in discovery.names(__name__):
        try:
            modules.append(discovery.get(__name__, name, "simulator"))
        except ImportError as missing:
            print(f"{name}: skipped, {missing}")
    return modules


def outcome(
    duration: float, R_world_body: np.ndarray, omega_body: np.ndarray, evaluations: int | None = None
) -> SolverRun:
    """Return the result of a run from its end state only."""
    end = np.concatenate([np.ravel(R_world_body), omega_body])
    return SolverRun(np.array([0.0, duration]), np.array([end, end]), 0.0, evaluations)


def matrix(quaternion: np.ndarray) -> np.ndarray:
    """Return the rotation matrix, shape (3, 3), of a quaternion wxyz."""
    q = np.asarray(quaternion)
    return matrices(q[None] / np.linalg.norm(q)).reshape(3, 3)
