"""Inertial measurement unit: three gyroscopes and three accelerometers (theory.md, section 3.2)."""

import math
from typing import Annotated, NamedTuple

from annotated_types import Ge, Gt, Lt

from dynamics.kernel import kernel, leaf
from dynamics.lie.quaternion import rotate_back
from dynamics.noise import TURN_ON, Key, normal3
from dynamics.vector import ZERO, Mat3, Vec3, add, apply, scale
from services.common.ports import ImuReading
from services.sensors import errors
from services.sensors.line import BLANK, DEPTH, Fault, Line, carry, new_line
from services.sensors.truth import Truth

CHANNELS = ("gyro", "accelerometer")
_DPS = math.radians(1.0)  # [rad/s] in one degree per second
_MG = 1e-3 * errors.STANDARD_GRAVITY  # [m/s^2] in one mg


class Gyro(NamedTuple):
    """Errors of the three gyroscopes; what is drawn once per vehicle is given as one standard deviation."""

    noise_dps_per_sqrt_hz: Annotated[float, Ge(0)] = 0.0  # [deg/s/sqrt(Hz)] one-sided density
    bias_instability_deg_per_h: Annotated[float, Ge(0)] = 0.0  # [deg/h] peak of the Allan deviation of the bias walk
    bias_time: Annotated[float, Gt(0)] = 500.0  # [s] correlation time of the bias walk
    turn_on_dps: Annotated[float, Ge(0)] = 0.0  # [deg/s] bias that differs from one start to the next
    temperature_dps_per_k: Annotated[float, Ge(0)] = 0.0  # [deg/s/K] what calibration leaves
    scale_error: Annotated[float, Ge(0), Lt(1)] = 0.0  # ratio
    misalignment_deg: Annotated[float, Ge(0), Lt(45)] = 0.0  # [deg]
    range_dps: Annotated[float, Gt(0)] = math.inf  # [deg/s]
    resolution_dps: Annotated[float, Ge(0)] = 0.0  # [deg/s]


class Accelerometer(NamedTuple):
    """Errors of the three accelerometers; mg and ug are thousandths and millionths of 9.80665 m/s^2."""

    noise_mg_per_sqrt_hz: Annotated[float, Ge(0)] = 0.0  # [mg/sqrt(Hz)] one-sided density
    bias_instability_ug: Annotated[float, Ge(0)] = 0.0  # [ug] peak of the Allan deviation of the bias walk
    bias_time: Annotated[float, Gt(0)] = 500.0  # [s] correlation time of the bias walk
    turn_on_mg: Annotated[float, Ge(0)] = 0.0  # [mg] bias that differs from one start to the next
    temperature_mg_per_k: Annotated[float, Ge(0)] = 0.0  # [mg/K] what calibration leaves
    scale_error: Annotated[float, Ge(0), Lt(1)] = 0.0  # ratio
    misalignment_deg: Annotated[float, Ge(0), Lt(45)] = 0.0  # [deg]
    range_g: Annotated[float, Gt(0)] = math.inf  # [g]
    resolution_mg: Annotated[float, Ge(0)] = 0.0  # [mg]


class Imu(NamedTuple):
    """Parameters of an inertial measurement unit at the body's origin."""

    gyro: Gyro = Gyro()  # its gyroscopes
    accelerometer: Accelerometer = Accelerometer()  # its accelerometers
    rate: Annotated[float, Gt(0)] = 250.0  # [Hz]
    latency_samples: Annotated[int, Ge(0), Lt(DEPTH)] = 0  # samples that a reading is late
    warm_up: float = 0.0  # [K] still to come at the start, over the calibrated temperature
    warm_up_time: Annotated[float, Gt(0)] = 100.0  # [s]
    faults: tuple[Fault, ...] | None = None  # compiled from the scene's schedule


class Triad(NamedTuple):
    """State of three like instruments."""

    matrix: Mat3  # scale errors and misalignment
    turn_on: Vec3  # bias, constant [rad/s or m/s^2]
    temperature: Vec3  # bias per kelvin
    walk: Vec3  # bias, wandering
    line: Line


class ImuState(NamedTuple):
    """State of an IMU."""

    gyro: Triad
    accelerometer: Triad
    cold: float  # [K] of the warm-up still to come


class _Units(NamedTuple):
    """The errors of a triad in SI units."""

    noise: float
    instability: float
    bias_time: float
    turn_on: float
    temperature: float
    scale_error: float
    misalignment: float
    range: float
    resolution: float


def blank() -> ImuState:
    """A state without meaning, to be overwritten at the first tick."""
    triad = Triad((0.0,) * 9, ZERO, ZERO, ZERO, BLANK)
    return ImuState(triad, triad, 0.0)


@leaf
def _gyro_units(g: Gyro) -> _Units:
    return _Units(
        g.noise_dps_per_sqrt_hz * _DPS,
        g.bias_instability_deg_per_h * _DPS / 3600.0,
        g.bias_time,
        g.turn_on_dps * _DPS,
        g.temperature_dps_per_k * _DPS,
        g.scale_error,
        g.misalignment_deg * _DPS,
        g.range_dps * _DPS,
        g.resolution_dps * _DPS,
    )


@leaf
def _accelerometer_units(a: Accelerometer) -> _Units:
    return _Units(
        a.noise_mg_per_sqrt_hz * _MG,
        a.bias_instability_ug * 1e-3 * _MG,
        a.bias_time,
        a.turn_on_mg * _MG,
        a.temperature_mg_per_k * _MG,
        a.scale_error,
        a.misalignment_deg * _DPS,
        a.range_g * 1e3 * _MG,
        a.resolution_mg * _MG,
    )


@leaf
def _true_values(truth: Truth) -> tuple[Vec3, Vec3]:
    a = truth.acceleration_world
    return truth.omega_body, rotate_back(truth.attitude, (a[0], a[1], a[2] + truth.gravity))


@kernel
def _new_triad(u: _Units, key: Key, lane: int, cold: float, value: Vec3) -> Triad:
    matrix = errors.scale_and_misalignment(
        u.scale_error, u.misalignment, normal3(key, TURN_ON, lane), normal3(key, TURN_ON, lane + 1)
    )
    turn_on = scale(u.turn_on, normal3(key, TURN_ON, lane + 2))
    temperature = scale(u.temperature, normal3(key, TURN_ON, lane + 3))
    walk = scale(errors.walk_deviation(u.instability), normal3(key, TURN_ON, lane + 4))
    bias = add(add(turn_on, walk), scale(-cold, temperature))
    return Triad(matrix, turn_on, temperature, walk, new_line(add(apply(matrix, value), bias)))


@kernel
def initial(p: Imu, key: Key, truth: Truth) -> ImuState:
    """State before the first sample: what differs from unit to unit and from start to start is drawn here."""
    omega, force = _true_values(truth)
    return ImuState(
        _new_triad(_gyro_units(p.gyro), key, 0, p.warm_up, omega),
        _new_triad(_accelerometer_units(p.accelerometer), key, 8, p.warm_up, force),
        p.warm_up,
    )


@kernel
def _measure(
    u: _Units, t: Triad, p: Imu, cold: float, channel: int, key: Key, tick: int, value: Vec3
) -> tuple[Triad, Vec3, bool]:
    """One triad's reading: theory.md, eq. (3.9)."""
    walk = errors.walk(
        t.walk, errors.walk_deviation(u.instability), u.bias_time, p.rate, normal3(key, tick, 2 * channel)
    )
    bias = add(add(t.turn_on, walk), scale(-cold, t.temperature))
    noise = scale(errors.white_deviation(u.noise, p.rate), normal3(key, tick, 2 * channel + 1))
    measured = errors.digitise(add(add(apply(t.matrix, value), bias), noise), u.range, u.resolution)
    line, arrived, valid = carry(p.faults, t.line, p.latency_samples, channel, key, tick, measured)
    return Triad(t.matrix, t.turn_on, t.temperature, walk, line), arrived, valid


@kernel
def sample(p: Imu, s: ImuState, key: Key, tick: int, truth: Truth) -> tuple[ImuState, ImuReading]:
    """Next state and reading.

    Args:
        p: `Imu`.
        s: `ImuState`.
        key: of this instrument's random stream (`dynamics.noise.stream_key`).
        tick: integer, different for every sample.
        truth: `Truth` at this tick.
    """
    omega, force = _true_values(truth)
    cold = s.cold * (1.0 - 1.0 / (p.rate * p.warm_up_time))
    g, a = _gyro_units(p.gyro), _accelerometer_units(p.accelerometer)
    gyro, omega, gyro_valid = _measure(g, s.gyro, p, cold, 0, key, tick, omega)
    accelerometer, force, force_valid = _measure(a, s.accelerometer, p, cold, 1, key, tick, force)
    omega_variance = errors.sample_variance(g.noise, g.resolution, p.rate)
    force_variance = errors.sample_variance(a.noise, a.resolution, p.rate)
    reading = ImuReading(omega, force, omega_variance, force_variance, gyro_valid and force_valid)
    return ImuState(gyro, accelerometer, cold), reading


# InvenSense PS-MPU-6000A: ranges and resolutions (500 deg/s and 8 g settings), temperature within 10 % of the raw drift
# that calibration leaves. Noise 0.30 deg/sqrt(h), 4.6 deg/h, 0.24 mg/sqrt(Hz), 36 ug: measured Allan curves. What
# calibration leaves of bias, scale and alignment: chosen.
MPU6000 = Imu(
    Gyro(
        noise_dps_per_sqrt_hz=errors.density_of_random_walk(0.30),
        bias_instability_deg_per_h=4.6,
        turn_on_dps=0.1,
        temperature_dps_per_k=0.008,
        scale_error=1e-3,
        misalignment_deg=0.05,
        range_dps=500.0,
        resolution_dps=500.0 / 2**15,
    ),
    Accelerometer(
        noise_mg_per_sqrt_hz=0.24,
        bias_instability_ug=36.0,
        turn_on_mg=3.0,
        temperature_mg_per_k=0.05,
        scale_error=1e-3,
        misalignment_deg=0.05,
        range_g=8.0,
        resolution_mg=8000.0 / 2**15,
    ),
    warm_up=5.0,
)

# Bosch BST-BMI088-DS001: accelerometer 0.175 mg/sqrt(Hz) (160 in x and y, 190 in z), 0.2 mg/K and 0.015 deg/s/K before
# calibration, of which a tenth is left. Gyroscope 0.016 deg/s/sqrt(Hz), 6.5 deg/h: measured Allan curves. Accelerometer
# instability and what calibration leaves: chosen.
BMI088 = Imu(
    Gyro(
        noise_dps_per_sqrt_hz=0.016,
        bias_instability_deg_per_h=6.5,
        turn_on_dps=0.05,
        temperature_dps_per_k=0.0015,
        scale_error=1e-3,
        misalignment_deg=0.05,
        range_dps=500.0,
        resolution_dps=500.0 / 2**15,
    ),
    Accelerometer(
        noise_mg_per_sqrt_hz=0.175,
        bias_instability_ug=30.0,
        turn_on_mg=2.0,
        temperature_mg_per_k=0.02,
        scale_error=1e-3,
        misalignment_deg=0.05,
        range_g=12.0,
        resolution_mg=12000.0 / 2**15,
    ),
    warm_up=5.0,
)

PRESETS = {"mpu6000": MPU6000, "bmi088": BMI088, "ideal": Imu()}
