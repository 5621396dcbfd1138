"""State estimator: an error-state Kalman filter of pure functions (theory, section 3.3)."""

from lapwing.services.autopilot.estimator.covariance_inflation import reset_imu_biases
from lapwing.services.autopilot.estimator.filter_parameters import PRESETS, Estimator
from lapwing.services.autopilot.estimator.filter_state import NAMES, SOURCES, State, estimate, initial, new_memory
from lapwing.services.autopilot.estimator.gps_fusion import update_gps, update_gps_velocity
from lapwing.services.autopilot.estimator.heading_and_velocity_fusion import (
    update_flow,
    update_magnetometer,
    update_standstill,
)
from lapwing.services.autopilot.estimator.height_fusion import follow_ground, update_barometer, update_sonar
from lapwing.services.autopilot.estimator.predict import predict

__all__ = [
    "NAMES",
    "PRESETS",
    "SOURCES",
    "Estimator",
    "State",
    "estimate",
    "follow_ground",
    "initial",
    "new_memory",
    "predict",
    "reset_imu_biases",
    "update_barometer",
    "update_flow",
    "update_gps",
    "update_gps_velocity",
    "update_magnetometer",
    "update_sonar",
    "update_standstill",
]
