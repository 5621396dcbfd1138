"""Topic table: name, type and rate of every topic, and whether it is recorded and reproducible."""

from dataclasses import dataclass, replace
from functools import cache
from typing import Any

from lapwing.messages.types import (
    Actuators,
    BatteryState,
    BodyStates,
    Clock,
    CommandAcks,
    ContactForces,
    Estimate,
    EstimateCovariance,
    FluidPressure,
    GPSFix,
    Image,
    Imu,
    LaserScan,
    Log,
    MagneticField,
    NavSatFix,
    Odometry,
    OperatorInput,
    OpticalFlow,
    PointCloud2,
    PoseStamped,
    Range,
    Reading,
    RotorWrench,
    Setpoint,
    Status,
    TFMessage,
    TwistWithCovarianceStamped,
    VehicleState,
    WallTime,
)


@dataclass(frozen=True, slots=True, eq=False)
class Topic:
    """Topic; template for all vehicles if its name contains `{vehicle}`."""

    name: str  # "{vehicle}/imu" or "clock", without a leading slash
    message: Any  # message class
    rate: str | None = None  # scene key of its rate; None: every exchange tick
    recorded: bool = True
    deterministic: bool = True  # equal bytes for equal scene and seed; only these topics enter the digest
    vehicle: str = ""  # vehicle of a fleet, whose name then replaces `{vehicle}`

    def key(self, vehicle: str = "") -> str:
        """Return ROS name and name in the log: "/drone1/imu"."""
        return "/" + self.name.format(vehicle=vehicle)

    def zenoh_key(self, vehicle: str, key_prefix: str) -> str:
        """Return the Zenoh key expression in a run's key prefix: "prefix/drone1/imu"."""
        return f"{key_prefix}/{self.name.format(vehicle=vehicle)}"


CLOCK = Topic("clock", Clock, rate="rates.pose")
TF = Topic("tf", TFMessage, rate="rates.pose")
WALL_TIME = Topic("wall_time", WallTime, rate="rates.status", deterministic=False)

TRUTH = Topic("{vehicle}/ground_truth", VehicleState)
BODIES = Topic("{vehicle}/body_states", BodyStates, rate="rates.body_states")
CONTACT = Topic("{vehicle}/contact_forces", ContactForces, rate="rates.contact_forces")
POSE = Topic("{vehicle}/pose", PoseStamped, rate="rates.pose")
ODOM = Topic("{vehicle}/odom", Odometry, rate="rates.pose")
IMU = Topic("{vehicle}/imu", Imu, rate="sensors.imu.rate")
MAG = Topic("{vehicle}/mag", MagneticField, rate="sensors.magnetometer.rate")
GPS = Topic("{vehicle}/gps/fix", NavSatFix, rate="sensors.gps.rate")
GPS_VELOCITY = Topic("{vehicle}/gps/velocity", TwistWithCovarianceStamped, rate="sensors.gps.rate")
GPS_DETAILS = Topic("{vehicle}/gps/details", GPSFix, rate="sensors.gps.rate")
BARO = Topic("{vehicle}/baro", FluidPressure, rate="sensors.barometer.rate")
SONAR = Topic("{vehicle}/sonar", Range, rate="sensors.sonar.rate")
AIRSPEED = Topic("{vehicle}/differential_pressure", FluidPressure, rate="sensors.airspeed.rate")
AIRSPEED_RECEIVED = Topic("{vehicle}/differential_pressure/received", FluidPressure, rate="sensors.airspeed.rate")
RANGEFINDER = Topic("{vehicle}/rangefinder", Range, rate="sensors.rangefinder.rate")
OPTICAL_FLOW = Topic("{vehicle}/optical_flow", OpticalFlow, rate="sensors.optical_flow.rate")
LASER_SCAN = Topic("{vehicle}/scan", LaserScan, rate="sensors.lidar.rate")
POINT_CLOUD = Topic("{vehicle}/points", PointCloud2, rate="sensors.lidar.rate")
DEPTH_IMAGE = Topic("{vehicle}/depth/image_rect", Image, rate="sensors.depth_camera.rate")
BATTERY = Topic("{vehicle}/battery", BatteryState, rate="rates.battery")
TRAJECTORY = Topic("{vehicle}/trajectory", Setpoint, recorded=False)  # SETPOINT has those that the autopilot follows
SETPOINT = Topic("{vehicle}/setpoint", Setpoint)
ESTIMATE = Topic("{vehicle}/estimate", Estimate, rate="rates.estimate")
ESTIMATE_COVARIANCE = Topic("{vehicle}/estimate/covariance", EstimateCovariance, rate="rates.covariance")
LIFT = Topic("{vehicle}/rotor_wrench", RotorWrench)
ACTUATORS = Topic("{vehicle}/actuators", Actuators)
STATUS = Topic("{vehicle}/status", Status, rate="rates.status")
OPERATOR = Topic("{vehicle}/vehicle_command", OperatorInput, rate="rates.commands")
COMMAND_ACKS = Topic("{vehicle}/vehicle_command_ack", CommandAcks, rate="rates.commands")
EVENTS = Topic("{vehicle}/events", Log, deterministic=False)  # computed from the other topics after the flight

TOPICS = tuple(value for value in list(globals().values()) if isinstance(value, Topic))
_RANKS = {topic: rank for rank, topic in enumerate(TOPICS)}
_NAMED = {topic.name: topic for topic in TOPICS}
_VEHICLE = "{vehicle}"
_CUSTOM_SENSOR = f"{_VEHICLE}/custom_sensor/"


@cache
def custom_sensor(name: str) -> Topic:
    """Return the topic of a custom sensor by its name in the scene, at its own rate."""
    return Topic(f"{_CUSTOM_SENSOR}{name}", Reading)


@cache
def of_vehicle(topic: Topic, vehicle: str) -> Topic:
    """Return the topic "left/imu" of vehicle `left` of a fleet; a topic without a vehicle's name is unchanged."""
    if _VEHICLE not in topic.name:
        return topic
    result = replace(topic, name=topic.name.replace(_VEHICLE, vehicle), vehicle=vehicle)
    _RANKS[result] = topic_rank(topic)
    return result


def template_topic(topic: Topic) -> Topic:
    """Return the template "{vehicle}/imu" of a vehicle's topic "left/imu"."""
    return topic_named(f"{_VEHICLE}/{topic.name.removeprefix(f'{topic.vehicle}/')}") if topic.vehicle else topic


def topic_named(name: str) -> Topic:
    """Return the topic of a name, "{vehicle}/imu", "left/imu" or "clock".

    Raises:
        ValueError: unknown topic.
    """
    if name.startswith(_CUSTOM_SENSOR):
        return custom_sensor(name.removeprefix(_CUSTOM_SENSOR))
    if name in _NAMED:
        return _NAMED[name]
    vehicle, _, rest = name.partition("/")
    if not rest or vehicle == _VEHICLE:
        raise ValueError(f"no topic {name}")
    return of_vehicle(topic_named(f"{_VEHICLE}/{rest}"), vehicle)


def topic_rank(topic: Topic) -> int:
    """Return the rank among the messages of a tick: that in the table; custom sensors come last."""
    return _RANKS.get(topic, len(TOPICS))
