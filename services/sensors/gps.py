"""Satellite receiver: position on WGS 84 and velocity, late (theory.md, section 3.2)."""

from typing import Annotated, NamedTuple

from annotated_types import Ge, Gt, Lt

from dynamics.geodesy import enu_to_geodetic
from dynamics.kernel import kernel, leaf
from dynamics.noise import TURN_ON, Key, normal3
from dynamics.vector import ZERO, Vec3, add, multiply
from services.common.ports import GpsReading
from services.sensors import errors
from services.sensors.line import BLANK, DEPTH, Fault, Line, carry, new_line
from services.sensors.truth import Truth

CHANNELS = ("position", "velocity")


class Gps(NamedTuple):
    """Parameters; horizontal figures are per axis."""

    noise_horizontal_m_per_sqrt_hz: Annotated[float, Ge(0)] = 0.0  # [m/sqrt(Hz)] one-sided density
    noise_vertical_m_per_sqrt_hz: Annotated[float, Ge(0)] = 0.0  # [m/sqrt(Hz)]
    noise_velocity_m_per_s_per_sqrt_hz: Annotated[float, Ge(0)] = 0.0  # [m/s/sqrt(Hz)]
    wander_horizontal: Annotated[float, Ge(0)] = 0.0  # [m] standard deviation of the error that is correlated in time
    wander_vertical: Annotated[float, Ge(0)] = 0.0  # [m]
    wander_time: Annotated[float, Gt(0)] = 60.0  # [s] its correlation time
    rate: Annotated[float, Gt(0)] = 10.0  # [Hz]
    latency_samples: Annotated[int, Ge(0), Lt(DEPTH)] = 0  # samples that a reading is late
    faults: tuple[Fault, ...] | None = None  # compiled from the scene's schedule


class GpsState(NamedTuple):
    """State of a receiver."""

    wander: Vec3  # in standard deviations
    position_line: Line
    velocity_line: Line


def blank() -> GpsState:
    """A state without meaning, to be overwritten at the first tick."""
    return GpsState(ZERO, BLANK, BLANK)


@leaf
def _deviations(p: Gps) -> Vec3:
    """Standard deviations of the wander [m]."""
    return (p.wander_horizontal, p.wander_horizontal, p.wander_vertical)


@kernel
def initial(p: Gps, key: Key, truth: Truth) -> GpsState:
    """State before the first sample: the receiver has run at this place for as long as its latency."""
    wander = normal3(key, TURN_ON, 0)
    position = add(truth.position_world, multiply(_deviations(p), wander))
    s = GpsState(wander, new_line(position), new_line(truth.velocity_world))
    for k in range(p.latency_samples):
        s, _ = sample(p, s, key, TURN_ON - 1 - k, truth)
    return s


@kernel
def sample(p: Gps, s: GpsState, key: Key, tick: int, truth: Truth) -> tuple[GpsState, GpsReading]:
    """Next state and reading; arguments as of `imu.sample`."""
    w = _deviations(p)
    across = errors.white_deviation(p.noise_horizontal_m_per_sqrt_hz, p.rate)
    up = errors.white_deviation(p.noise_vertical_m_per_sqrt_hz, p.rate)
    v = errors.white_deviation(p.noise_velocity_m_per_s_per_sqrt_hz, p.rate)
    wander = errors.walk(s.wander, 1.0, p.wander_time, p.rate, normal3(key, tick, 0))
    error = add(multiply(w, wander), multiply((across, across, up), normal3(key, tick, 1)))
    position = add(truth.position_world, error)
    velocity = add(truth.velocity_world, multiply((v, v, v), normal3(key, tick, 2)))
    position_line, position, seen = carry(p.faults, s.position_line, p.latency_samples, 0, key, tick, position)
    velocity_line, velocity, moving = carry(p.faults, s.velocity_line, p.latency_samples, 1, key, tick, velocity)
    latitude, longitude, height = enu_to_geodetic(truth.home, position)
    horizontal = across * across + w[0] * w[0]
    reading = GpsReading(
        latitude,
        longitude,
        height,
        (horizontal, horizontal, up * up + w[2] * w[2]),
        velocity,
        v * v,
        p.latency_samples / p.rate,
        seen and moving,
    )
    return GpsState(wander, position_line, velocity_line), reading


# u-blox ZED-F9P data sheet: 0.01 m + 1 ppm, 0.05 m/s; about 2 cm on a moving multirotor, of which part wanders with the
# multipath: chosen shares.
RTK = Gps(
    noise_horizontal_m_per_sqrt_hz=0.003,
    noise_vertical_m_per_sqrt_hz=0.005,
    noise_velocity_m_per_s_per_sqrt_hz=0.02,
    wander_horizontal=0.010,
    wander_vertical=0.013,
    wander_time=60.0,
    latency_samples=1,
)

# u-blox NEO-M8 data sheet: 2.5 m circular error probable, 0.05 m/s; vertical about 1.5 times the horizontal error,
# nearly all of it (ionosphere, orbits, multipath) wandering over minutes; latency and shares: chosen.
STANDARD = Gps(
    noise_horizontal_m_per_sqrt_hz=0.1,
    noise_vertical_m_per_sqrt_hz=0.2,
    noise_velocity_m_per_s_per_sqrt_hz=0.03,
    wander_horizontal=2.1,
    wander_vertical=3.2,
    wander_time=200.0,
    latency_samples=2,
)

PRESETS = {"rtk": RTK, "standard": STANDARD, "ideal": Gps()}
