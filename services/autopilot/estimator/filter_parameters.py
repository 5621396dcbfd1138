"""What the estimator is told about the vehicle's instruments and its home."""

from typing import Annotated, NamedTuple

from annotated_types import Ge, Gt, Lt

from lapwing.dynamics.atmosphere import Atmosphere
from lapwing.dynamics.environment import STANDARD
from lapwing.dynamics.geodesy import Home
from lapwing.dynamics.vector import Vec3


class Estimator(NamedTuple):
    """Parameters of the filter. White noise is not among them: every reading states its own variance."""

    interval: Annotated[float, Gt(0)] = 0.004  # [s] between two IMU readings
    home: Home = STANDARD.home
    gravity: Annotated[float, Gt(0)] = 9.81  # [m/s^2]
    atmosphere: Atmosphere = STANDARD.atmosphere  # for the pressure law
    magnetic_field_world: Vec3 = STANDARD.magnetic_field_world  # [T]
    ground_height: float = 0.0  # [m] of the ground under the home point, world z; taken for level

    start_std: Annotated[float, Gt(0)] = 0.1  # [m] in each axis: the world's origin is where the vehicle is put down
    position_std: Annotated[float, Gt(0)] = 10.0  # [m] above it the position is not known
    attitude_std: Annotated[float, Gt(0)] = 0.1  # [rad] of the first, levelled attitude
    gyro_bias_std: Annotated[float, Gt(0)] = 2e-3  # [rad/s] at the start
    gyro_bias_walk: Annotated[float, Ge(0)] = 1e-5  # [rad/s/sqrt(s)], instability and warming up
    gyro_scale_std: Annotated[float, Ge(0)] = 1.2e-3  # scale and misalignment, ratio
    accelerometer_bias_std: Annotated[float, Gt(0)] = 0.035  # [m/s^2] at the start, with scale and misalignment
    accelerometer_bias_walk: Annotated[float, Ge(0)] = 1e-4  # [m/s^2/sqrt(s)]
    barometer_walk: Annotated[float, Ge(0)] = 0.02  # [m/sqrt(s)], with the weather
    magnetometer_bias_std: Annotated[float, Ge(0)] = 7.5e-8  # [T] hard iron and misalignment, what calibration leaves
    magnetometer_bias_walk: Annotated[float, Ge(0)] = 6e-10  # [T/sqrt(s)]
    heading_std: Annotated[float, Ge(0)] = 1e-3  # [rad] between the magnetometer's axes and the body's
    sonar_scale_std: Annotated[float, Ge(0)] = 2e-3  # ratio, speed of sound
    sonar_half_beam_deg: Annotated[float, Ge(0), Lt(90)] = 10.0
    sonar_height_max: Annotated[float, Ge(0)] = 5.0  # [m] above it the barometer is left alone
    gps_wander_horizontal: Annotated[float, Ge(0)] = 0.010  # [m] error that is correlated in time, per axis
    gps_wander_vertical: Annotated[float, Ge(0)] = 0.013  # [m]
    gps_wander_time: Annotated[float, Gt(0)] = 60.0  # [s]

    flow_scale_std: Annotated[float, Ge(0)] = 0.02  # ratio, focal length of the camera that sees the ground pass by

    gate: Annotated[float, Gt(0)] = 5.0  # standard deviations beyond which a reading is refused
    patience: Annotated[float, Gt(0)] = 1.0  # [s] without an accepted reading before a source counts as lost
    frozen: Annotated[int, Gt(1)] = 12  # equal readings in a row that an instrument with noise and rounding cannot give
    jolt_rate: Annotated[float, Gt(0)] = 3.0  # [rad/s] change between two readings that no flight makes
    jolt_force: Annotated[float, Gt(0)] = 15.0  # [m/s^2] the same for the specific force


PRESETS = {
    "rtk": Estimator(),
    "standard": Estimator(gps_wander_horizontal=2.1, gps_wander_vertical=3.2, gps_wander_time=200.0),
}
"""By the receiver that the vehicle carries."""
