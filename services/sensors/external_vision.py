"""External vision: pose of the body in the world, from a motion capture system or a camera's odometry."""

from typing import Annotated, NamedTuple

from annotated_types import Ge, Gt, Lt

from lapwing.dynamics.lie.quaternion import Quaternion, exp, multiply
from lapwing.dynamics.noise import Key, normal3
from lapwing.dynamics.vector import Vec3, add, dot, scale
from lapwing.kernels import always_inline, kernel, math
from lapwing.services.common.ports import ExternalVisionReading
from lapwing.services.sensors import error_models
from lapwing.services.sensors.delay_line import BLANK, DEPTH, Fault, Line, apply_delay_and_faults, new_delay_line
from lapwing.services.sensors.sensor_inputs import Truth

CHANNELS = ("position", "attitude")


class ExternalVision(NamedTuple):
    """Parameters of the system."""

    noise_m_per_sqrt_hz: Annotated[float, Ge(0)] = 0.0  # [m/sqrt(Hz)] one-sided density of the position, per axis
    attitude_noise_deg_per_sqrt_hz: Annotated[float, Ge(0)] = 0.0  # [deg/sqrt(Hz)] about each axis
    rate: Annotated[float, Gt(0)] = 50.0  # [Hz] readings a second
    latency_samples: Annotated[int, Ge(0), Lt(DEPTH)] = 0  # [samples] delay of a reading
    faults: tuple[Fault, ...] | None = None  # compiled from the scene's schedule


class ExternalVisionState(NamedTuple):
    """State of the system."""

    position: Line  # [m]
    attitude: Line  # vector part of the quaternion with a scalar part that is not negative


READING = ExternalVisionReading()


def blank() -> ExternalVisionState:
    """Return a placeholder state, replaced at the first tick."""
    return ExternalVisionState(BLANK, BLANK)


@always_inline
def _vector_part(q: Quaternion) -> Vec3:
    sign = math.copysign(1.0, q[0])
    return sign * q[1], sign * q[2], sign * q[3]


@kernel
def initial(p: ExternalVision, key: Key, truth: Truth) -> ExternalVisionState:
    """Return the state before the first sample."""
    return ExternalVisionState(new_delay_line(truth.position_world), new_delay_line(_vector_part(truth.attitude)))


@kernel
def sample(
    p: ExternalVision, s: ExternalVisionState, key: Key, tick: int, truth: Truth
) -> tuple[ExternalVisionState, ExternalVisionReading]:
    """Return the next state and the reading. See `imu.sample` for arguments."""
    noise = error_models.white_deviation(p.noise_m_per_sqrt_hz, p.rate)
    turn = error_models.white_deviation(math.radians(p.attitude_noise_deg_per_sqrt_hz), p.rate)
    place = add(truth.position_world, scale(noise, normal3(key, tick, 0)))
    q = multiply(truth.attitude, exp(scale(turn, normal3(key, tick, 1))))
    line, place, seen = apply_delay_and_faults(p.faults, s.position, p.latency_samples, 0, key, tick, place)
    turns, v, turned = apply_delay_and_faults(p.faults, s.attitude, p.latency_samples, 1, key, tick, _vector_part(q))
    attitude = Quaternion(math.sqrt(max(1.0 - dot(v, v), 0.0)), v[0], v[1], v[2])
    reading = ExternalVisionReading(place, attitude, noise * noise, turn * turn, seen and turned)
    return ExternalVisionState(line, turns), reading


# Chosen: 1 mm and 0.1 deg for cameras in the room, 2 cm and 0.5 deg for a camera on board, at the preset rate.
MOTION_CAPTURE = ExternalVision(noise_m_per_sqrt_hz=2e-4, attitude_noise_deg_per_sqrt_hz=0.02)
ODOMETRY = ExternalVision(noise_m_per_sqrt_hz=5e-3, attitude_noise_deg_per_sqrt_hz=0.13, rate=25.0, latency_samples=1)

PRESETS = {"motion_capture": MOTION_CAPTURE, "odometry": ODOMETRY, "ideal": ExternalVision()}
