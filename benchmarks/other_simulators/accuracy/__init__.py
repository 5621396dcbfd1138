"""Other simulators on problems of the accuracy study.

A file has `NAME`, `MODULE` (the package whose version is printed) and `methods(case)`, which returns its methods on a
problem, none if it cannot represent the problem.
"""

import numpy as np

from lapwing.studies.accuracy.coordinates import matrices
from lapwing.studies.accuracy.problem import SolverRun


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
