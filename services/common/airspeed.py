"""The readings of an airspeed sensor as messages."""

import math

import numpy as np

from cosim.schedule import Port
from cosim.wire import Fields, Wire
from messages import FluidPressure, header
from messages.records import stamp_columns
from messages.topics import Topic
from services.common.ports import AirspeedReading


def airspeed_wire(topic: Topic, frame: str, port: Port) -> Wire:
    """A topic of the readings on `port`; `frame` is the vehicle's name."""
    return Wire(topic, port.name, port.period, _fields, lambda: FluidPressure(header(0, frame)))


def _fields(r: AirspeedReading, time_ns: np.ndarray) -> Fields:
    """Differential pressure; no reading: NaN."""
    pressure = np.where(np.asarray(r.valid) != 0.0, r.pressure, math.nan)
    return {**stamp_columns(time_ns), "fluid_pressure": pressure, "variance": r.variance}
