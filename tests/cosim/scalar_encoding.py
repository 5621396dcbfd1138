"""Reference messages of every topic, made from a single value, field by field."""

import math

from lapwing.dynamics.lie.quaternion import rotate_back
from lapwing.messages import (
    Actuators,
    BatteryState,
    BodyStates,
    Clock,
    ContactForces,
    Estimate,
    EstimateCovariance,
    FluidPressure,
    GPSFix,
    GPSStatus,
    Imu,
    MagneticField,
    NavSatFix,
    NavSatStatus,
    Odometry,
    Point,
    Pose,
    PoseStamped,
    PoseWithCovariance,
    Quaternion,
    Range,
    RotorWrench,
    Setpoint,
    Status,
    TFMessage,
    Transform,
    TransformStamped,
    Twist,
    TwistWithCovariance,
    TwistWithCovarianceStamped,
    Vector3,
    VehicleState,
    header,
    stamp,
    topics,
)
from lapwing.messages.types import OpticalFlow
from lapwing.services.common import ports

UNKNOWN = (-1.0,) + (0.0,) * 8
SOURCES = ("imu", "gps", "gps_velocity", "barometer", "sonar", "magnetometer", "optical_flow")


def pose_of(position, q):
    return Pose(Point(*position), Quaternion(q.x, q.y, q.z, q.w))


def diagonal(x, y, z):
    return (x, 0.0, 0.0, 0.0, y, 0.0, 0.0, 0.0, z)


def truth(given, time_ns, x):
    return VehicleState(
        header(time_ns, "world"), pose_of(x.position_world, x.attitude), Vector3(*x.velocity_world),
        Vector3(*x.omega_body), Vector3(*x.acceleration_world), rotor_speed=x.rotor_speed,
        motor_voltage=x.motor_voltage, motor_current=x.motor_current, motor_power=x.motor_power,
        rotor_thrust=x.rotor_thrust, rotor_torque=x.rotor_torque, wind=Vector3(*x.wind_world),
        air_density=x.air_density, ground_contact=x.ground_contact,
    )  # fmt: skip


def pose(given, time_ns, x):
    return PoseStamped(header(time_ns, "world"), pose_of(x.position_world, x.attitude))


def odometry(given, time_ns, x):
    twist = Twist(Vector3(*rotate_back(x.attitude, x.velocity_world)), Vector3(*x.omega_body))
    exact = (0.0,) * 36
    at = PoseWithCovariance(pose_of(x.position_world, x.attitude), exact)
    return Odometry(header(time_ns, "world"), given.vehicle, at, TwistWithCovariance(twist, exact))


def transform(given, time_ns, x):
    q = x.attitude
    body = Transform(Vector3(*x.position_world), Quaternion(q.x, q.y, q.z, q.w))
    return TFMessage((TransformStamped(header(time_ns, "world"), given.vehicle, body),))


def clock(given, time_ns, x):
    return Clock(stamp(time_ns))


def battery(given, time_ns, x):
    cells, capacity = given.cells, given.capacity / 3600.0
    return BatteryState(
        header(time_ns, given.vehicle),
        voltage=x.voltage,
        temperature=x.temperature - 273.15,
        current=-x.current,
        charge=x.charge * capacity,
        capacity=math.nan,
        design_capacity=capacity,
        percentage=x.charge,
        power_supply_status=BatteryState.POWER_SUPPLY_STATUS_DISCHARGING,
        power_supply_technology=BatteryState.POWER_SUPPLY_TECHNOLOGY_LIPO,
        present=True,
        cell_voltage=(x.voltage / cells,) * cells if cells else (),
    )


def bodies(given, time_ns, x):
    return BodyStates(
        header(time_ns, "world"),
        given.bodies,
        tuple(pose_of(p, q) for p, q in zip(x.position_world, x.attitude, strict=True)),
        *[
            tuple(Vector3(*v) for v in vectors)
            for vectors in (x.velocity_world, x.omega_body, x.force_world, x.torque_body)
        ],
    )


def contact(given, time_ns, x):
    places, forces = tuple(Point(*p) for p in x.position_world), tuple(Vector3(*f) for f in x.force_world)
    return ContactForces(header(time_ns, "world"), places, forces)


def imu(given, time_ns, r):
    return Imu(
        header(time_ns, given.vehicle),
        orientation_covariance=UNKNOWN,
        angular_velocity=Vector3(*r.omega_body),
        angular_velocity_covariance=diagonal(*(r.omega_variance,) * 3) if r.valid else UNKNOWN,
        linear_acceleration=Vector3(*r.specific_force_body),
        linear_acceleration_covariance=diagonal(*(r.specific_force_variance,) * 3) if r.valid else UNKNOWN,
    )


def magnetometer(given, time_ns, r):
    field = r.field_body if r.valid else (math.nan,) * 3
    return MagneticField(header(time_ns, given.vehicle), Vector3(*field), diagonal(*(r.variance,) * 3))


def gps(given, time_ns, r):
    kinds = {
        ports.GPS_SINGLE: NavSatStatus.STATUS_FIX,
        ports.GPS_SBAS: NavSatStatus.STATUS_SBAS_FIX,
        ports.GPS_FLOAT: NavSatStatus.STATUS_GBAS_FIX,
        ports.GPS_RTK: NavSatStatus.STATUS_GBAS_FIX,
    }
    status = kinds.get(r.fix, NavSatStatus.STATUS_GBAS_FIX) if r.valid else NavSatStatus.STATUS_NO_FIX
    return NavSatFix(
        header(max(time_ns - round(r.age * 1e9), 0), given.vehicle),
        NavSatStatus(status, NavSatStatus.SERVICE_GPS),
        r.latitude_deg,
        r.longitude_deg,
        r.height,
        diagonal(*r.position_variance),
        NavSatFix.COVARIANCE_TYPE_DIAGONAL_KNOWN,
    )


def gps_details(given, time_ns, r):
    kinds = {ports.GPS_SINGLE: GPSStatus.STATUS_FIX, ports.GPS_SBAS: GPSStatus.STATUS_SBAS_FIX}
    head = header(max(time_ns - round(r.age * 1e9), 0), given.vehicle)
    east, north, up = r.velocity_world
    return GPSFix(
        head,
        GPSStatus(
            head,
            satellites_used=r.used,
            satellites_visible=r.visible,
            status=kinds.get(r.fix, 0) if r.valid else GPSStatus.STATUS_NO_FIX,
            position_source=GPSStatus.SOURCE_GPS,
        ),
        latitude=r.latitude_deg,
        longitude=r.longitude_deg,
        altitude=r.height,
        track=math.degrees(math.atan2(east, north)) % 360.0,
        speed=math.sqrt(east * east + north * north),
        climb=up,
        pdop=math.sqrt(r.hdop * r.hdop + r.vdop * r.vdop),
        hdop=r.hdop,
        vdop=r.vdop,
        err_horz=1.959964 * math.sqrt(r.position_variance[0] + r.position_variance[1]),
        err_vert=1.959964 * math.sqrt(r.position_variance[2]),
        position_covariance=diagonal(*r.position_variance),
        position_covariance_type=GPSFix.COVARIANCE_TYPE_DIAGONAL_KNOWN,
    )


def gps_velocity(given, time_ns, r):
    covariance = [0.0] * 36
    covariance[0] = covariance[7] = covariance[14] = r.velocity_variance if r.valid else -1.0
    twist = TwistWithCovariance(Twist(Vector3(*r.velocity_world), Vector3()), tuple(covariance))
    return TwistWithCovarianceStamped(header(max(time_ns - round(r.age * 1e9), 0), "world"), twist)


def barometer(given, time_ns, r):
    return FluidPressure(header(time_ns, given.vehicle), r.pressure if r.valid else math.nan, r.variance)


def sonar(given, time_ns, r):
    p = given.sonar
    return Range(
        header(time_ns, given.vehicle),
        radiation_type=Range.ULTRASOUND,
        field_of_view=math.radians(2.0 * p.half_beam_deg),
        min_range=p.range_min,
        max_range=p.range_max,
        range=r.range if r.valid else math.nan,
        variance=r.variance,
    )


def airspeed(given, time_ns, r):
    return FluidPressure(header(time_ns, given.vehicle), r.pressure if r.valid else math.nan, r.variance)


def rangefinder(given, time_ns, r):
    p = given.rangefinder
    return Range(
        header(time_ns, given.vehicle),
        radiation_type=Range.INFRARED,
        field_of_view=p.beam_deg * math.pi / 180.0,
        min_range=p.range_min,
        max_range=p.range_max,
        range=r.range if r.valid else math.nan,
        variance=r.variance,
    )


def optical_flow(given, time_ns, r):
    x, y = r.flow if r.valid else (math.nan, math.nan)
    return OpticalFlow(header(time_ns, given.vehicle), (x, y), r.rate, r.distance, r.variance)


def reference(given, time_ns, r):
    vectors = (r.position_world, r.velocity_world, r.acceleration_world)
    return Setpoint(
        header(time_ns, "world"), *[Vector3(*v) for v in vectors], r.yaw, r.yaw_rate, given.phases[r.phase], r.final
    )


def actuators(given, time_ns, x):
    return Actuators(header(time_ns, "body"), x.motor_voltage, x.armed, x.thrust, Vector3(*x.attitude_reference))


def estimate(given, time_ns, e):
    vectors = (
        e.velocity_world, e.omega_body, e.acceleration_world, e.gyro_bias, e.accelerometer_bias,
        e.position_std, e.velocity_std, e.attitude_std,
    )  # fmt: skip
    rejected = tuple(name for bit, name in enumerate(SOURCES) if e.rejected & 2**bit)
    at = pose_of(e.position_world, e.attitude)
    return Estimate(header(time_ns, "world"), at, *[Vector3(*v) for v in vectors], rejected, e.health)


def estimate_covariance(given, time_ns, x):
    return EstimateCovariance(header(time_ns, "world"), x.covariance, x.nis)


def status(given, time_ns, x):
    w = given.words[x.status_text_id]
    return Status(
        header(time_ns, "body"),
        w.mode,
        given.phases[x.phase],
        x.armed,
        x.landed,
        x.finished,
        w.failsafe,
        w.mission_current,
        w.mission_count,
        w.mission_reached,
        w.mission_state,
        w.offboard_available,
        () if x.armed else tuple(w.arming_blockers),
        bool(w.failsafe),
        Vector3(*w.home),
        x.battery_warning,
        x.failed_motor,
    )


def lift(given, time_ns, x):
    return RotorWrench(header(time_ns, "body"), x.thrust, tuple(Vector3(*m) for m in x.moment_body))


BUILDERS = {
    topics.TRUTH: truth,
    topics.POSE: pose,
    topics.ODOM: odometry,
    topics.TF: transform,
    topics.CLOCK: clock,
    topics.BATTERY: battery,
    topics.BODIES: bodies,
    topics.CONTACT: contact,
    topics.IMU: imu,
    topics.MAG: magnetometer,
    topics.GPS: gps,
    topics.GPS_VELOCITY: gps_velocity,
    topics.GPS_DETAILS: gps_details,
    topics.BARO: barometer,
    topics.SONAR: sonar,
    topics.AIRSPEED: airspeed,
    topics.RANGEFINDER: rangefinder,
    topics.OPTICAL_FLOW: optical_flow,
    topics.TRAJECTORY: reference,
    topics.SETPOINT: reference,
    topics.ACTUATORS: actuators,
    topics.ESTIMATE: estimate,
    topics.ESTIMATE_COVARIANCE: estimate_covariance,
    topics.STATUS: status,
    topics.LIFT: lift,
}
