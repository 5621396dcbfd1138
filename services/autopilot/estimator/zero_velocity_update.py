"""Zero-velocity update on the ground with motors off (theory.md, eq. (3.34))."""

from lapwing.dynamics.lie.quaternion import rotation_matrix
from lapwing.kernels import kernel
from lapwing.services.autopilot.estimator.filter_parameters import Estimator
from lapwing.services.autopilot.estimator.filter_state import GYRO, VELOCITY, State, corrected
from lapwing.services.autopilot.estimator.fuse import acceleration_row, clear, fuse

_VELOCITY_VARIANCE = 0.01 * 0.01  # [(m/s)^2] compliance of the feet
_OMEGA_VARIANCE = 1e-3 * 1e-3  # [(rad/s)^2]
_ACCELERATION_VARIANCE = 0.02 * 0.02  # [(m/s^2)^2]


@kernel
def update_standstill(p: Estimator, s: State, omega_variance: float, specific_force_variance: float) -> State:
    """Return the state after measurements of zero velocity, rate and acceleration.

    Args:
        p: `Estimator`.
        s: `State` after `predict` with a reading at rest; its arrays are changed in place.
        omega_variance: [(rad/s)^2] of that reading.
        specific_force_variance: [(m/s^2)^2] of that reading.
    """
    n, i, m = s.nominal, s.inertial, s.memory
    r = rotation_matrix(n.attitude)
    for axis in range(3):
        clear(m)
        m.row[VELOCITY + axis] = 1.0
        fuse(m, -n.velocity_world[axis], _VELOCITY_VARIANCE)
        clear(m)
        m.row[GYRO + axis] = 1.0
        fuse(m, i.omega[axis] - n.gyro_bias[axis], omega_variance + _OMEGA_VARIANCE)
        clear(m)
        acceleration_row(m, i.force_world, r, axis, 1.0)
        acceleration = i.force_world[axis] - (p.gravity if axis == 2 else 0.0)
        fuse(m, -acceleration, specific_force_variance + _ACCELERATION_VARIANCE)
    return corrected(s)
