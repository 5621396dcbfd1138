"""Satellite receiver: delayed position on WGS 84 and velocity (theory, section 3.2)."""

from typing import Annotated, NamedTuple

from annotated_types import Ge, Gt, Le, Lt

from lapwing.dynamics.config_error import ConfigError
from lapwing.dynamics.geodesy import enu_to_geodetic
from lapwing.dynamics.lie.quaternion import rotate
from lapwing.dynamics.noise import TURN_ON, Key, normal3
from lapwing.dynamics.vector import IDENTITY, ZERO, Mat3, Vec3, add, apply, cross, multiply, scale
from lapwing.kernels import always_inline, kernel, math
from lapwing.services.common.ports import GPS_FLOAT, GPS_RTK, GpsReading
from lapwing.services.sensors import error_models
from lapwing.services.sensors.delay_line import BLANK, DEPTH, Fault, Line, apply_delay_and_faults, new_delay_line
from lapwing.services.sensors.rtk import Rtk, RtkState, check_rtk, ratio, update_solution
from lapwing.services.sensors.satellites import (
    NO_ERRORS,
    Constellation,
    RangeErrors,
    Satellite,
    Solution,
    check_constellation,
    check_sky,
    first_errors,
    geometry,
    next_errors,
    solution,
)
from lapwing.services.sensors.sensor_inputs import Place, Truth

CHANNELS = ("position", "velocity")
RTK_STATUS = 2  # `Gps.fix_status` of a fix with a ground station

Distance = Annotated[float, Ge(-1e6), Le(1e6)]


class Outage(NamedTuple):
    """A circle of the ground over which there is no fix."""

    x: Distance  # [m] world, of its centre
    y: Distance  # [m] world y of the middle
    radius: Annotated[float, Gt(0), Le(1e6)]  # [m] of the region


class Gps(NamedTuple):
    """Parameters of a receiver; horizontal values are per axis."""

    noise_horizontal_m_per_sqrt_hz: Annotated[float, Ge(0)] = 0.0  # [m/sqrt(Hz)] one-sided density
    noise_vertical_m_per_sqrt_hz: Annotated[float, Ge(0)] = 0.0  # [m/sqrt(Hz)] density of the altitude's noise
    noise_velocity_m_per_s_per_sqrt_hz: Annotated[float, Ge(0)] = 0.0  # [m/s/sqrt(Hz)] density of the velocity
    correlated_error_horizontal: Annotated[float, Ge(0)] = 0.0  # [m] standard deviation, correlated in time
    correlated_error_vertical: Annotated[float, Ge(0)] = 0.0  # [m] standard deviation of the slow error of the altitude
    correlation_time: Annotated[float, Gt(0)] = 60.0  # [s] of the correlated errors
    sky: tuple[Satellite, ...] | None = None  # fixed satellites in view, whose range errors replace the above
    constellation: Constellation | None = None  # satellites on orbits, instead of `sky`
    range_noise_m_per_sqrt_hz: Annotated[float, Ge(0)] = 0.0  # [m/sqrt(Hz)] of the distance to a satellite
    range_correlated_error: Annotated[float, Ge(0)] = 0.0  # [m] time-correlated error of the distance to a satellite
    fix_status: Annotated[int, Ge(0), Le(2)] = 0  # NavSatStatus: 0 plain, 1 SBAS, 2 with a ground station (RTK)
    rate: Annotated[float, Gt(0)] = 10.0  # [Hz] readings a second
    instances: Annotated[int, Ge(1), Le(2)] = 1  # two: a redundant receiver, for a firmware; `faults` of the first
    latency_samples: Annotated[int, Ge(0), Lt(DEPTH)] = 0  # [samples] delay of a reading
    antenna: Place | None = None  # [m] body; default: centre of mass
    rtk: Rtk | None = None  # single, float and fixed solutions; default: always `fix_status`
    time_to_first_fix: Annotated[float, Ge(0), Le(1e5)] = 0.0  # [s] from the start of the run
    outages: tuple[Outage, ...] | None = None  # [m] circles without a fix: { x, y, radius }
    faults: tuple[Fault, ...] | None = None  # compiled from the scene's schedule


class GpsState(NamedTuple):
    """State of a receiver."""

    wander: Vec3  # correlated errors, in standard deviations
    geometry: Mat3  # factor L of the covariance L L^T of a position, east, north, up, by distances of unit deviation
    position_line: Line
    velocity_line: Line
    ranges: RangeErrors  # of the satellites of a constellation
    rtk: RtkState
    samples: int  # since the start


READING = GpsReading()


def blank() -> GpsState:
    """Return a placeholder state, replaced at the first tick."""
    return GpsState(ZERO, IDENTITY, BLANK, BLANK, NO_ERRORS, RtkState(), 0)


@always_inline
def _deviations(p: Gps) -> Vec3:
    """Return the standard deviations of the correlated error [m]."""
    return (p.correlated_error_horizontal, p.correlated_error_horizontal, p.correlated_error_vertical)


@always_inline
def _range_deviations(p: Gps, factor: float) -> tuple[float, float]:
    """Return the standard deviations of a distance [m]: white and correlated."""
    noise = error_models.white_deviation(p.range_noise_m_per_sqrt_hz, p.rate)
    return noise, factor * p.range_correlated_error


def check(p: Gps) -> None:
    """Raise ConfigError if the visible satellites do not determine a position, or options exclude each other."""
    check_constellation(p.constellation)
    check_rtk(p.rtk)
    check_sky(p.sky)
    if p.sky is not None and p.constellation is not None:
        raise ConfigError("constellation", "cannot be combined with sky", "one of them")


@always_inline
def _position_error(p: Gps, s: GpsState, wander: Vec3, white: Vec3, fix: Solution, factor: float) -> tuple[Vec3, Vec3]:
    """Return error [m] and variance [m^2], both east, north, up; correlated errors are multiplied by `factor`."""
    if p.constellation is not None:
        noise, wandering = _range_deviations(p, factor)
        return fix.error, scale(noise * noise + wandering * wandering, fix.variance)
    if p.sky is None:
        w = scale(factor, _deviations(p))
        across = error_models.white_deviation(p.noise_horizontal_m_per_sqrt_hz, p.rate)
        up = error_models.white_deviation(p.noise_vertical_m_per_sqrt_hz, p.rate)
        horizontal = across * across + w[0] * w[0]
        error = add(multiply(w, wander), multiply((across, across, up), white))
        return error, (horizontal, horizontal, up * up + w[2] * w[2])
    (noise, wandering), L = _range_deviations(p, factor), s.geometry
    square = noise * noise + wandering * wandering
    east, north = L[0] * L[0], L[3] * L[3] + L[4] * L[4]
    variance = (square * east, square * north, square * (L[6] * L[6] + L[7] * L[7] + L[8] * L[8]))
    return apply(L, add(scale(wandering, wander), scale(noise, white))), variance


@kernel
def _antenna_motion(antenna: Vec3 | None, truth: Truth) -> tuple[Vec3, Vec3]:
    """Return position [m] and velocity [m/s] of the antenna in the world (theory, eq. (3.38))."""
    if antenna is None:
        return truth.position_world, truth.velocity_world
    arm = rotate(truth.attitude, antenna)
    swing = rotate(truth.attitude, cross(truth.omega_body, antenna))
    return add(truth.position_world, arm), add(truth.velocity_world, swing)


@kernel
def _outside_outages(outages: tuple[Outage, ...] | None, position: Vec3) -> bool:
    """Return True if the position [m] is outside of all outages."""
    if outages is None:
        return True
    outside = True
    for circle in outages:
        outside = outside and math.hypot(position[0] - circle.x, position[1] - circle.y) >= circle.radius
    return outside


@always_inline
def _solution(p: Gps, s: GpsState, antenna: Vec3, truth: Truth, key: Key, tick: int) -> Solution:
    """Return the fix from the satellites of a constellation."""
    fix = _fix_kind(p.rtk, s.rtk, p.fix_status)
    white, correlated = _range_deviations(p, ratio(p.rtk, fix))
    return solution(
        p.constellation, truth.environment.home, truth.environment.terrain, antenna, s.samples / p.rate, s.ranges,
        correlated, white, fix >= GPS_FLOAT, key, tick,
    )  # fmt: skip


@kernel
def _fix_kind(rtk: Rtk | None, s: RtkState, fix_status: int) -> int:
    """Return the kind of fix, as in `GpsReading`."""
    if rtk is None:
        return GPS_RTK if fix_status == RTK_STATUS else fix_status + 1
    return s.fix


@kernel
def initial(p: Gps, key: Key, truth: Truth) -> GpsState:
    """Return the state before the first sample: the receiver has run here, at rest, for its latency."""
    wander = normal3(key, TURN_ON, 0)
    position, velocity = _antenna_motion(p.antenna, truth)
    ranges, rtk = first_errors(p.constellation, key, TURN_ON), RtkState(math.inf, 0.0, GPS_RTK)
    s = GpsState(wander, geometry(p.sky), BLANK, BLANK, ranges, rtk, 0)
    fix = _solution(p, s, position, truth, key, TURN_ON)
    error, _ = _position_error(p, s, wander, ZERO, fix, 1.0)
    s = GpsState(wander, s.geometry, new_delay_line(add(position, error)), new_delay_line(velocity), ranges, rtk, 0)
    for k in range(p.latency_samples):
        s, _ = sample(p, s, key, TURN_ON - 1 - k, truth)
    converged = 0.0 if p.time_to_first_fix > 0.0 else s.rtk.converged
    rtk = RtkState(converged, s.rtk.age, s.rtk.fix)
    return GpsState(s.wander, s.geometry, s.position_line, s.velocity_line, s.ranges, rtk, 0)


@kernel
def sample(p: Gps, s: GpsState, key: Key, tick: int, truth: Truth) -> tuple[GpsState, GpsReading]:
    """Return the next state and the reading. See `imu.sample` for arguments."""
    v = error_models.white_deviation(p.noise_velocity_m_per_s_per_sqrt_hz, p.rate)
    wander = error_models.walk(s.wander, 1.0, p.correlation_time, p.rate, normal3(key, tick, 0))
    ranges = next_errors(p.constellation, s.ranges, p.correlation_time, p.rate, key, tick)
    position, velocity = _antenna_motion(p.antenna, truth)
    time = s.samples / p.rate
    s = GpsState(wander, s.geometry, s.position_line, s.velocity_line, ranges, s.rtk, s.samples)
    kind, fix = _fix_kind(p.rtk, s.rtk, p.fix_status), _solution(p, s, position, truth, key, tick)
    has_fix = time >= p.time_to_first_fix and fix.has_fix and _outside_outages(p.outages, truth.position_world)
    rtk = update_solution(p.rtk, s.rtk, 1.0 / p.rate, time, fix.used, has_fix)
    error, variance = _position_error(p, s, wander, normal3(key, tick, 1), fix, ratio(p.rtk, kind))
    position = add(position, error)
    velocity = add(velocity, multiply((v, v, v), normal3(key, tick, 2)))
    position_line, position, position_valid = apply_delay_and_faults(
        p.faults, s.position_line, p.latency_samples, 0, key, tick, position
    )
    velocity_line, velocity, velocity_valid = apply_delay_and_faults(
        p.faults, s.velocity_line, p.latency_samples, 1, key, tick, velocity
    )
    latitude, longitude, height = enu_to_geodetic(truth.environment.home, position)
    valid = position_valid and velocity_valid and has_fix
    reported_kind = kind if p.constellation is not None or p.rtk is not None else 0
    reading = GpsReading(
        latitude, longitude, height, variance, velocity, v * v, p.latency_samples / p.rate, valid, reported_kind,
        fix.used, fix.visible, math.sqrt(fix.variance[0] + fix.variance[1]), math.sqrt(fix.variance[2]),
    )  # fmt: skip
    return GpsState(wander, s.geometry, position_line, velocity_line, ranges, rtk, s.samples + 1), reading


# u-blox ZED-F9P data sheet: 0.01 m + 1 ppm, 0.05 m/s; about 2 cm on a moving multirotor, of which part wanders with the
# multipath: chosen shares. Distances to satellites: the same horizontal error at the mean HDOP of the default
# constellation, 1.2.
RTK = Gps(
    noise_horizontal_m_per_sqrt_hz=0.003,
    noise_vertical_m_per_sqrt_hz=0.005,
    noise_velocity_m_per_s_per_sqrt_hz=0.02,
    correlated_error_horizontal=0.010,
    correlated_error_vertical=0.013,
    correlation_time=60.0,
    range_noise_m_per_sqrt_hz=0.0035,
    range_correlated_error=0.012,
    fix_status=2,
    latency_samples=1,
)

# u-blox NEO-M8 data sheet: 2.5 m circular error probable, 0.05 m/s; vertical about 1.5 times the horizontal error,
# nearly all of it (ionosphere, orbits, multipath) wandering over minutes; latency and shares: chosen.
# Distances: as above.
STANDARD = Gps(
    noise_horizontal_m_per_sqrt_hz=0.1,
    noise_vertical_m_per_sqrt_hz=0.2,
    noise_velocity_m_per_s_per_sqrt_hz=0.03,
    correlated_error_horizontal=2.1,
    correlated_error_vertical=3.2,
    correlation_time=200.0,
    range_noise_m_per_sqrt_hz=0.12,
    range_correlated_error=2.4,
    latency_samples=2,
)

PRESETS = {"rtk": RTK, "standard": STANDARD, "ideal": Gps()}
