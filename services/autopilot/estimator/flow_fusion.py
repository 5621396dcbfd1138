"""Fusion of optical flow as a replacement of GPS velocity (theory, eq. (3.45))."""

from lapwing.dynamics.lie.quaternion import rotation_matrix
from lapwing.dynamics.vector import Mat3, Vec3, cross, dot
from lapwing.kernels import always_inline, kernel, math
from lapwing.services.autopilot.estimator.filter_parameters import Estimator
from lapwing.services.autopilot.estimator.filter_state import (
    FLOW,
    GPS_VELOCITY,
    NEVER,
    THETA,
    VELOCITY,
    Memory,
    State,
    apply_correction,
)
from lapwing.services.autopilot.estimator.fuse import clear, fuse, innovation_variance
from lapwing.services.autopilot.estimator.measurement_checks import is_stuck, record_gate_result

_CORRELATED = 100.0  # readings (2 s) over which the scale error is correlated


@always_inline
def flow_row(m: Memory, r: Mat3, velocity_world: Vec3, axis: int, distance: float) -> float:
    """Fill the row of the flow about body x (axis 0) or y (1). Return the expected flow [rad/s]."""
    k = 1.0 / distance if axis == 0 else -1.0 / distance
    across = (r[1], r[4], r[7]) if axis == 0 else (r[0], r[3], r[6])  # body y, body x: direction of the ground's motion
    attitude_effect = cross(across, velocity_world)
    clear(m)
    for j in range(3):
        m.row[VELOCITY + j] = k * across[j]
        m.row[THETA + j] = k * attitude_effect[j]
    return k * dot(across, velocity_world)


@kernel
def update_flow(
    p: Estimator,
    s: State,
    flow: tuple[float, float],
    rate: tuple[float, float],
    distance: float,
    variance: float,
    valid: bool,
) -> State:
    """Return the state after an optical flow reading, unchanged while GPS velocities are accepted.

    Args:
        p: `Estimator`.
        s: `State`; its arrays are changed in place.
        flow: [rad/s] about body x and y.
        rate: [rad/s] of the camera about body x and y.
        distance: [m] to the ground along body -z.
        variance: [(rad/s)^2] per axis.
        valid: False without a reading.
    """
    m = s.memory
    readings, rotation = (flow[0], flow[1], distance), (rate[0], rate[1], 0.0)
    if not valid or not distance > 0.0 or is_stuck(m, FLOW, readings, rotation, variance > 0.0, p.frozen):
        record_gate_result(m, FLOW, False, 0.0)
        return s
    gps_accepted = m.rejected[GPS_VELOCITY] == 0 and m.since[GPS_VELOCITY] != NEVER
    if gps_accepted and m.since[GPS_VELOCITY] * p.interval <= p.patience:
        m.rejected[FLOW] = 0
        return s
    r, velocity = rotation_matrix(s.nominal.attitude), s.nominal.velocity_world
    passing = (flow[0] - rate[0], flow[1] - rate[1])
    expected = math.hypot(flow_row(m, r, velocity, 0, distance), flow_row(m, r, velocity, 1, distance))
    # the scale error is that of the expected flow, to keep the gate effective
    noise = variance + _CORRELATED * math.square(p.flow_scale_std * expected)
    nis, accepted = 0.0, True
    for axis in range(2):
        innovation = passing[axis] - flow_row(m, r, velocity, axis, distance)
        ratio = innovation * innovation / innovation_variance(m, noise)
        nis += ratio
        accepted = accepted and ratio < p.gate * p.gate
    if accepted:
        for axis in range(2):
            fuse(m, passing[axis] - flow_row(m, r, velocity, axis, distance), noise)
    record_gate_result(m, FLOW, accepted, nis)
    return apply_correction(s)
