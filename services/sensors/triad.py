"""Errors of a triad of equal instruments, gyroscopes or accelerometers (theory, eq. (3.9))."""

from typing import Annotated, Any, NamedTuple

import numpy as np
from annotated_types import Ge, Gt, Le, Lt

from lapwing.dynamics.constants import STANDARD_GRAVITY
from lapwing.dynamics.noise import TURN_ON, Key, normal3
from lapwing.dynamics.vector import ZERO, Mat3, Vec3, add, apply, dot, matmul, scale
from lapwing.kernels import always_inline, kernel, math
from lapwing.services.sensors import error_models
from lapwing.services.sensors.delay_line import BLANK, Line, apply_delay_and_faults, new_delay_line
from lapwing.services.sensors.low_pass import REST, LowPass, LowPassState, state_at_rest, update

_DPS = math.radians(1.0)  # [rad/s] in one degree per second
MG = 1e-3 * STANDARD_GRAVITY  # [m/s^2] in one mg


class Gyro(NamedTuple):
    """Errors of the three gyroscopes; those aligned once per vehicle are given as one standard deviation."""

    noise_dps_per_sqrt_hz: Annotated[float, Ge(0)] = 0.0  # [deg/s/sqrt(Hz)] one-sided density
    bias_instability_deg_per_h: Annotated[float, Ge(0)] = 0.0  # [deg/h] peak of the Allan deviation of the bias walk
    bias_correlation_time: Annotated[float, Gt(0)] = 500.0  # [s] correlation time of the bias walk
    turn_on_bias_dps: Annotated[float, Ge(0)] = 0.0  # [deg/s] bias that differs from one start to the next
    temperature_dps_per_k: Annotated[float, Ge(0)] = 0.0  # [deg/s/K] residual after calibration
    scale_error: Annotated[float, Ge(0), Lt(1)] = 0.0  # ratio
    misalignment_deg: Annotated[float, Ge(0), Lt(45)] = 0.0  # [deg] standard deviation of an axis's direction
    range_dps: Annotated[float, Gt(0)] = math.inf  # [deg/s] largest measurable rate
    resolution_dps: Annotated[float, Ge(0)] = 0.0  # [deg/s] step of a reading


class Accelerometer(NamedTuple):
    """Errors of the three accelerometers; mg and ug are thousandths and millionths of 9.80665 m/s^2."""

    noise_mg_per_sqrt_hz: Annotated[float, Ge(0)] = 0.0  # [mg/sqrt(Hz)] one-sided density
    bias_instability_ug: Annotated[float, Ge(0)] = 0.0  # [ug] peak of the Allan deviation of the bias walk
    bias_correlation_time: Annotated[float, Gt(0)] = 500.0  # [s] correlation time of the bias walk
    turn_on_bias_mg: Annotated[float, Ge(0)] = 0.0  # [mg] bias that differs from one start to the next
    temperature_mg_per_k: Annotated[float, Ge(0)] = 0.0  # [mg/K] residual after calibration
    scale_error: Annotated[float, Ge(0), Lt(1)] = 0.0  # ratio
    misalignment_deg: Annotated[float, Ge(0), Lt(45)] = 0.0  # [deg] standard deviation of an axis's direction
    range_g: Annotated[float, Gt(0)] = math.inf  # [g] largest measurable specific force
    resolution_mg: Annotated[float, Ge(0)] = 0.0  # [mg] step of a reading


Coupling = Annotated[float, Ge(-10), Le(10)]
Rows = tuple[Coupling, Coupling, Coupling, Coupling, Coupling, Coupling, Coupling, Coupling, Coupling]
IDENTITY_ROWS: Rows = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
_SKEWED = 20  # lanes of the random non-orthogonality, above those of both triads


class CrossCoupling(NamedTuple):
    """Errors between axes and between instruments; standard deviations over units unless they are a matrix."""

    non_orthogonality_deg: Annotated[float, Ge(0), Lt(45)] = 0.0  # [deg] of each axis towards each other one
    gyro_matrix: Rows = IDENTITY_ROWS  # scale factors and cross-axis sensitivity of this unit, row by row
    accelerometer_matrix: Rows = IDENTITY_ROWS  # scale factors and cross-axis sensitivity, row by row
    g_sensitivity_dps_per_g: Annotated[float, Ge(0)] = 0.0  # [deg/s/g] each gyroscope to each axis of specific force
    gyro_rectification_dps_per_g2: Annotated[float, Ge(-1e3), Le(1e3)] = 0.0  # [deg/s/g^2] of the vibration's square
    rectification_mg_per_g2: Annotated[float, Ge(-1e5), Le(1e5)] = 0.0  # [mg/g^2] bias by the vibration's square


class Triad(NamedTuple):
    """State of a triad."""

    matrix: Mat3  # scale errors and misalignment
    turn_on_bias: Vec3  # bias, constant [rad/s or m/s^2]
    temperature: Vec3  # bias per kelvin
    walk: Vec3  # bias, wandering
    line: Line
    low_pass: LowPassState
    at_limit: Vec3  # remaining samples of each axis at its limit, with the limit's sign


BLANK_TRIAD = Triad((0.0,) * 9, ZERO, ZERO, ZERO, BLANK, REST, ZERO)


class Units(NamedTuple):
    """The errors of a triad in SI units."""

    noise: float
    instability: float
    bias_correlation_time: float
    turn_on_bias: float
    temperature: float
    scale_error: float
    misalignment: float
    range: float
    resolution: float


@always_inline
def gyro_units(g: Gyro) -> Units:
    """Return the errors of gyroscopes in SI units."""
    return Units(
        g.noise_dps_per_sqrt_hz * _DPS,
        g.bias_instability_deg_per_h * _DPS / 3600.0,
        g.bias_correlation_time,
        g.turn_on_bias_dps * _DPS,
        g.temperature_dps_per_k * _DPS,
        g.scale_error,
        g.misalignment_deg * _DPS,
        g.range_dps * _DPS,
        g.resolution_dps * _DPS,
    )


@always_inline
def accelerometer_units(a: Accelerometer) -> Units:
    """Return the errors of accelerometers in SI units."""
    return Units(
        a.noise_mg_per_sqrt_hz * MG,
        a.bias_instability_ug * 1e-3 * MG,
        a.bias_correlation_time,
        a.turn_on_bias_mg * MG,
        a.temperature_mg_per_k * MG,
        a.scale_error,
        a.misalignment_deg * _DPS,
        a.range_g * 1e3 * MG,
        a.resolution_mg * MG,
    )


@kernel
def skewed_matrix(c: CrossCoupling | None, key: Key, lane: int, aligned: Mat3) -> Mat3:
    """Return the matrix of a triad with its non-orthogonal axes (theory, eq. (3.50)); lane 0: gyroscopes."""
    if c is None:
        return aligned
    a, b, d = scale(math.radians(c.non_orthogonality_deg), normal3(key, TURN_ON, _SKEWED + lane))
    matrix = c.gyro_matrix if lane == 0 else c.accelerometer_matrix
    m = aligned
    skew = (m[0], m[1] + a, m[2] + b, m[3] + a, m[4], m[5] + d, m[6] + b, m[7] + d, m[8])
    return matmul(matrix, skew)


@kernel
def gyro_coupling_bias(c: CrossCoupling | None, key: Key, force: Vec3, square: Vec3) -> Vec3:
    """Return the bias of the gyroscopes [rad/s] by specific force [m/s^2] and by vibration, its mean square [g^2]."""
    if c is None:
        return ZERO
    k = c.g_sensitivity_dps_per_g * _DPS / STANDARD_GRAVITY
    x, y = normal3(key, TURN_ON, _SKEWED + 1), normal3(key, TURN_ON, _SKEWED + 2)
    z = normal3(key, TURN_ON, _SKEWED + 3)
    by_force = (k * dot(x, force), k * dot(y, force), k * dot(z, force))
    return add(by_force, scale(c.gyro_rectification_dps_per_g2 * _DPS, square))


@kernel
def rectification_bias(c: CrossCoupling | None, square: Vec3) -> Vec3:
    """Return the bias of the accelerometers [m/s^2] by vibration, its mean square [g^2]."""
    return ZERO if c is None else scale(c.rectification_mg_per_g2 * MG, square)


@kernel
def new_triad(u: Units, c: CrossCoupling | None, key: Key, lane: int, warm_up: float, value: Vec3) -> Triad:
    """Return the initial state at true value `value`, aligned from lanes `lane` to `lane` + 4 of a stream."""
    aligned = error_models.scale_and_misalignment(
        u.scale_error, u.misalignment, normal3(key, TURN_ON, lane), normal3(key, TURN_ON, lane + 1)
    )
    matrix = skewed_matrix(c, key, lane, aligned)
    turn_on_bias = scale(u.turn_on_bias, normal3(key, TURN_ON, lane + 2))
    temperature = scale(u.temperature, normal3(key, TURN_ON, lane + 3))
    walk = scale(error_models.walk_deviation(u.instability), normal3(key, TURN_ON, lane + 4))
    bias = add(add(turn_on_bias, walk), scale(-warm_up, temperature))
    return Triad(matrix, turn_on_bias, temperature, walk, new_delay_line(add(apply(matrix, value), bias)),
                 state_at_rest(add(apply(matrix, value), bias)), ZERO)  # fmt: skip


@kernel
def _filter(f: LowPass | None, s: LowPassState, rate: float, value: Vec3) -> tuple[LowPassState, Vec3]:
    """Return state and output of the internal filter; without one, the input."""
    if f is None:
        return s, value
    after = update(f, s, rate, value)
    return after, after.output


@always_inline
def _samples_at_limit(left: float, value: float, limit: float, samples: float) -> float:
    """Return the remaining samples of an axis at its limit, with the limit's sign."""
    if abs(value) > limit:
        return math.copysign(samples, value)
    return math.copysign(max(abs(left) - 1.0, 0.0), left)


@always_inline
def _saturated_output(left: float, measured: float, limit: float) -> float:
    """Return the output of an axis: its limit until the element has recovered."""
    return measured if left == 0.0 else math.copysign(limit, left)


@kernel
def measure(
    u: Units, t: Triad, p: Any, f: LowPass | None, warm_up: float, channel: int, key: Key, tick: int, value: Vec3,
    shift: Vec3, shake: Vec3,
) -> tuple[Triad, Vec3, bool]:  # fmt: skip
    """Return the next state, reading and validity of a triad (theory, eq. (3.9)).

    Args:
        u: errors in SI units.
        t: state.
        p: `Imu`.
        f: internal filter, or None.
        warm_up: [K] remaining warm-up.
        channel: 0 for gyroscopes, 1 for accelerometers.
        key: key of the instrument's random stream.
        tick: present tick.
        value: true value.
        shift: additional bias at this tick.
        shake: filtered vibration.
    """
    walk = error_models.walk(
        t.walk,
        error_models.walk_deviation(u.instability),
        u.bias_correlation_time,
        p.rate,
        normal3(key, tick, 2 * channel),
    )
    bias = add(add(add(t.turn_on_bias, walk), scale(-warm_up, t.temperature)), shift)
    noise = scale(error_models.white_deviation(u.noise, p.rate), normal3(key, tick, 2 * channel + 1))
    low_pass, analogue = _filter(f, t.low_pass, p.rate, add(add(apply(t.matrix, value), bias), noise))
    analogue = add(analogue, shake)
    measured = error_models.digitise(analogue, u.range, u.resolution)
    at_limit = t.at_limit
    if p.saturation_recovery > 0.0:
        samples = np.floor(p.saturation_recovery * p.rate + 0.5) + 1.0
        at_limit = (
            _samples_at_limit(at_limit[0], analogue[0], u.range, samples),
            _samples_at_limit(at_limit[1], analogue[1], u.range, samples),
            _samples_at_limit(at_limit[2], analogue[2], u.range, samples),
        )
        measured = (
            _saturated_output(at_limit[0], measured[0], u.range),
            _saturated_output(at_limit[1], measured[1], u.range),
            _saturated_output(at_limit[2], measured[2], u.range),
        )
    line, delayed, valid = apply_delay_and_faults(p.faults, t.line, p.latency_samples, channel, key, tick, measured)
    return Triad(t.matrix, t.turn_on_bias, t.temperature, walk, line, low_pass, at_limit), delayed, valid
