"""Three like instruments, gyroscopes or accelerometers: what they add to the true value (theory.md, eq. (3.9))."""

import math
from typing import Annotated, Any, NamedTuple

from annotated_types import Ge, Gt, Lt

from lapwing.dynamics.noise import TURN_ON, Key, normal3
from lapwing.dynamics.vector import ZERO, Mat3, Vec3, add, apply, scale
from lapwing.kernels import always_inline, kernel
from lapwing.services.sensors import error_models
from lapwing.services.sensors.delay_line import BLANK, Line, carry, new_line

_DPS = math.radians(1.0)  # [rad/s] in one degree per second
MG = 1e-3 * error_models.STANDARD_GRAVITY  # [m/s^2] in one mg


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


class Triad(NamedTuple):
    """State of three like instruments."""

    matrix: Mat3  # scale errors and misalignment
    turn_on: Vec3  # bias, constant [rad/s or m/s^2]
    temperature: Vec3  # bias per kelvin
    walk: Vec3  # bias, wandering
    line: Line


BLANK_TRIAD = Triad((0.0,) * 9, ZERO, ZERO, ZERO, BLANK)


class Units(NamedTuple):
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


@always_inline
def gyro_units(g: Gyro) -> Units:
    """The errors of gyroscopes in SI units."""
    return Units(
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


@always_inline
def accelerometer_units(a: Accelerometer) -> Units:
    """The errors of accelerometers in SI units."""
    return Units(
        a.noise_mg_per_sqrt_hz * MG,
        a.bias_instability_ug * 1e-3 * MG,
        a.bias_time,
        a.turn_on_mg * MG,
        a.temperature_mg_per_k * MG,
        a.scale_error,
        a.misalignment_deg * _DPS,
        a.range_g * 1e3 * MG,
        a.resolution_mg * MG,
    )


@kernel
def new_triad(u: Units, key: Key, lane: int, cold: float, value: Vec3) -> Triad:
    """The state at the start, drawn from lanes `lane` to `lane` + 4 of a stream, where the true value is `value`."""
    matrix = error_models.scale_and_misalignment(
        u.scale_error, u.misalignment, normal3(key, TURN_ON, lane), normal3(key, TURN_ON, lane + 1)
    )
    turn_on = scale(u.turn_on, normal3(key, TURN_ON, lane + 2))
    temperature = scale(u.temperature, normal3(key, TURN_ON, lane + 3))
    walk = scale(error_models.walk_deviation(u.instability), normal3(key, TURN_ON, lane + 4))
    bias = add(add(turn_on, walk), scale(-cold, temperature))
    return Triad(matrix, turn_on, temperature, walk, new_line(add(apply(matrix, value), bias)))


@kernel
def measure(
    u: Units, t: Triad, p: Any, cold: float, channel: int, key: Key, tick: int, value: Vec3
) -> tuple[Triad, Vec3, bool]:
    """One triad's reading: theory.md, eq. (3.9)."""
    walk = error_models.walk(
        t.walk, error_models.walk_deviation(u.instability), u.bias_time, p.rate, normal3(key, tick, 2 * channel)
    )
    bias = add(add(t.turn_on, walk), scale(-cold, t.temperature))
    noise = scale(error_models.white_deviation(u.noise, p.rate), normal3(key, tick, 2 * channel + 1))
    measured = error_models.digitise(add(add(apply(t.matrix, value), bias), noise), u.range, u.resolution)
    line, arrived, valid = carry(p.faults, t.line, p.latency_samples, channel, key, tick, measured)
    return Triad(t.matrix, t.turn_on, t.temperature, walk, line), arrived, valid
