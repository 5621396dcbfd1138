"""Estimator: where the vehicle is and how it moves, from its sensors (theory.md, section 3.3).

An error-state Kalman filter. Pure: every function takes the parameters and a state and returns the next state.
"""

from services.autopilot.estimator.flow import update_flow
from services.autopilot.estimator.gps import update_gps, update_gps_velocity
from services.autopilot.estimator.heading import update_magnetometer
from services.autopilot.estimator.height import follow_ground, update_barometer, update_sonar
from services.autopilot.estimator.parameters import PRESETS, Estimator
from services.autopilot.estimator.predict import predict
from services.autopilot.estimator.standstill import update_standstill
from services.autopilot.estimator.state import NAMES, SOURCES, State, estimate, initial, new_memory

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
    "update_barometer",
    "update_flow",
    "update_gps",
    "update_gps_velocity",
    "update_magnetometer",
    "update_sonar",
    "update_standstill",
]
