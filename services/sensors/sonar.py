"""Sonar: downward ultrasonic rangefinder (theory, section 3.2)."""

from typing import Annotated, Any, NamedTuple

import numpy as np
from annotated_types import Ge, Gt, Le, Lt
from numba import types

from lapwing.dynamics.config_error import ConfigError
from lapwing.dynamics.lie.quaternion import rotation_matrix
from lapwing.dynamics.noise import Key, normal
from lapwing.dynamics.terrain import Level, ray, surface
from lapwing.dynamics.vector import add, apply, dot, scale
from lapwing.kernels import always_inline, kernel, math
from lapwing.kernels.codegen import generic
from lapwing.services.common.ports import DistanceReading
from lapwing.services.sensors.delay_line import DEPTH, Fault
from lapwing.services.sensors.distance import CHANNELS, FARTHEST, DistanceState, blank, initial_state, measure
from lapwing.services.sensors.sensor_inputs import Truth

__all__ = ["CHANNELS", "PRESETS", "READING", "Echo", "Sonar", "blank", "check", "initial", "sample"]

READING = DistanceReading()
_FADING_LANE = 1  # lane of the random level of an echo, above that of the noise
_BEL = math.log(10.0)


class Echo(NamedTuple):
    """Level of the echo over that of the noise; over hard ground with slow propellers it is heard up to `range_max`."""

    ground_loss_db: Annotated[float, Ge(0), Le(100)] = 0.0  # [dB] level that soft ground absorbs (grass, snow)
    propeller_noise_db: Annotated[float, Ge(0), Le(100)] = 0.0  # [dB] rise of the noise level at `rotor_speed`
    rotor_speed: Annotated[float, Gt(0), Le(1e5)] = 400.0  # [rad/s] mean of the rotors
    fading_db: Annotated[float, Ge(0), Le(100)] = 0.0  # [dB] standard deviation of the level of an echo
    absorption_db_per_m: Annotated[float, Ge(0), Le(100)] = 1.3  # [dB/m] of sound in air


class Sonar(NamedTuple):
    """Parameters of a sonar at the body's origin, along -z of the body."""

    noise_m_per_sqrt_hz: Annotated[float, Ge(0)] = 0.0  # [m/sqrt(Hz)] one-sided density
    scale_error: Annotated[float, Ge(0), Lt(1)] = 0.0  # ratio, one standard deviation: speed of sound
    range_min: Annotated[float, Ge(0)] = 0.0  # [m] smallest measurable distance
    range_max: Annotated[float, Gt(0)] = math.inf  # [m] largest measurable distance
    resolution: Annotated[float, Ge(0)] = 0.0  # [m] step of a reading
    half_beam_deg: Annotated[float, Ge(0), Lt(90)] = 0.0  # [deg] the nearest ground within the beam returns the echo
    tilt_max_deg: Annotated[float, Gt(0), Lt(90)] = 89.0  # [deg] maximum tilt with an echo
    rate: Annotated[float, Gt(0)] = 10.0  # [Hz] readings a second
    latency_samples: Annotated[int, Ge(0), Lt(DEPTH)] = 0  # [samples] delay of a reading
    echo: Echo | None = None  # soft ground and noise of the propellers; default: none
    faults: tuple[Fault, ...] | None = None  # compiled from the scene's schedule


RAYS = 8  # along the edge of the beam, for obstacles off its axis


@generic(inline=True)
def _distance(p: types.Type, truth: types.Type) -> Any:
    """Return the distance to the nearest ground in the beam; +inf without an echo (theory, eq. (3.16))."""
    around = truth.types[truth.fields.index("environment")]
    return _over_level if around.types[around.fields.index("terrain")].instance_class is Level else _over_relief


@always_inline
def _over_level(p: Sonar, truth: Truth) -> float:
    cosine = rotation_matrix(truth.attitude)[8]
    tilt = math.acos(min(max(cosine, -1.0), 1.0))
    if tilt > math.radians(p.tilt_max_deg):
        return math.inf
    return truth.height_above_ground / math.cos(max(0.0, tilt - math.radians(p.half_beam_deg)))


@kernel
def _over_relief(p: Sonar, truth: Truth) -> float:
    """Return the distance to the plane at the axis' intersection, or to an earlier intersection of the beam's edge."""
    R, origin, beam = rotation_matrix(truth.attitude), truth.position_world, math.radians(p.half_beam_deg)
    axis = (-R[2], -R[5], -R[8])
    farthest = min(1.5 * p.range_max, FARTHEST)
    along = ray(truth.environment.terrain, origin, axis, farthest)
    if along == math.inf:
        return math.inf
    place = add(origin, scale(along, axis))
    _, normal = surface(truth.environment.terrain, place[0], place[1])
    cosine = -dot(normal, axis)
    angle = math.acos(min(max(cosine, -1.0), 1.0))
    if angle > math.radians(p.tilt_max_deg):
        return math.inf
    result = along * cosine / math.cos(max(0.0, angle - beam))
    for i in range(RAYS):
        turn = 2.0 * math.pi * i / RAYS
        edge = (math.sin(beam) * math.cos(turn), math.sin(beam) * math.sin(turn), -math.cos(beam))
        result = min(result, ray(truth.environment.terrain, origin, apply(R, edge), farthest))
    return result


def check(p: Sonar) -> None:
    """Raise ConfigError if the level of an echo is undefined."""
    if p.echo is not None and p.range_max == math.inf:
        raise ConfigError("range_max", "got inf", "a finite distance with echo")


@kernel
def _heard_distance(echo: Echo | None, range_max: float, key: Key, tick: int, truth: Truth, distance: float) -> float:
    """Return the distance, or inf if the echo is weaker than the noise (theory, eq. (3.70))."""
    if echo is None or not 0.0 < distance < math.inf:
        return distance
    level = 20.0 / _BEL * math.log(range_max / distance) + 2.0 * echo.absorption_db_per_m * (range_max - distance)
    level += echo.fading_db * normal(key, tick, _FADING_LANE) - echo.ground_loss_db
    speed = truth.rotors.speed / echo.rotor_speed
    noise = (math.exp(0.1 * _BEL * echo.propeller_noise_db) - 1.0) * (speed * speed * speed * speed * speed)
    return distance if level >= 10.0 / _BEL * math.log(1.0 + noise) else math.inf


@kernel
def initial(p: Sonar, key: Key, truth: Truth) -> DistanceState:
    """Return the state before the first sample."""
    return initial_state(p, key, _distance(p, truth))


@kernel
def sample(p: Sonar, s: DistanceState, key: Key, tick: int, truth: Truth) -> tuple[DistanceState, DistanceReading]:
    """Return the next state and the reading. See `imu.sample` for arguments."""
    distance = _heard_distance(p.echo, p.range_max, key, tick, truth, _distance(p, truth))
    s, r = measure(p, s, key, tick, distance)
    return s, DistanceReading(float(np.float32(r.range)), float(np.float32(r.variance)), r.valid)


# MaxBotix MB1202 (I2CXL-MaxSonar-EZ0) data sheet: 42 kHz, 0.20 to 7.65 m, 1 cm, widest beam of its family; from there
# the echo takes 45 ms, so 10 Hz is safe. Noise, speed-of-sound error, beam and lost-echo angles: chosen.
MB1202 = Sonar(
    noise_m_per_sqrt_hz=2e-3,
    scale_error=2e-3,
    range_min=0.20,
    range_max=7.65,
    resolution=0.01,
    half_beam_deg=10.0,
    tilt_max_deg=25.0,
)

# HC-SR04, as sellers quote the data sheet (the sheet itself was not available): 40 kHz, 0.02 to 4 m, accuracy 3 mm,
# resolution 0.3 cm, 15 degrees. Chosen: 3 mm is two deviations of a reading at 10 Hz, 15 degrees is the full beam;
# speed of sound and lost echoes as above.
HC_SR04 = Sonar(
    noise_m_per_sqrt_hz=6.7e-4,
    scale_error=2e-3,
    range_min=0.02,
    range_max=4.0,
    resolution=0.003,
    half_beam_deg=7.5,
    tilt_max_deg=25.0,
)

PRESETS = {
    "mb1202": MB1202,
    "hc_sr04": HC_SR04,
    "ideal": Sonar(half_beam_deg=MB1202.half_beam_deg),
}  # the beam is no error
