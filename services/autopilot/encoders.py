"""Topic encoders of the autopilot."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.diagram.topic_encoder import Fields, TopicEncoder
from lapwing.messages import Actuators, Estimate, Status, Vector3, header
from lapwing.messages import topics as topic
from lapwing.messages.cdr_arrays import quaternion_columns, stamp_columns
from lapwing.services.autopilot.estimator import NAMES
from lapwing.services.common import ports
from lapwing.services.common.ports import AutopilotStatus, MotorCommand, StateEstimate
from lapwing.services.common.reference_encoder import reference_wire


def wires(
    setup: RunConfig, estimate_every: int, status_every: int, texts: Sequence[str], words: Sequence[Any]
) -> list[TopicEncoder]:
    """Return the encoders of the autopilot's topics.

    Args:
        setup: run configuration.
        estimate_every: ticks between two messages of the estimate.
        status_every: ticks between two messages of the status.
        texts: phase names by index; may grow.
        words: status texts of the commander by index; may grow.
    """
    actuators = setup.port(ports.ACTUATORS).like
    command = Actuators(header(0, "body"), actuators.motor_voltage, False, actuators.thrust)
    return [
        TopicEncoder(topic.ACTUATORS, ports.ACTUATORS, 1, _actuators, lambda: command),
        TopicEncoder(
            topic.ESTIMATE, ports.ESTIMATE, estimate_every, _estimate, _estimate_sample, lambda x: [x.rejected]
        ),
        reference_wire(topic.SETPOINT, ports.SETPOINT, texts),
        TopicEncoder(
            topic.STATUS,
            ports.STATUS,
            status_every,
            _status,
            _status_sample(texts, words),
            _status_texts,
        ),
    ]


def _actuators(x: MotorCommand, time_ns: np.ndarray) -> Fields:
    return {
        **stamp_columns(time_ns),
        "motor_voltage": x.motor_voltage,
        "armed": x.armed,
        "thrust": x.thrust,
        "attitude_reference": x.attitude_reference,
    }


def _estimate_sample(rejected: int) -> Any:
    return Estimate(
        header(0, "world"), rejected_sources=tuple(name for bit, name in enumerate(NAMES) if rejected >> bit & 1)
    )


def _estimate(x: StateEstimate, time_ns: np.ndarray) -> Fields:
    return {
        **stamp_columns(time_ns),
        "pose.position": x.position_world,
        "pose.orientation": quaternion_columns(x.attitude),
        "velocity": x.velocity_world,
        "angular_velocity": x.omega_body,
        "acceleration_world": x.acceleration_world,
        "gyro_bias": x.gyro_bias,
        "accelerometer_bias": x.accelerometer_bias,
        "position_std": x.position_std,
        "velocity_std": x.velocity_std,
        "attitude_std": x.attitude_std,
        "health_flags": x.health,
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
    return [x.phase, x.words, x.armed]


def _status(x: AutopilotStatus, time_ns: np.ndarray) -> Fields:
    return {
        **stamp_columns(time_ns),
        "armed": x.armed,
        "landed": x.landed,
        "finished": x.finished,
        "battery_warning": x.battery_warning,
        "failed_motor": x.failed_motor,
    }
