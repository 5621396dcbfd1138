"""Parameters of a recording instead of the vehicle: delays and sensor offsets."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from lapwing.flights.log_import.recording import Recording

COMMAND_DELAY = "flight.command_delay"  # [s] from a logged command to the motors
GYROSCOPE_OFFSET = "flight.gyroscope_offset"  # [rad/s] measured minus true, about each body axis
KEYS = (COMMAND_DELAY, *(f"{GYROSCOPE_OFFSET}.{k}" for k in range(3)))


def is_flight_parameter(key: str) -> bool:
    """Return True if the key is a parameter of a recording."""
    return key in KEYS


def apply_flight_parameters(flight: Recording, values: Mapping[str, float]) -> Recording:
    """Return the recording with delayed commands and corrected body rates."""
    if not values:
        return flight
    offset = np.array([values.get(f"{GYROSCOPE_OFFSET}.{k}", 0.0) for k in range(3)])
    voltage = flight.motor_voltage
    if delay := values.get(COMMAND_DELAY, 0.0):
        rows = np.arange(len(flight)) - delay / flight.interval
        voltage = np.column_stack([np.interp(rows, np.arange(len(flight)), column) for column in voltage.T])
    return replace(flight, omega=flight.omega - offset, motor_voltage=voltage)
