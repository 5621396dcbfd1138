"""Airspeed sensor (pitot tube): dynamic pressure of the flow along its axis (theory, eq. (3.39))."""

import math
from typing import Annotated, Any, NamedTuple

from annotated_types import Ge, Gt, Lt

from lapwing.cosim.diagram.tick_schedule import Port
from lapwing.cosim.diagram.topic_encoder import TopicEncoder
from lapwing.dynamics.lie.quaternion import rotate_back
from lapwing.dynamics.noise import TURN_ON, Key, normal, normal3
from lapwing.kernels import always_inline, kernel
from lapwing.messages import topics as topic
from lapwing.services.common.encoders import airspeed_encoder
from lapwing.services.common.ports import AirspeedReading
from lapwing.services.sensors import error_models
from lapwing.services.sensors.delay_line import BLANK, DEPTH, Fault, Line, apply_delay_and_faults, new_delay_line
from lapwing.services.sensors.sensor_inputs import Truth

CHANNELS = ("pressure",)


class Airspeed(NamedTuple):
    """Parameters of a pitot tube along the body's x axis."""

    noise_pa_per_sqrt_hz: Annotated[float, Ge(0)] = 0.0  # [Pa/sqrt(Hz)] one-sided density
    turn_on_bias_pa: Annotated[float, Ge(0)] = 0.0  # [Pa] one standard deviation
    scale_error: Annotated[float, Ge(0), Lt(1)] = 0.0  # ratio, one standard deviation
    range_pa: Annotated[float, Gt(0)] = math.inf  # [Pa] largest measurable pressure
    resolution_pa: Annotated[float, Ge(0)] = 0.0  # [Pa] step of a reading
    rate: Annotated[float, Gt(0)] = 50.0  # [Hz] readings a second
    latency_samples: Annotated[int, Ge(0), Lt(DEPTH)] = 0  # [samples] delay of a reading
    faults: tuple[Fault, ...] | None = None  # compiled from the scene's schedule


class AirspeedState(NamedTuple):
    """State of a pitot tube."""

    scale: float
    turn_on_bias: float  # [Pa]
    line: Line  # only the first component is used


READING = AirspeedReading()


def blank() -> AirspeedState:
    """Return a placeholder state, replaced at the first tick."""
    return AirspeedState(0.0, 0.0, BLANK)


@always_inline
def _true_pressure(truth: Truth) -> float:
    """Return the differential pressure [Pa]; flow from behind causes a negative one of the same size."""
    along = rotate_back(truth.attitude, truth.air_velocity_world)[0]
    return 0.5 * truth.air_density * along * abs(along)


@kernel
def initial(p: Airspeed, key: Key, truth: Truth) -> AirspeedState:
    """Return the state before the first sample."""
    draw = normal3(key, TURN_ON, 0)
    scale, turn_on_bias = 1.0 + p.scale_error * draw[0], p.turn_on_bias_pa * draw[1]
    return AirspeedState(scale, turn_on_bias, new_delay_line((scale * _true_pressure(truth) + turn_on_bias, 0.0, 0.0)))


@kernel
def sample(p: Airspeed, s: AirspeedState, key: Key, tick: int, truth: Truth) -> tuple[AirspeedState, AirspeedReading]:
    """Return the next state and the reading. See `imu.sample` for arguments."""
    noise = error_models.white_deviation(p.noise_pa_per_sqrt_hz, p.rate) * normal(key, tick, 0)
    measured = s.scale * _true_pressure(truth) + s.turn_on_bias + noise
    measured = error_models.quantise(error_models.limit(measured, p.range_pa), p.resolution_pa)
    line, delayed, valid = apply_delay_and_faults(
        p.faults, s.line, p.latency_samples, 0, key, tick, (measured, 0.0, 0.0)
    )
    variance = error_models.sample_variance(p.noise_pa_per_sqrt_hz, p.resolution_pa, p.rate)
    return AirspeedState(s.scale, s.turn_on_bias, line), AirspeedReading(delayed[0], variance, valid)


def topic_encoders(frame: str, port: Port, instrument: Any) -> list[TopicEncoder]:
    """Return the encoder of the sensor's topic."""
    return [airspeed_encoder(topic.AIRSPEED, frame, port)]


# Sensirion, preliminary data sheet SDP33, version 0.1 (August 2017): 1500 Pa. Resolution: 20 counts a pascal, the scale
# in PX4's and ArduPilot's drivers. Chosen: zero point, span and noise (the sheet's tables were not available).
SDP33 = Airspeed(noise_pa_per_sqrt_hz=0.05, turn_on_bias_pa=0.2, scale_error=0.03, range_pa=1500.0, resolution_pa=0.05)

# TE 4525DO data sheet: 14 bits, 1 psi differential, total error band below 1 % of the span. Counts 1638 to 14745 for
# -1 to 1 psi (10 to 90 % of the counts). Chosen: the error band is two deviations of the zero point; noise of one count
# in a sample.
MS4525DO = Airspeed(
    noise_pa_per_sqrt_hz=0.21, turn_on_bias_pa=69.0, scale_error=0.0025, range_pa=6894.757, resolution_pa=1.052
)

PRESETS = {"sdp33": SDP33, "ms4525do": MS4525DO, "ideal": Airspeed()}
