"""Three-axis magnetometer (theory, section 3.2)."""

import math
from typing import Annotated, NamedTuple

from annotated_types import Ge, Gt, Le, Lt

from lapwing.dynamics.lie.quaternion import rotate_back
from lapwing.dynamics.noise import TURN_ON, Key, normal3
from lapwing.dynamics.vector import ZERO, Mat3, Vec3, add, apply, matmul, scale
from lapwing.kernels import always_inline, kernel
from lapwing.services.common.ports import MagnetometerReading
from lapwing.services.sensors import error_models
from lapwing.services.sensors.delay_line import BLANK, DEPTH, Fault, Line, apply_delay_and_faults, new_delay_line
from lapwing.services.sensors.sensor_inputs import Truth

CHANNELS = ("field",)
_NANO = 1e-9
Disturbance = Annotated[float, Ge(-1e5), Le(1e5)]


class Magnetometer(NamedTuple):
    """Parameters of a magnetometer; errors drawn once per vehicle are given as one standard deviation."""

    noise_nt_per_sqrt_hz: Annotated[float, Ge(0)] = 0.0  # [nT/sqrt(Hz)] one-sided density
    bias_instability_nt: Annotated[float, Ge(0)] = 0.0  # [nT] peak of the Allan deviation of the bias walk
    bias_correlation_time: Annotated[float, Gt(0)] = 500.0  # [s] correlation time of the bias walk
    hard_iron_nt: Annotated[float, Ge(0)] = 0.0  # [nT] residual after calibration
    scale_error: Annotated[float, Ge(0), Lt(1)] = 0.0  # ratio
    misalignment_deg: Annotated[float, Ge(0), Lt(45)] = 0.0  # [deg] standard deviation of an axis's direction
    soft_iron: Annotated[float, Ge(0), Lt(1)] = 0.0  # ratio, elements of the residual symmetric matrix
    range_ut: Annotated[float, Gt(0)] = math.inf  # [uT] largest measurable field
    resolution_nt: Annotated[float, Ge(0)] = 0.0  # [nT] step of a reading
    rate: Annotated[float, Gt(0)] = 50.0  # [Hz] readings a second
    instances: Annotated[int, Ge(1), Le(2)] = 1  # two: a redundant one, for a firmware; `faults` of the first
    latency_samples: Annotated[int, Ge(0), Lt(DEPTH)] = 0  # [samples] delay of a reading
    current_nt_per_a: tuple[Disturbance, Disturbance, Disturbance] = ZERO  # [nT/A] body, by the motors' total current
    faults: tuple[Fault, ...] | None = None  # compiled from the scene's schedule


class MagnetometerState(NamedTuple):
    """State of a magnetometer."""

    matrix: Mat3  # scale errors and misalignment
    hard_iron: Vec3  # [T]
    walk: Vec3  # [T]
    line: Line


READING = MagnetometerReading()


def blank() -> MagnetometerState:
    """Return a placeholder state, replaced at the first tick."""
    return MagnetometerState((0.0,) * 9, ZERO, ZERO, BLANK)


@always_inline
def _true_field(p: Magnetometer, truth: Truth) -> Vec3:
    """Return the field [T] of the Earth and of the motors' leads, body."""
    earth = rotate_back(truth.attitude, truth.environment.magnetic_field_world)
    return add(earth, scale(truth.rotors.current * _NANO, p.current_nt_per_a))


@always_inline
def soft_iron_matrix(deviation: float, along: Vec3, across: Vec3) -> Mat3:
    """Return the symmetric matrix by which magnetised material distorts the field (theory, eq. (3.51))."""
    x, y, z = scale(deviation, along)
    a, b, c = scale(deviation, across)
    return (1.0 + x, a, b, a, 1.0 + y, c, b, c, 1.0 + z)


@kernel
def initial(p: Magnetometer, key: Key, truth: Truth) -> MagnetometerState:
    """Return the state before the first sample."""
    matrix = error_models.scale_and_misalignment(
        p.scale_error, math.radians(p.misalignment_deg), normal3(key, TURN_ON, 0), normal3(key, TURN_ON, 1)
    )
    if p.soft_iron > 0.0:
        matrix = matmul(soft_iron_matrix(p.soft_iron, normal3(key, TURN_ON, 4), normal3(key, TURN_ON, 5)), matrix)
    hard_iron = scale(p.hard_iron_nt * _NANO, normal3(key, TURN_ON, 2))
    walk = scale(error_models.walk_deviation(p.bias_instability_nt * _NANO), normal3(key, TURN_ON, 3))
    true = _true_field(p, truth)
    return MagnetometerState(matrix, hard_iron, walk, new_delay_line(add(apply(matrix, true), add(hard_iron, walk))))


@kernel
def sample(
    p: Magnetometer, s: MagnetometerState, key: Key, tick: int, truth: Truth
) -> tuple[MagnetometerState, MagnetometerReading]:
    """Return the next state and the reading. See `imu.sample` for arguments."""
    deviation = error_models.walk_deviation(p.bias_instability_nt * _NANO)
    walk = error_models.walk(s.walk, deviation, p.bias_correlation_time, p.rate, normal3(key, tick, 0))
    noise = scale(error_models.white_deviation(p.noise_nt_per_sqrt_hz * _NANO, p.rate), normal3(key, tick, 1))
    true = _true_field(p, truth)
    measured = add(add(apply(s.matrix, true), add(s.hard_iron, walk)), noise)
    measured = error_models.digitise(measured, p.range_ut * 1e-6, p.resolution_nt * _NANO)
    line, field, valid = apply_delay_and_faults(p.faults, s.line, p.latency_samples, 0, key, tick, measured)
    variance = error_models.sample_variance(p.noise_nt_per_sqrt_hz * _NANO, p.resolution_nt * _NANO, p.rate)
    return MagnetometerState(s.matrix, s.hard_iron, walk, line), MagnetometerReading(field, variance, valid)


# PNI RM3100 user manual: 15 nT RMS and 13 nT per count at 200 cycle counts, +-800 uT; taken as the noise at 50 Hz.
# Instability and residuals after a good calibration far from the power leads: chosen.
RM3100 = Magnetometer(
    noise_nt_per_sqrt_hz=3.0,
    bias_instability_nt=5.0,
    hard_iron_nt=50.0,
    scale_error=1e-3,
    misalignment_deg=0.05,
    range_ut=800.0,
    resolution_nt=13.0,
)

# Honeywell HMC5883L data sheet: 0.2 uT noise floor, 0.073 uT per count in the +-88 uT range, 75 Hz at most. Instability
# and residuals after calibration: chosen.
HMC5883L = Magnetometer(
    noise_nt_per_sqrt_hz=40.0,
    bias_instability_nt=30.0,
    hard_iron_nt=300.0,
    scale_error=5e-3,
    misalignment_deg=0.5,
    range_ut=88.0,
    resolution_nt=73.0,
)

PRESETS = {"rm3100": RM3100, "hmc5883l": HMC5883L, "ideal": Magnetometer()}
