"""Optical flow sensor: angular rate of the ground in a downward camera (theory, eq. (3.41))."""

import math
from typing import Annotated, Any, NamedTuple

import numpy as np
from annotated_types import Ge, Gt, Lt

from lapwing.cosim.diagram.tick_schedule import Port
from lapwing.cosim.diagram.topic_encoder import Fields, TopicEncoder
from lapwing.dynamics.lie.quaternion import rotate, rotate_back
from lapwing.dynamics.noise import TURN_ON, Key, normal3
from lapwing.dynamics.vector import Vec3
from lapwing.kernels import always_inline, kernel
from lapwing.messages import OpticalFlow as OpticalFlowMessage
from lapwing.messages import header
from lapwing.messages import topics as topic
from lapwing.messages.cdr_arrays import stamp_columns
from lapwing.services.common.ports import OpticalFlowReading
from lapwing.services.sensors import error_models
from lapwing.services.sensors.delay_line import BLANK, DEPTH, Fault, Line, apply_delay_and_faults, new_delay_line
from lapwing.services.sensors.rangefinder import to_ground
from lapwing.services.sensors.sensor_inputs import Truth

CHANNELS = ("flow", "rate")


class OpticalFlow(NamedTuple):
    """Parameters of a camera at the body's origin, along -z of the body."""

    noise_rad_per_s_per_sqrt_hz: Annotated[float, Ge(0)] = 0.0  # [rad/s/sqrt(Hz)] one-sided density of the flow
    gyro_noise_dps_per_sqrt_hz: Annotated[float, Ge(0)] = 0.0  # [deg/s/sqrt(Hz)] one-sided density of its gyroscopes
    scale_error: Annotated[float, Ge(0), Lt(1)] = 0.0  # ratio, one standard deviation: focal length
    flow_max: Annotated[float, Gt(0)] = math.inf  # [rad/s] maximum flow at which texture is tracked
    range_min: Annotated[float, Ge(0)] = 0.0  # [m] shortest distance in focus
    range_max: Annotated[float, Gt(0)] = math.inf  # [m] longest distance with visible texture
    rate: Annotated[float, Gt(0)] = 50.0  # [Hz] readings a second
    latency_samples: Annotated[int, Ge(0), Lt(DEPTH)] = 0  # [samples] delay of a reading
    faults: tuple[Fault, ...] | None = None  # compiled from the scene's schedule


class OpticalFlowState(NamedTuple):
    """State of a camera."""

    scale: float
    flow: Line  # flow about x and y [rad/s], distance [m]
    rate: Line  # [rad/s] about x and y; the third component is unused


READING = OpticalFlowReading()


def blank() -> OpticalFlowState:
    """Return a placeholder state, replaced at the first tick."""
    return OpticalFlowState(0.0, BLANK, BLANK)


@always_inline
def _true_flow(truth: Truth) -> Vec3:
    """Return the flow about x and about y [rad/s], and the distance [m]."""
    distance = to_ground(truth.environment.terrain, truth.position_world, rotate(truth.attitude, (0.0, 0.0, -1.0)))
    v, omega = rotate_back(truth.attitude, truth.velocity_world), truth.omega_body
    inverse = 1.0 / max(distance, 1e-6)
    return omega[0] + v[1] * inverse, omega[1] - v[0] * inverse, distance


@kernel
def initial(p: OpticalFlow, key: Key, truth: Truth) -> OpticalFlowState:
    """Return the state before the first sample."""
    scale, true = 1.0 + p.scale_error * normal3(key, TURN_ON, 0)[0], _true_flow(truth)
    flow = (scale * true[0], scale * true[1], true[2])
    return OpticalFlowState(scale, new_delay_line(flow), new_delay_line(truth.omega_body))


@kernel
def sample(
    p: OpticalFlow, s: OpticalFlowState, key: Key, tick: int, truth: Truth
) -> tuple[OpticalFlowState, OpticalFlowReading]:
    """Return the next state and the reading. See `imu.sample` for arguments."""
    true, first, second = _true_flow(truth), normal3(key, tick, 0), normal3(key, tick, 1)
    noise = error_models.white_deviation(p.noise_rad_per_s_per_sqrt_hz, p.rate)
    gyro_noise = error_models.white_deviation(math.radians(p.gyro_noise_dps_per_sqrt_hz), p.rate)
    flow = (s.scale * true[0] + noise * first[0], s.scale * true[1] + noise * first[1], true[2])
    omega = truth.omega_body
    rate = (omega[0] + gyro_noise * second[0], omega[1] + gyro_noise * second[1], 0.0)
    flow_line, flow, flow_valid = apply_delay_and_faults(p.faults, s.flow, p.latency_samples, 0, key, tick, flow)
    rate_line, rate, rate_valid = apply_delay_and_faults(p.faults, s.rate, p.latency_samples, 1, key, tick, rate)
    in_range = p.range_min <= flow[2] <= p.range_max and max(abs(flow[0]), abs(flow[1])) <= p.flow_max
    distance = flow[2] if in_range else math.inf
    valid = flow_valid and rate_valid and in_range and distance < math.inf
    reading = OpticalFlowReading((flow[0], flow[1]), (rate[0], rate[1]), distance, noise * noise, valid)
    return OpticalFlowState(s.scale, flow_line, rate_line), reading


def _fields(r: OpticalFlowReading, time_ns: np.ndarray) -> Fields:
    """Return flow and rate; NaN without texture."""
    valid = (np.asarray(r.valid) != 0.0)[:, None]
    return {
        **stamp_columns(time_ns),
        "flow": np.where(valid, r.flow, math.nan),
        "rate": r.rate,
        "distance": r.distance,
        "variance": r.variance,
    }


def topic_encoders(frame: str, port: Port, instrument: Any) -> list[TopicEncoder]:
    """Return the encoder of the sensor's topic."""
    return [
        TopicEncoder(topic.OPTICAL_FLOW, port.name, port.period, _fields, lambda: OpticalFlowMessage(header(0, frame)))
    ]


# PixArt PMW3901MB data sheet, as PX4's driver cites it (src/drivers/optical_flow/pmw3901): at most 7.4 rad/s, from
# 80 mm, no maximum distance; texture up to 30 m is that driver's assumption. Noise, focal length: chosen.
PMW3901 = OpticalFlow(
    noise_rad_per_s_per_sqrt_hz=0.01,
    gyro_noise_dps_per_sqrt_hz=0.01,
    scale_error=0.02,
    flow_max=7.4,
    range_min=0.08,
    range_max=30.0,
)

# PixArt PAW3902, as PX4's page of the ARK Flow cites it: at most 7.4 rad/s, from 80 mm to 30 m; gyroscopes of that
# board: BMI088 (`imu`). Noise, focal length: chosen, as above.
PAW3902 = PMW3901._replace(gyro_noise_dps_per_sqrt_hz=0.016)

PRESETS = {"pmw3901": PMW3901, "paw3902": PAW3902, "ideal": OpticalFlow()}
