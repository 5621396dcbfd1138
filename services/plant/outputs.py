"""The plant's state as messages."""

import math
from collections.abc import Iterator, Sequence
from typing import Any

from dynamics.effects._types import Motion
from dynamics.lie.quaternion import rotate_back
from dynamics.vector import Vec3
from dynamics.vehicles.airframe import Battery
from dynamics.vehicles.multirotor import MultirotorObservation
from messages import (
    BatteryState,
    BodyStates,
    Clock,
    Odometry,
    Point,
    Pose,
    PoseStamped,
    PoseWithCovariance,
    Quaternion,
    TFMessage,
    Transform,
    TransformStamped,
    Twist,
    TwistWithCovariance,
    Vector3,
    VehicleState,
    header,
    stamp,
)
from messages.topics import CLOCK, POSE, TF, Topic

WORLD = "world"
AMPERE_HOUR = 3600.0  # [A s]


def pose_of(motion: Motion) -> Any:
    """Place and attitude of a body in the world."""
    q = motion.attitude
    return Pose(Point(*motion.position_world), Quaternion(q.x, q.y, q.z, q.w))


def truth(time_ns: int, vehicle: str, motion: Motion, seen: MultirotorObservation) -> Any:
    """The whole true state."""
    return VehicleState(
        header(time_ns, WORLD),
        pose_of(motion),
        Vector3(*motion.velocity_world),
        Vector3(*motion.omega_body),
        Vector3(*seen.acceleration_world),
        rotor_speed=motion.rotor_speed,
        motor_voltage=seen.motor_voltage,
        motor_current=seen.motor_current,
        motor_power=seen.motor_power,
        rotor_thrust=seen.thrust,
        rotor_torque=seen.torque,
        wind=Vector3(*seen.wind_world),
        air_density=seen.air_density,
        ground_contact=seen.in_contact,
    )


def pose(time_ns: int, motion: Motion) -> Any:
    """Pose of the body in the world."""
    return PoseStamped(header(time_ns, WORLD), pose_of(motion))


def odometry(time_ns: int, vehicle: str, motion: Motion) -> Any:
    """Pose in the world, velocities in the body frame, as nav_msgs defines them."""
    velocity_body = rotate_back(motion.attitude, motion.velocity_world)
    twist = Twist(Vector3(*velocity_body), Vector3(*motion.omega_body))
    exact = (0.0,) * 36
    return Odometry(
        header(time_ns, WORLD), vehicle, PoseWithCovariance(pose_of(motion), exact), TwistWithCovariance(twist, exact)
    )


def transform(time_ns: int, vehicle: str, motion: Motion) -> Any:
    """The frame tree: world to body."""
    q = motion.attitude
    body = Transform(Vector3(*motion.position_world), Quaternion(q.x, q.y, q.z, q.w))
    return TFMessage((TransformStamped(header(time_ns, WORLD), vehicle, body),))


def clock(time_ns: int) -> Any:
    """Simulation time."""
    return Clock(stamp(time_ns))


def bodies(
    time_ns: int,
    names: Sequence[str],
    motions: Sequence[Motion],
    forces: Sequence[Vec3] = (),
    torques: Sequence[Vec3] = (),
) -> Any:
    """Every body of a vehicle, with the contacts' or joints' force [N] in the world and torque [N m] in the body.

    None given: zero.
    """
    nothing = (0.0, 0.0, 0.0)
    return BodyStates(
        header(time_ns, WORLD),
        tuple(names),
        tuple(pose_of(m) for m in motions),
        tuple(Vector3(*m.velocity_world) for m in motions),
        tuple(Vector3(*m.omega_body) for m in motions),
        tuple(Vector3(*f) for f in forces or [nothing] * len(names)),
        tuple(Vector3(*f) for f in torques or [nothing] * len(names)),
    )


def whereabouts(time_ns: int, vehicle: str, motion: Motion) -> Iterator[tuple[Topic, Any]]:
    """What every vehicle says of itself at the rate of poses, odometry aside."""
    yield POSE, pose(time_ns, motion)
    yield TF, transform(time_ns, vehicle, motion)
    yield CLOCK, clock(time_ns)


def battery(time_ns: int, vehicle: str, gauge: tuple[float, float, float], pack: Battery | None) -> Any:
    """State of the battery; what no effect models is unknown (NaN), as sensor_msgs defines it.

    `gauge`: charge (fraction), voltage [V], current [A]; `pack`: the airframe's battery.
    """
    charge, voltage, current = gauge
    cells = pack.cells if pack else 0
    capacity = pack.capacity / AMPERE_HOUR if pack else math.nan
    return BatteryState(
        header(time_ns, vehicle),
        voltage=voltage,
        temperature=math.nan,
        current=-current,
        charge=charge * capacity,
        capacity=math.nan,
        design_capacity=capacity,
        percentage=charge,
        power_supply_status=BatteryState.POWER_SUPPLY_STATUS_DISCHARGING,
        power_supply_technology=BatteryState.POWER_SUPPLY_TECHNOLOGY_LIPO,
        present=True,
        cell_voltage=(voltage / cells,) * cells if cells else (),
    )
