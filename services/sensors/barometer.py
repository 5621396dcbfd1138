"""Static-pressure sensor (theory, section 3.2)."""

import math
from typing import Annotated, NamedTuple

from annotated_types import Ge, Gt, Le, Lt

from lapwing.dynamics.atmosphere import pressure, share_of_squares
from lapwing.dynamics.geodesy import height_above_home
from lapwing.dynamics.lie.quaternion import rotate_back
from lapwing.dynamics.noise import TURN_ON, Key, normal, normal3
from lapwing.dynamics.vector import ZERO, Vec3
from lapwing.kernels import always_inline, kernel
from lapwing.services.common.ports import BarometerReading
from lapwing.services.sensors import error_models
from lapwing.services.sensors.delay_line import BLANK, DEPTH, Fault, Line, apply_delay_and_faults, new_delay_line
from lapwing.services.sensors.sensor_inputs import Truth

CHANNELS = ("pressure",)


Share = Annotated[float, Ge(-2), Le(2)]  # of the dynamic pressure


# Horizontal: a quadrotor in flight, barometer against satellite heights (PX4-Autopilot, pull request 19507, 2022,
# EKF2_PCOEF_XP, XN, YP and YN). Vertical: chosen.
class StaticPressureError(NamedTuple):
    """Static pressure position error: share of the dynamic pressure by direction of flight through the air."""

    forward: Share = -0.314  # along the body's x axis; below 0 the barometric height rises
    backward: Share = -0.284  # against the x axis
    right: Share = -0.753  # against the body's y axis
    left: Share = -0.598  # along the y axis
    vertical: Share = 0.0  # along the body's z axis, up and down


class Barometer(NamedTuple):
    """Parameters of a barometer."""

    noise_pa_per_sqrt_hz: Annotated[float, Ge(0)] = 0.0  # [Pa/sqrt(Hz)] one-sided density
    bias_instability_pa: Annotated[float, Ge(0)] = 0.0  # [Pa] peak of the Allan deviation of the bias walk (weather)
    bias_correlation_time: Annotated[float, Gt(0)] = 1000.0  # [s] correlation time of the bias walk
    turn_on_bias_pa: Annotated[float, Ge(0)] = 0.0  # [Pa] one standard deviation
    scale_error: Annotated[float, Ge(0), Lt(1)] = 0.0  # ratio, one standard deviation
    range_pa: Annotated[float, Gt(0)] = math.inf  # [Pa] largest measurable pressure
    resolution_pa: Annotated[float, Ge(0)] = 0.0  # [Pa] step of a reading
    rate: Annotated[float, Gt(0)] = 50.0  # [Hz] readings a second
    latency_samples: Annotated[int, Ge(0), Lt(DEPTH)] = 0  # [samples] delay of a reading
    static_pressure_error: StaticPressureError | None = None  # by wind and own motion; default: none
    wash_pa_per_n: Annotated[float, Ge(-10), Le(10)] = 0.0  # [Pa/N] pressure change over the rotors' thrust
    temperature_pa_per_k: Annotated[float, Ge(0)] = 0.0  # [Pa/K] residual after calibration, one standard deviation
    warm_up_rise: Annotated[float, Ge(-200), Le(200)] = 0.0  # [K] temperature rise after the start
    warm_up_time: Annotated[float, Gt(0)] = 100.0  # [s] time constant of the warming
    faults: tuple[Fault, ...] | None = None  # compiled from the scene's schedule


class BarometerState(NamedTuple):
    """State of a barometer."""

    scale: float
    turn_on_bias: float  # [Pa]
    walk: Vec3  # [Pa] bias walk; only the first component is used
    line: Line  # only the first component is used
    warm_up: float  # [Pa] remaining warm-up error


READING = BarometerReading()


def blank() -> BarometerState:
    """Return a placeholder state, replaced at the first tick."""
    return BarometerState(0.0, 0.0, ZERO, BLANK, 0.0)


@kernel
def position_error(e: StaticPressureError | None, truth: Truth) -> float:
    """Return the static pressure error [Pa] of the flow around the vehicle (theory, eq. (3.65))."""
    if e is None:
        return 0.0
    return 0.5 * truth.air_density * share_of_squares(e, rotate_back(truth.attitude, truth.air_velocity_world))


@always_inline
def _true_pressure(p: Barometer, truth: Truth) -> float:
    home = truth.environment.home
    static = pressure(truth.environment.atmosphere, home.height + height_above_home(home, truth.position_world))
    return static + position_error(p.static_pressure_error, truth) + p.wash_pa_per_n * truth.rotors.thrust


@kernel
def initial(p: Barometer, key: Key, truth: Truth) -> BarometerState:
    """Return the state before the first sample."""
    draw = normal3(key, TURN_ON, 0)
    true = _true_pressure(p, truth)
    scale = 1.0 + p.scale_error * draw[0]
    turn_on_bias = p.turn_on_bias_pa * draw[1]
    walk = error_models.walk_deviation(p.bias_instability_pa) * draw[2]
    warm_up = p.warm_up_rise * p.temperature_pa_per_k * normal(key, TURN_ON, 1) if p.temperature_pa_per_k > 0.0 else 0.0
    start = scale * true + turn_on_bias + walk - warm_up
    return BarometerState(scale, turn_on_bias, (walk, 0.0, 0.0), new_delay_line((start, 0.0, 0.0)), warm_up)


@kernel
def sample(
    p: Barometer, s: BarometerState, key: Key, tick: int, truth: Truth
) -> tuple[BarometerState, BarometerReading]:
    """Return the next state and the reading. See `imu.sample` for arguments."""
    deviation = error_models.walk_deviation(p.bias_instability_pa)
    walk = error_models.walk(s.walk, deviation, p.bias_correlation_time, p.rate, (normal(key, tick, 0), 0.0, 0.0))
    noise = error_models.white_deviation(p.noise_pa_per_sqrt_hz, p.rate) * normal(key, tick, 1)
    true = _true_pressure(p, truth)
    measured = s.scale * true + s.turn_on_bias + walk[0] + noise - s.warm_up
    measured = error_models.quantise(error_models.limit(measured, p.range_pa), p.resolution_pa)
    line, delayed, valid = apply_delay_and_faults(
        p.faults, s.line, p.latency_samples, 0, key, tick, (measured, 0.0, 0.0)
    )
    variance = error_models.sample_variance(p.noise_pa_per_sqrt_hz, p.resolution_pa, p.rate)
    warm_up = s.warm_up * (1.0 - 1.0 / (p.rate * p.warm_up_time))
    return BarometerState(s.scale, s.turn_on_bias, walk, line, warm_up), BarometerReading(delayed[0], variance, valid)


# TE MS5611-01BA03 data sheet: 1.2 Pa RMS and 1 Pa resolution at the maximum oversampling, +-150 Pa, 1.2 bar. Here
# 1.5 Pa in samples at 50 Hz; instability (weather, warming) chosen.
MS5611 = Barometer(
    noise_pa_per_sqrt_hz=0.3,
    bias_instability_pa=3.0,
    turn_on_bias_pa=75.0,
    scale_error=1e-4,
    range_pa=120e3,
    resolution_pa=1.0,
)

# Infineon DPS422 data sheet, version 1.3: precision 0.5 Pa in the high-precision mode, absolute accuracy +-100 Pa,
# relative accuracy +-6 Pa, below 0.5 Pa/K, 1.2 bar. Chosen: the precision holds at 10 readings a second, the absolute
# accuracy is two deviations of the bias, the instability (weather) that of the other preset.
DPS422 = Barometer(
    noise_pa_per_sqrt_hz=0.22,
    bias_instability_pa=3.0,
    turn_on_bias_pa=50.0,
    scale_error=1e-4,
    range_pa=120e3,
    temperature_pa_per_k=0.25,
)

PRESETS = {"ms5611": MS5611, "dps422": DPS422, "ideal": Barometer()}
