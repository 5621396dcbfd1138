"""Fusion of sonar near the ground and barometer (theory, eqs. (3.31), (3.32), (3.71) and (3.67))."""

from lapwing.dynamics.atmosphere import pressure_altitude
from lapwing.dynamics.geodesy import height_above_home
from lapwing.dynamics.lie.quaternion import rotation_matrix
from lapwing.dynamics.vector import ZERO
from lapwing.kernels import kernel, math
from lapwing.services.autopilot.estimator.covariance_inflation import inflate_covariance
from lapwing.services.autopilot.estimator.filter_parameters import NO_STATIC_PRESSURE_ERROR, Estimator
from lapwing.services.autopilot.estimator.filter_state import (
    BARO,
    BAROMETER,
    POSITION,
    SCALE,
    SONAR,
    State,
    apply_correction,
)
from lapwing.services.autopilot.estimator.fuse import clear, fuse, innovation_variance
from lapwing.services.autopilot.estimator.measurement_checks import is_stuck, record_gate_result
from lapwing.services.autopilot.estimator.static_pressure import static_pressure_height

_GROUND_GRADIENT, _GROUND_RATE = 0.5, 0.5  # m/m, [m/s] variation of the ground under the vehicle


@kernel
def _scalar(p: Estimator, s: State, source: int, innovation: float, variance: float) -> State:
    """Gate and fuse the measurement of the row."""
    m = s.memory
    nis = innovation * innovation / innovation_variance(m, variance)
    accepted = nis < p.gate * p.gate
    if accepted:
        fuse(m, innovation, variance)
    record_gate_result(m, source, accepted, nis)
    if not accepted:
        inflate_covariance(p, m, source)
    return apply_correction(s)


@kernel
def update_barometer(p: Estimator, s: State, pressure: float, variance: float, valid: bool) -> State:
    """Return the state after a pressure reading.

    Args:
        p: `Estimator`.
        s: `State`; its arrays are changed in place.
        pressure: [Pa].
        variance: [Pa^2].
        valid: False without a reading.
    """
    m = s.memory
    if not valid or not pressure > 0.0 or is_stuck(m, BARO, (pressure, 0.0, 0.0), ZERO, variance > 0.0, p.frozen):
        record_gate_result(m, BARO, False, 0.0)
        return s
    altitude = pressure_altitude(p.atmosphere, pressure) - p.home.height
    slope = pressure_altitude(p.atmosphere, pressure + 1.0) - p.home.height - altitude  # [m/Pa]
    clear(m)
    m.row[POSITION + 2] = 1.0
    m.row[BAROMETER] = 1.0
    innovation = altitude - height_above_home(p.home, s.nominal.position_world) - s.nominal.barometer_bias
    if p.static_pressure_error != NO_STATIC_PRESSURE_ERROR:
        innovation -= static_pressure_height(p, s)
    return _scalar(p, s, BARO, innovation, variance * slope * slope)


@kernel
def update_sonar(p: Estimator, s: State, distance: float, variance: float, valid: bool) -> State:
    """Return the state after a sonar reading.

    Args:
        p: `Estimator`.
        s: `State`; its arrays are changed in place.
        distance: [m]; infinite without an echo, which is no fault.
        variance: [m^2].
        valid: False without a reading.
    """
    m = s.memory
    if not valid:
        record_gate_result(m, SONAR, False, 0.0)
        return s
    height = s.nominal.position_world[2] - p.ground_height
    if math.isinf(distance) or height > p.sonar_height_max:
        m.rejected[SONAR] = 0
        m.since[SONAR] = 0
        return s
    cosine = rotation_matrix(s.nominal.attitude)[8]
    tilt = math.acos(min(max(cosine, -1.0), 1.0))
    slant = 1.0 / math.cos(max(0.0, tilt - math.radians(p.sonar_half_beam_deg)))
    clear(m)
    factor = slant * (1.0 + s.nominal.sonar_scale)
    m.row[POSITION + 2] = factor
    m.row[SCALE] = slant * height
    return _scalar(p, s, SONAR, distance - factor * height, variance)


@kernel
def follow_ground(p: Estimator, s: State) -> None:
    """Add the ground's variation since the last echo to the covariance of the height above ground.

    The barometer's bias gets the opposite change, so that its level is unaffected (theory, eq. (3.71)).

    Args:
        p: `Estimator`.
        s: `State`; its arrays are changed in place.
    """
    c = s.memory.covariance
    vx, vy, _ = s.nominal.velocity_world
    dt = max(s.memory.since[SONAR], 1) * p.interval
    variance = (_GROUND_GRADIENT * _GROUND_GRADIENT * (vx * vx + vy * vy) + _GROUND_RATE * _GROUND_RATE) * dt * dt
    z = POSITION + 2
    c[z, z] += variance
    c[BAROMETER, BAROMETER] += variance
    c[z, BAROMETER] -= variance
    c[BAROMETER, z] -= variance
