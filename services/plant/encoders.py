"""Topic encoders of the plant."""

import math
from typing import Any, NamedTuple

import numpy as np

import lapwing.messages
from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.diagram.topic_encoder import Fields, TopicEncoder
from lapwing.dynamics.atmosphere import FREEZING
from lapwing.dynamics.lie.quaternion import conjugate, rotate
from lapwing.kernels import python_function
from lapwing.messages import (
    BatteryState,
    BodyStates,
    Clock,
    Odometry,
    Point,
    Pose,
    PoseStamped,
    TFMessage,
    TransformStamped,
    Vector3,
    VehicleState,
    header,
)
from lapwing.messages import topics as topic
from lapwing.messages.cdr_arrays import quaternion_columns, stamp_columns
from lapwing.services.common import ports
from lapwing.services.common.encoders import pose_columns
from lapwing.services.common.ports import BatteryReading, BodyMotions, ContactForces, TrueState

WORLD = "world"
AMPERE_HOUR = 3600.0  # [A s]


class PlantEncoding(NamedTuple):
    """Contents of the plant's messages besides its state."""

    pose_every: int  # ticks between poses, transforms and clocks
    odometry: bool  # publish odometry
    cells: int  # battery cells; 0 without a battery
    capacity: float  # [A s], NaN without a battery
    bodies: tuple[str, ...]  # names, in the order of the port


def topic_encoders(config: RunConfig, encoding: PlantEncoding) -> list[TopicEncoder]:
    """Return the encoders of the plant's topics."""
    truth, declared_ports, every = config.port(ports.TRUTH), config.ports, encoding.pose_every
    result = [
        TopicEncoder(topic.TRUTH, ports.TRUTH, 1, _truth, lambda: _truth_sample(truth.example)),
        TopicEncoder(topic.POSE, ports.TRUTH, every, pose_columns, lambda: PoseStamped(header(0, WORLD))),
        TopicEncoder(topic.TF, ports.TRUTH, every, _transform, lambda: _transform_sample(config.vehicle)),
        TopicEncoder(topic.CLOCK, ports.TRUTH, every, lambda _, time_ns: stamp_columns(time_ns, "clock"), Clock),
    ]
    if encoding.odometry:
        odometry = Odometry(header(0, WORLD), config.vehicle)
        result.append(TopicEncoder(topic.ODOM, ports.TRUTH, every, _odometry, lambda: odometry))
    optional = {
        ports.BATTERY: (topic.BATTERY, _battery(encoding), lambda _: _battery_sample(config.vehicle, encoding)),
        ports.BODIES: (topic.BODIES, _bodies, lambda _: _bodies_sample(encoding.bodies)),
        ports.CONTACT: (topic.CONTACT, _contact, _contact_sample),
    }
    for name, (message_topic, fields, sample_of) in optional.items():
        if name in declared_ports:
            port = declared_ports[name]
            sample = sample_of(port.example)
            result.append(TopicEncoder(message_topic, name, port.period, fields, lambda sample=sample: sample))
    return result


def _truth_sample(example: TrueState) -> Any:
    return VehicleState(
        header(0, WORLD),
        rotor_speed=example.rotor_speed,
        motor_voltage=example.motor_voltage,
        motor_current=example.motor_current,
        motor_power=example.motor_power,
        rotor_thrust=example.rotor_thrust,
        rotor_torque=example.rotor_torque,
    )


def _truth(x: TrueState, time_ns: np.ndarray) -> Fields:
    """Return the fields of the true state."""
    return {
        **pose_columns(x, time_ns),
        "velocity": x.velocity_world,
        "angular_velocity": x.omega_body,
        "acceleration": x.acceleration_world,
        **{name: value for name in _PER_ROTOR if np.size(value := getattr(x, name))},
        "wind": x.wind_world,
        "air_density": x.air_density,
        "ground_contact": x.ground_contact,
    }


_PER_ROTOR = ("rotor_speed", "motor_voltage", "motor_current", "motor_power", "rotor_thrust", "rotor_torque")


def _odometry(x: TrueState, time_ns: np.ndarray) -> Fields:
    """Return pose in the world and velocities in the body frame, as in nav_msgs; both exact."""
    q = python_function(conjugate)(np.asarray(x.attitude).T)
    velocity_body = python_function(rotate)(q, np.asarray(x.velocity_world).T)
    return {
        **stamp_columns(time_ns),
        "pose.pose.position": x.position_world,
        "pose.pose.orientation": quaternion_columns(x.attitude),
        "twist.twist.linear": np.column_stack(velocity_body),
        "twist.twist.angular": x.omega_body,
    }


def _transform_sample(vehicle: str) -> Any:
    return TFMessage((TransformStamped(header(0, WORLD), vehicle),))


def _transform(x: TrueState, time_ns: np.ndarray) -> Fields:
    """Return the transform from world to body."""
    return {
        **stamp_columns(time_ns, "transforms.0.header.stamp"),
        "transforms.0.transform.translation": x.position_world,
        "transforms.0.transform.rotation": quaternion_columns(x.attitude),
    }


def _battery_sample(vehicle: str, encoding: PlantEncoding) -> Any:
    return BatteryState(
        header(0, vehicle),
        temperature=math.nan,
        capacity=math.nan,
        design_capacity=encoding.capacity / AMPERE_HOUR,
        power_supply_status=BatteryState.POWER_SUPPLY_STATUS_DISCHARGING,
        power_supply_technology=BatteryState.POWER_SUPPLY_TECHNOLOGY_LIPO,
        present=True,
        cell_voltage=(0.0,) * encoding.cells,
    )


def _battery(encoding: PlantEncoding) -> Any:
    capacity, cells = encoding.capacity / AMPERE_HOUR, encoding.cells

    def fields(x: BatteryReading, time_ns: np.ndarray) -> Fields:
        """Return the fields of the battery; unmodelled ones are NaN, as in sensor_msgs."""
        voltage = np.asarray(x.voltage)
        result: dict[str, Any] = {
            **stamp_columns(time_ns),
            "voltage": voltage,
            "current": -np.asarray(x.current),
            "charge": np.asarray(x.charge) * capacity,
            "percentage": x.charge,
            "temperature": np.asarray(x.temperature) - FREEZING,
        }
        if cells:
            result["cell_voltage"] = np.repeat((voltage / cells)[:, None], cells, axis=1)
        return result

    return fields


def _bodies_sample(names: tuple[str, ...]) -> Any:
    n = len(names)
    return BodyStates(
        header(0, WORLD), names, (Pose(),) * n, *[(Vector3(),) * n for _ in ("velocity", "rate", "force", "torque")]
    )


def _contact_sample(example: ContactForces) -> Any:
    n = len(example.force_world)
    return lapwing.messages.ContactForces(header(0, WORLD), (Point(),) * n, (Vector3(),) * n)


def _bodies(x: BodyMotions, time_ns: np.ndarray) -> Fields:
    """Return the fields of all bodies, with force and torque of contacts or joints."""
    result: dict[str, Any] = dict(stamp_columns(time_ns))
    for i in range(len(x.position_world)):
        result[f"pose.{i}.position"] = x.position_world[i]
        result[f"pose.{i}.orientation"] = quaternion_columns(x.attitude[i])
        result[f"velocity.{i}"] = x.velocity_world[i]
        result[f"angular_velocity.{i}"] = x.omega_body[i]
        result[f"force.{i}"] = x.force_world[i]
        result[f"torque.{i}"] = x.torque_body[i]
    return result


def _contact(x: ContactForces, time_ns: np.ndarray) -> Fields:
    """Return the fields of all contact points, with their forces."""
    result: dict[str, Any] = dict(stamp_columns(time_ns))
    for i, (place, force) in enumerate(zip(x.position_world, x.force_world, strict=True)):
        result[f"position.{i}"], result[f"force.{i}"] = place, force
    return result
