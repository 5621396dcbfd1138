"""Topic encoders, and columns of messages, that several services have in common."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from lapwing import messages
from lapwing.cosim.diagram.tick_schedule import Port
from lapwing.cosim.diagram.topic_encoder import Fields, TopicEncoder
from lapwing.kernels import math
from lapwing.kernels.row_packing import row_width
from lapwing.messages import Actuators, FluidPressure, Reading, Status, Vector3, header
from lapwing.messages import topics as topic
from lapwing.messages.cdr_arrays import quaternion_columns, stamp_columns
from lapwing.messages.topics import Topic
from lapwing.services.common import ports
from lapwing.services.common.ports import (
    AirspeedReading,
    AutopilotStatus,
    BarometerReading,
    MotorCommand,
    Setpoint,
    StateEstimate,
    TrueState,
)


def pose_columns(x: TrueState | StateEstimate, time_ns: np.ndarray) -> Fields:
    """Return time, and pose of the body in the world."""
    pose = {"pose.position": x.position_world, "pose.orientation": quaternion_columns(x.attitude)}
    return {**stamp_columns(time_ns), **pose}


def pressure_columns(r: AirspeedReading | BarometerReading, time_ns: np.ndarray) -> Fields:
    """Return time, pressure and variance; the pressure is NaN without a reading."""
    pressure = np.where(np.asarray(r.valid) != 0.0, r.pressure, math.nan)
    return {**stamp_columns(time_ns), "fluid_pressure": pressure, "variance": r.variance}


def airspeed_encoder(topic: Topic, frame: str, port: Port) -> TopicEncoder:
    """Return the encoder of the airspeed readings on `port`; `frame` is the vehicle's name."""
    return TopicEncoder(topic, port.name, port.period, pressure_columns, lambda: FluidPressure(header(0, frame)))


def reading_encoder(frame: str, port: Port) -> TopicEncoder:
    """Return the encoder of a port without a message type of its own: all numbers of its value, in order."""
    name = port.name.replace(".", "_")
    sample = Reading(header(0, frame), name, (0.0,) * row_width(port.example))
    return TopicEncoder(topic.custom_sensor(name), port.name, port.period, _reading, lambda: sample)


def _reading(value: Any, time_ns: np.ndarray) -> Fields:
    def leaves(part: Any) -> list[np.ndarray]:
        return [leaf for item in part for leaf in leaves(item)] if isinstance(part, tuple) else [part]

    return {**stamp_columns(time_ns), "values": np.column_stack(leaves(value))}


def setpoint_encoder(topic: Topic, port: str, texts: Sequence[str]) -> TopicEncoder:
    """Return the encoder of a setpoint port; `texts` has the phase names by index and may grow."""

    def sample(phase: int) -> Any:
        return messages.Setpoint(messages.header(0, "world"), phase=texts[phase])

    return TopicEncoder(topic, port, 1, _setpoint, sample, lambda x: [x.phase])


def _setpoint(x: Setpoint, time_ns: np.ndarray) -> Fields:
    return {
        **stamp_columns(time_ns),
        "position": x.position_world,
        "velocity": x.velocity_world,
        "acceleration": x.acceleration_world,
        "yaw": x.yaw,
        "yaw_rate": x.yaw_rate,
        "final": x.final,
    }


def actuators_encoder(port: Port) -> TopicEncoder:
    """Return the encoder of the motor commands."""
    command = Actuators(header(0, "body"), port.example.motor_voltage, False, port.example.thrust)
    return TopicEncoder(topic.ACTUATORS, ports.ACTUATORS, 1, _actuators, lambda: command)


def status_encoder(every: int, texts: Sequence[str], words: Sequence[Any]) -> TopicEncoder:
    """Return the encoder of the status, which has a message at every change, too.

    Args:
        every: largest number of ticks between two messages.
        texts: phase names by index; may grow.
        words: status texts by index; may grow.
    """
    return TopicEncoder(
        topic.STATUS, ports.STATUS, every, _status, _status_sample(texts, words), _status_texts, on_change=True
    )


def _actuators(x: MotorCommand, time_ns: np.ndarray) -> Fields:
    return {
        **stamp_columns(time_ns),
        "motor_voltage": x.motor_voltage,
        "armed": x.armed,
        "thrust": x.thrust,
        "attitude_reference": x.attitude_reference,
    }


def _status_sample(texts: Sequence[str], words: Sequence[Any]) -> Callable[[int, int, int], Any]:
    def sample(phase: int, number: int, armed: int) -> Any:
        w = words[number]
        return Status(
            header(0, "body"), w.mode, texts[phase], text=w.failsafe,
            mission_current=w.mission_current, mission_count=w.mission_count, mission_reached=w.mission_reached,
            mission_state=w.mission_state, offboard_available=w.offboard_available,
            arming_blockers=() if armed else tuple(w.arming_blockers),
            failsafe=bool(w.failsafe), home=Vector3(*w.home),
        )  # fmt: skip

    return sample


def _status_texts(x: AutopilotStatus) -> list[Any]:
    return [x.phase, x.status_text_id, x.armed]


def _status(x: AutopilotStatus, time_ns: np.ndarray) -> Fields:
    return {
        **stamp_columns(time_ns),
        "armed": x.armed,
        "landed": x.landed,
        "finished": x.finished,
        "battery_warning": x.battery_warning,
        "failed_motor": x.failed_motor,
    }
