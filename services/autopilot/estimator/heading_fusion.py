"""Fusion of the magnetometer's heading (theory, eqs. (3.33) and (3.63))."""

from lapwing.dynamics.lie.quaternion import rotation_matrix
from lapwing.dynamics.vector import ZERO, Vec3, apply, cross, subtract
from lapwing.kernels import kernel, math
from lapwing.services.autopilot.estimator.covariance_inflation import inflate_covariance
from lapwing.services.autopilot.estimator.filter_parameters import Estimator
from lapwing.services.autopilot.estimator.filter_state import (
    HEADING,
    IRON,
    MAG,
    MAG_ALIGNMENT,
    MAG_SCALE,
    ROW,
    THETA,
    State,
    apply_correction,
    three,
)
from lapwing.services.autopilot.estimator.fuse import clear, fuse, innovation_variance
from lapwing.services.autopilot.estimator.measurement_checks import is_stuck, record_gate_result


@kernel
def update_magnetometer(p: Estimator, s: State, field_body: Vec3, variance: float, valid: bool) -> State:
    """Return the state after a magnetometer reading; only its horizontal direction is used.

    Args:
        p: `Estimator`.
        s: `State`; its arrays are changed in place.
        field_body: [T].
        variance: [T^2] per axis.
        valid: False without a reading.
    """
    m = s.memory
    if not valid or is_stuck(m, MAG, field_body, ZERO, variance > 0.0, p.frozen):
        record_gate_result(m, MAG, False, 0.0)
        return s
    bx, by, bz = p.magnetic_field_world
    horizontal = bx * bx + by * by
    r = rotation_matrix(s.nominal.attitude)
    field = subtract(field_body, s.nominal.magnetometer_bias)
    fx, fy, _ = apply(r, field)
    turn = math.atan2(fx * by - fy * bx, fx * bx + fy * by)  # from the measured to the true field
    clear(m)
    m.row[THETA] = -bz * bx / horizontal
    m.row[THETA + 1] = -bz * by / horizontal
    m.row[THETA + 2] = 1.0
    for i in range(3):
        m.row[IRON + i] = (by * r[i] - bx * r[3 + i]) / horizontal
        m.considered[ROW, MAG_SCALE + i] = m.row[IRON + i] * field[i]
    iron = three(m.row, IRON)
    by_iron = cross(field, iron)  # (a x field) . iron = a . (field x iron)
    m.considered[ROW, MAG_ALIGNMENT] = by_iron[0]
    m.considered[ROW, MAG_ALIGNMENT + 1] = by_iron[1]
    m.row[HEADING] = -by_iron[2]
    innovation = turn + by_iron[2] * s.nominal.heading_bias
    nis = innovation * innovation / innovation_variance(m, variance / horizontal)
    accepted = nis < p.gate * p.gate
    if accepted:
        fuse(m, innovation, variance / horizontal)
    record_gate_result(m, MAG, accepted, nis)
    if not accepted:
        inflate_covariance(p, m, MAG)
    return apply_correction(s)
