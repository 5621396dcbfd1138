"""Filter parameters: instruments, home and gates."""

from typing import Annotated, NamedTuple

from annotated_types import Ge, Gt, Lt

from lapwing.dynamics.atmosphere import Atmosphere
from lapwing.dynamics.environment import STANDARD
from lapwing.dynamics.geodesy import Home
from lapwing.dynamics.vector import Vec3

NO_STATIC_PRESSURE_ERROR = (0.0, 0.0, 0.0, 0.0, 0.0)


class Estimator(NamedTuple):
    """Filter parameters without white noise: every reading has its own variance."""

    interval: Annotated[float, Gt(0)] = 0.004  # [s] between two IMU readings
    home: Home = STANDARD.home
    gravity: Annotated[float, Gt(0)] = 9.81  # [m/s^2]
    atmosphere: Atmosphere = STANDARD.atmosphere  # for the pressure law
    magnetic_field_world: Vec3 = STANDARD.magnetic_field_world  # [T]
    ground_height: float = 0.0  # [m] world z of the ground at home, assumed level

    start_std: Annotated[float, Gt(0)] = 0.1  # [m] of the start position, each axis
    position_std: Annotated[float, Gt(0)] = 10.0  # [m] above which the position counts as unknown
    attitude_std: Annotated[float, Gt(0)] = 0.1  # [rad] of the initial attitude
    gyro_bias_std: Annotated[float, Gt(0)] = 1.9e-3  # [rad/s] at the start
    gyro_bias_walk: Annotated[float, Ge(0)] = 3.3e-6  # [rad/s/sqrt(s)], instability
    gyro_warm_up_std: Annotated[float, Ge(0)] = 7e-4  # [rad/s] change of the bias by the warm-up after the start
    gyro_warm_up_time: Annotated[float, Gt(0)] = 100.0  # [s] time constant of the warm-up
    gyro_scale_std: Annotated[float, Ge(0)] = 1e-3  # ratio, each axis
    gyro_alignment_std: Annotated[float, Ge(0)] = 8.7e-4  # [rad] about each axis
    accelerometer_bias_std: Annotated[float, Gt(0)] = 0.0295  # [m/s^2] at the start
    accelerometer_bias_walk: Annotated[float, Ge(0)] = 1e-4  # [m/s^2/sqrt(s)]
    accelerometer_scale_std: Annotated[float, Ge(0)] = 1e-3  # ratio, of the body's z axis
    accelerometer_alignment_std: Annotated[float, Ge(0)] = 8.7e-4  # [rad] about the body's x and y axes
    static_pressure_error: tuple[float, float, float, float, float] = NO_STATIC_PRESSURE_ERROR
    """Share of the dynamic pressure in flight forwards, backwards, to the right, to the left and vertically."""
    wind_speed: Annotated[float, Ge(0)] = 10.0  # [m/s] expected 6 m above the ground, of unknown direction
    barometer_walk: Annotated[float, Ge(0)] = 0.02  # [m/sqrt(s)], with the weather
    magnetometer_bias_std: Annotated[float, Ge(0)] = 5.1e-8  # [T] hard iron after calibration
    magnetometer_bias_walk: Annotated[float, Ge(0)] = 6e-10  # [T/sqrt(s)]
    magnetometer_scale_std: Annotated[float, Ge(0)] = 1e-3  # ratio, each axis
    magnetometer_alignment_std: Annotated[float, Ge(0)] = 8.7e-4  # [rad] about each axis
    sonar_scale_std: Annotated[float, Ge(0)] = 2e-3  # ratio, speed of sound
    sonar_half_beam_deg: Annotated[float, Ge(0), Lt(90)] = 10.0
    sonar_height_max: Annotated[float, Ge(0)] = 5.0  # [m] above which the sonar is not used
    gps_correlated_error_horizontal: Annotated[float, Ge(0)] = 0.010  # [m] time-correlated error per axis
    gps_correlated_error_vertical: Annotated[float, Ge(0)] = 0.013  # [m]
    gps_correlation_time: Annotated[float, Gt(0)] = 60.0  # [s]

    flow_scale_std: Annotated[float, Ge(0)] = 0.02  # ratio, focal length of the flow camera

    gate: Annotated[float, Gt(0)] = 5.0  # standard deviations beyond which a reading is rejected
    patience: Annotated[float, Gt(0)] = 1.0  # [s] without an accepted reading before a source counts as lost
    frozen: Annotated[int, Gt(1)] = 12  # consecutive equal readings of a stuck instrument with noise and rounding
    jolt_rate: Annotated[float, Gt(0)] = 3.0  # [rad/s] implausible change between two readings
    jolt_force: Annotated[float, Gt(0)] = 15.0  # [m/s^2] implausible change between two readings


PRESETS = {
    "rtk": Estimator(),
    "standard": Estimator(
        gps_correlated_error_horizontal=2.1, gps_correlated_error_vertical=3.2, gps_correlation_time=200.0
    ),
}
"""Filter parameters by receiver."""
