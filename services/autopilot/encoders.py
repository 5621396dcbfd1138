"""Topic encoders of the autopilot."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.diagram.tick_schedule import Port
from lapwing.cosim.diagram.topic_encoder import Fields, TopicEncoder
from lapwing.messages import Estimate, EstimateCovariance, Reading, header
from lapwing.messages import topics as topic
from lapwing.messages.cdr_arrays import stamp_columns
from lapwing.services.autopilot.estimator import NAMES
from lapwing.services.common import ports
from lapwing.services.common.encoders import actuators_encoder, pose_columns, setpoint_encoder, status_encoder
from lapwing.services.common.ports import StateEstimate


def topic_encoders(
    config: RunConfig, estimate_every: int, status_every: int, phases: Sequence[str], status_texts: Sequence[Any]
) -> list[TopicEncoder]:
    """Return the encoders of the autopilot's topics.

    Args:
        config: run configuration.
        estimate_every: ticks between two messages of the estimate.
        status_every: largest number of ticks between two messages of the status.
        phases: phase names by index; may grow.
        status_texts: status texts of the commander by index; may grow.
    """
    return [
        actuators_encoder(config.port(ports.ACTUATORS)),
        TopicEncoder(
            topic.ESTIMATE, ports.ESTIMATE, estimate_every, _estimate, _estimate_sample, lambda x: [x.rejected]
        ),
        setpoint_encoder(topic.SETPOINT, ports.SETPOINT, phases),
        status_encoder(status_every, phases, status_texts),
        *([_covariance_encoder(config.port(name))] if (name := ports.ESTIMATE_COVARIANCE) in config.ports else []),
    ]


def imu_selection_encoder(vehicle: str, every: int) -> TopicEncoder:
    """Return the encoder of the vote between redundant IMUs: the unit in use and the bits of failed ones."""

    def fields(x: ports.ImuSelection, time_ns: np.ndarray) -> Fields:
        return {**stamp_columns(time_ns), "values": np.column_stack([x.unit, x.failed])}

    name = ports.IMU_SELECTION
    return TopicEncoder(
        topic.custom_sensor(name), name, every, fields, lambda: Reading(header(0, vehicle), name, (0.0, 0.0))
    )


def _covariance_encoder(port: Port) -> TopicEncoder:
    def fields(x: ports.EstimateCovariance, time_ns: np.ndarray) -> Fields:
        return {**stamp_columns(time_ns), "covariance": x.covariance, "nis": x.nis}

    return TopicEncoder(
        topic.ESTIMATE_COVARIANCE, port.name, port.period, fields, lambda: EstimateCovariance(header(0, "world"))
    )


def _estimate_sample(rejected: int) -> Any:
    return Estimate(
        header(0, "world"), rejected_sources=tuple(name for bit, name in enumerate(NAMES) if rejected >> bit & 1)
    )


def _estimate(x: StateEstimate, time_ns: np.ndarray) -> Fields:
    return {
        **pose_columns(x, time_ns),
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
