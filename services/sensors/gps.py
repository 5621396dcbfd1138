"""Satellite receiver: position on WGS 84 and velocity, late (theory.md, section 3.2)."""

from typing import Annotated, NamedTuple

from annotated_types import Ge, Gt, Le, Lt

from lapwing.dynamics.config_error import ConfigError
from lapwing.dynamics.geodesy import enu_to_geodetic
from lapwing.dynamics.lie.quaternion import rotate
from lapwing.dynamics.noise import TURN_ON, Key, normal3
from lapwing.dynamics.vector import IDENTITY, ZERO, Mat3, Vec3, add, apply, cross, multiply, scale
from lapwing.kernels import always_inline, kernel, math, python_function
from lapwing.services.common.ports import GpsReading
from lapwing.services.sensors import error_models
from lapwing.services.sensors.delay_line import BLANK, DEPTH, Fault, Line, apply_delay_and_faults, new_delay_line
from lapwing.services.sensors.sensor_inputs import Place, Truth

CHANNELS = ("position", "velocity")
FEWEST = 4  # satellites of a fix
WORST = 50.0  # dilution of precision of a fix
FLATTEST = 1e-9  # determinant of the directions' spread from which a position is computed
NO_POSITION: Mat3 = (math.nan,) * 9  # type: ignore[assignment]


Distance = Annotated[float, Ge(-1e6), Le(1e6)]


class Outage(NamedTuple):
    """A circle of the ground over which there is no fix."""

    x: Distance  # [m] world, of its centre
    y: Distance  # [m]
    radius: Annotated[float, Gt(0), Le(1e6)]  # [m]


class Satellite(NamedTuple):
    """Direction of a satellite as seen from home."""

    azimuth_deg: Annotated[float, Ge(-360), Le(360)]  # [deg] from north towards east
    elevation_deg: Annotated[float, Ge(0), Le(90)]  # [deg] over the horizon


class Gps(NamedTuple):
    """Parameters; horizontal figures are per axis."""

    noise_horizontal_m_per_sqrt_hz: Annotated[float, Ge(0)] = 0.0  # [m/sqrt(Hz)] one-sided density
    noise_vertical_m_per_sqrt_hz: Annotated[float, Ge(0)] = 0.0  # [m/sqrt(Hz)]
    noise_velocity_m_per_s_per_sqrt_hz: Annotated[float, Ge(0)] = 0.0  # [m/s/sqrt(Hz)]
    correlated_error_horizontal: Annotated[float, Ge(0)] = 0.0  # [m] standard deviation, correlated in time
    correlated_error_vertical: Annotated[float, Ge(0)] = 0.0  # [m]
    correlation_time: Annotated[float, Gt(0)] = 60.0  # [s] its correlation time
    sky: tuple[Satellite, ...] | None = None  # satellites in view: position errors are theirs, not those above
    range_noise_m_per_sqrt_hz: Annotated[float, Ge(0)] = 0.0  # [m/sqrt(Hz)] of the distance to a satellite of `sky`
    range_correlated_error: Annotated[float, Ge(0)] = 0.0  # [m] of the same, correlated in time
    fix_status: Annotated[int, Ge(0), Le(2)] = 0  # of NavSatStatus: 0 alone, 1 SBAS, 2 with a ground station (RTK)
    rate: Annotated[float, Gt(0)] = 10.0  # [Hz]
    latency_samples: Annotated[int, Ge(0), Lt(DEPTH)] = 0  # samples that a reading is late
    antenna: Place | None = None  # [m] body; the centre of mass if left out
    outages: tuple[Outage, ...] | None = None  # [m] circles without a fix: { x, y, radius }
    faults: tuple[Fault, ...] | None = None  # compiled from the scene's schedule


class GpsState(NamedTuple):
    """State of a receiver."""

    wander: Vec3  # in standard deviations
    geometry: Mat3  # factor L of the covariance L L^T of a position, east, north, up, by distances of unit deviation
    position_line: Line
    velocity_line: Line


def blank() -> GpsState:
    """Return a placeholder state, replaced at the first tick."""
    return GpsState(ZERO, IDENTITY, BLANK, BLANK)


@always_inline
def _deviations(p: Gps) -> Vec3:
    """Return the standard deviations of the correlated error [m]."""
    return (p.correlated_error_horizontal, p.correlated_error_horizontal, p.correlated_error_vertical)


@kernel
def geometry(sky: tuple[Satellite, ...] | None) -> Mat3:
    """Return the factor L of `GpsState`; NaN if the satellites do not determine a position (theory.md, eq. (3.42))."""
    if sky is None:
        return IDENTITY
    x = y = z = xx = xy = xz = yy = yz = zz = 0.0
    for satellite in sky:
        azimuth, elevation = math.radians(satellite.azimuth_deg), math.radians(satellite.elevation_deg)
        e, n = math.cos(elevation) * math.sin(azimuth), math.cos(elevation) * math.cos(azimuth)
        u = math.sin(elevation)
        x, y, z = x + e, y + n, z + u
        xx, xy, xz, yy, yz, zz = xx + e * e, xy + e * n, xz + e * u, yy + n * n, yz + n * u, zz + u * u
    # what is common to all distances is the receiver's clock
    k = 1.0 / len(sky)
    xx, xy, xz = xx - k * x * x, xy - k * x * y, xz - k * x * z
    yy, yz, zz = yy - k * y * y, yz - k * y * z, zz - k * z * z
    a, b, c = yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy
    determinant = xx * a + xy * b + xz * c
    if determinant < FLATTEST:
        return NO_POSITION
    over = 1.0 / determinant
    l11 = math.sqrt(a * over)
    l21, l31 = b * over / l11, c * over / l11
    l22 = math.sqrt((xx * zz - xz * xz) * over - l21 * l21)
    l32 = ((xy * xz - xx * yz) * over - l31 * l21) / l22
    return (l11, 0.0, 0.0, l21, l22, 0.0, l31, l32, math.sqrt((xx * yy - xy * xy) * over - l31 * l31 - l32 * l32))


def check(p: Gps) -> None:
    """Raise ConfigError if the visible satellites do not determine a position."""
    if p.sky is None:
        return
    dilution = (
        math.sqrt(math.total(x * x for x in python_function(geometry)(p.sky))) if len(p.sky) >= FEWEST else math.inf
    )
    if not dilution < WORST:
        said = f"got {len(p.sky)} satellites with a dilution of precision (PDOP) of {dilution:.3g}"
        raise ConfigError("sky", said, f"{FEWEST} or more, spread so that it is below {WORST:g}")


@always_inline
def _position_error(p: Gps, s: GpsState, wander: Vec3, white: Vec3) -> tuple[Vec3, Vec3]:
    """Return error [m] and variance [m^2], both east, north, up."""
    if p.sky is None:
        w = _deviations(p)
        across = error_models.white_deviation(p.noise_horizontal_m_per_sqrt_hz, p.rate)
        up = error_models.white_deviation(p.noise_vertical_m_per_sqrt_hz, p.rate)
        horizontal = across * across + w[0] * w[0]
        error = add(multiply(w, wander), multiply((across, across, up), white))
        return error, (horizontal, horizontal, up * up + w[2] * w[2])
    noise, L = error_models.white_deviation(p.range_noise_m_per_sqrt_hz, p.rate), s.geometry
    square = noise * noise + p.range_correlated_error * p.range_correlated_error
    east, north = L[0] * L[0], L[3] * L[3] + L[4] * L[4]
    variance = (square * east, square * north, square * (L[6] * L[6] + L[7] * L[7] + L[8] * L[8]))
    return apply(L, add(scale(p.range_correlated_error, wander), scale(noise, white))), variance


@kernel
def _seen(antenna: Vec3 | None, truth: Truth) -> tuple[Vec3, Vec3]:
    """Return position [m] and velocity [m/s] of the antenna in the world (theory.md, eq. (3.38))."""
    if antenna is None:
        return truth.position_world, truth.velocity_world
    arm = rotate(truth.attitude, antenna)
    swing = rotate(truth.attitude, cross(truth.omega_body, antenna))
    return add(truth.position_world, arm), add(truth.velocity_world, swing)


@kernel
def _under_sky(outages: tuple[Outage, ...] | None, position: Vec3) -> bool:
    """Return True if there is a fix at this position."""
    if outages is None:
        return True
    free = True
    for circle in outages:
        free = free and math.hypot(position[0] - circle.x, position[1] - circle.y) >= circle.radius
    return free


@kernel
def initial(p: Gps, key: Key, truth: Truth) -> GpsState:
    """Return the state before the first sample: the receiver has run here for its latency."""
    wander = normal3(key, TURN_ON, 0)
    position, velocity = _seen(p.antenna, truth)
    s = GpsState(wander, geometry(p.sky), BLANK, BLANK)
    error, _ = _position_error(p, s, wander, ZERO)
    s = GpsState(wander, s.geometry, new_delay_line(add(position, error)), new_delay_line(velocity))
    for k in range(p.latency_samples):
        s, _ = sample(p, s, key, TURN_ON - 1 - k, truth)
    return s


@kernel
def sample(p: Gps, s: GpsState, key: Key, tick: int, truth: Truth) -> tuple[GpsState, GpsReading]:
    """Return the next state and the reading. See `imu.sample` for arguments."""
    v = error_models.white_deviation(p.noise_velocity_m_per_s_per_sqrt_hz, p.rate)
    wander = error_models.walk(s.wander, 1.0, p.correlation_time, p.rate, normal3(key, tick, 0))
    error, variance = _position_error(p, s, wander, normal3(key, tick, 1))
    position, velocity = _seen(p.antenna, truth)
    position = add(position, error)
    velocity = add(velocity, multiply((v, v, v), normal3(key, tick, 2)))
    position_line, position, seen = apply_delay_and_faults(
        p.faults, s.position_line, p.latency_samples, 0, key, tick, position
    )
    velocity_line, velocity, moving = apply_delay_and_faults(
        p.faults, s.velocity_line, p.latency_samples, 1, key, tick, velocity
    )
    latitude, longitude, height = enu_to_geodetic(truth.home, position)
    reading = GpsReading(
        latitude,
        longitude,
        height,
        variance,
        velocity,
        v * v,
        p.latency_samples / p.rate,
        seen and moving and _under_sky(p.outages, truth.position_world),
    )
    return GpsState(wander, s.geometry, position_line, velocity_line), reading


# u-blox ZED-F9P data sheet: 0.01 m + 1 ppm, 0.05 m/s; about 2 cm on a moving multirotor, of which part wanders with the
# multipath: chosen shares.
RTK = Gps(
    noise_horizontal_m_per_sqrt_hz=0.003,
    noise_vertical_m_per_sqrt_hz=0.005,
    noise_velocity_m_per_s_per_sqrt_hz=0.02,
    correlated_error_horizontal=0.010,
    correlated_error_vertical=0.013,
    correlation_time=60.0,
    fix_status=2,
    latency_samples=1,
)

# u-blox NEO-M8 data sheet: 2.5 m circular error probable, 0.05 m/s; vertical about 1.5 times the horizontal error,
# nearly all of it (ionosphere, orbits, multipath) wandering over minutes; latency and shares: chosen.
STANDARD = Gps(
    noise_horizontal_m_per_sqrt_hz=0.1,
    noise_vertical_m_per_sqrt_hz=0.2,
    noise_velocity_m_per_s_per_sqrt_hz=0.03,
    correlated_error_horizontal=2.1,
    correlated_error_vertical=3.2,
    correlation_time=200.0,
    latency_samples=2,
)

PRESETS = {"rtk": RTK, "standard": STANDARD, "ideal": Gps()}
