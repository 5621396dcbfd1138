"""Zero-velocity update on the ground with motors off (theory, eq. (3.34))."""

from lapwing.dynamics.lie.quaternion import rotation_matrix
from lapwing.kernels import kernel, math
from lapwing.services.autopilot.estimator.filter_parameters import Estimator
from lapwing.services.autopilot.estimator.filter_state import GYRO, HISTORY, VELOCITY, State, apply_correction
from lapwing.services.autopilot.estimator.fuse import acceleration_row, clear, fuse

_ARM = 0.7  # [m] from the feet to the instruments while the vehicle rocks on them
_VIBRATION_READINGS = 64  # readings for the variance of the vibration at rest
_GROWTH = 20.0  # [intervals] in which motion between the readings changes the estimated velocity


@kernel
def shake_variance(p: Estimator, s: State, axis: int, specific_force_variance: float) -> float:
    """Return the variance of the acceleration [(m/s^2)^2] along a world axis while wind shakes the vehicle on its feet.

    Args:
        p: `Estimator`.
        s: `State` after `predict`.
        axis: 0 to 2.
        specific_force_variance: [(m/s^2)^2] of the readings' white noise, which is not part of the result.
    """
    tick, h = s.inertial.tick, s.memory.history
    count = min(tick - 1, _VIBRATION_READINGS, HISTORY - 2)
    if count < 2:
        return 0.0
    total, squares = 0.0, 0.0
    for k in range(count):
        gain = h[(tick - k) % HISTORY, axis] - h[(tick - k - 1) % HISTORY, axis]
        total += gain
        squares += gain * gain
    variance = (squares - total * total / count) / ((count - 1) * math.square(p.interval))
    # a gain is the mean of two readings, which halves the variance of white noise
    return max(2.0 * variance - specific_force_variance, 0.0)


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
    r, dt = rotation_matrix(n.attitude), p.interval
    shake = (
        shake_variance(p, s, 0, specific_force_variance),
        shake_variance(p, s, 1, specific_force_variance),
        shake_variance(p, s, 2, specific_force_variance),
    )
    rocking = 0.5 * (shake[0] + shake[1]) * math.square(dt / _ARM)
    for axis in range(3):
        clear(m)
        m.row[VELOCITY + axis] = 1.0
        fuse(m, -n.velocity_world[axis], _GROWTH * shake[axis] * (dt * dt))
        clear(m)
        m.row[GYRO + axis] = 1.0
        fuse(m, i.omega[axis] - n.gyro_bias[axis], omega_variance + (0.0 if axis == 2 else rocking))
        clear(m)
        acceleration_row(m, i.force_world, r, axis, 1.0)
        acceleration = i.force_world[axis] - (p.gravity if axis == 2 else 0.0)
        fuse(m, -acceleration, specific_force_variance + shake[axis])
    return apply_correction(s)
