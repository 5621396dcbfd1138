"""Topic encoder of airspeed sensor readings."""

import math

import numpy as np

from lapwing.cosim.diagram.tick_schedule import Port
from lapwing.cosim.diagram.topic_encoder import Fields, TopicEncoder
from lapwing.messages import FluidPressure, header
from lapwing.messages.cdr_arrays import stamp_columns
from lapwing.messages.topics import Topic
from lapwing.services.common.ports import AirspeedReading


def airspeed_encoder(topic: Topic, frame: str, port: Port) -> TopicEncoder:
    """Return the encoder of the readings on `port`; `frame` is the vehicle's name."""
    return TopicEncoder(topic, port.name, port.period, _fields, lambda: FluidPressure(header(0, frame)))


def _fields(r: AirspeedReading, time_ns: np.ndarray) -> Fields:
    """Return the message columns; an invalid pressure is NaN."""
    pressure = np.where(np.asarray(r.valid) != 0.0, r.pressure, math.nan)
    return {**stamp_columns(time_ns), "fluid_pressure": pressure, "variance": r.variance}
