"""Other programs that do the same work: one file each, found by scanning this folder.

A file has `NAME`, `MODULE`, the package whose version is stated, and `ways(case)`, its methods on a problem of the
accuracy study (none where it cannot express it). Where its package is not installed, importing it fails, and it is
left out.
"""

from types import ModuleType

import numpy as np

from lapwing.dynamics import discovery
from lapwing.studies.accuracy.coordinates import matrices
from lapwing.studies.accuracy.problem import SolverRun


def installed() -> list[ModuleType]:
    """The other simulators whose package is there; says which are not."""
    found = []
    for name in discovery.names(__name__):
        try:
            found.append(discovery.get(__name__, name, "simulator"))
        except ImportError as missing:
            print(f"{name}: left out, {missing}")
    return found


def outcome(
    duration: float, R_world_body: np.ndarray, omega_body: np.ndarray, evaluations: int | None = None
) -> SolverRun:
    """The outcome of a run of which only the end is known."""
    end = np.concatenate([np.ravel(R_world_body), omega_body])
    return SolverRun(np.array([0.0, duration]), np.array([end, end]), 0.0, evaluations)


def matrix(quaternion: np.ndarray) -> np.ndarray:
    """Rotation matrix, shape (3, 3), of a quaternion wxyz."""
    q = np.asarray(quaternion)
    return matrices(q[None] / np.linalg.norm(q)).reshape(3, 3)
