"""Declination: the autopilot uses the World Magnetic Model at home and does not know local anomalies."""

import math
import subprocess
import sys

import numpy as np
import pytest

from lapwing.dynamics.environment import STANDARD
from lapwing.flights.flight_data import FlightData
from lapwing.services.scene_resolver import load, resolve

ANOMALY = "environment.magnetic_anomaly=[2e-6,-1e-6,3e-6]"


def test_magnetic_anomaly_affects_sensors_only():
    services = resolve(load("quad_x", [ANOMALY])).services
    measured = services["sensors"].parameters[0].environment.magnetic_field_world
    model_field = services["autopilot"].parameters.estimator.magnetic_field_world
    assert model_field == STANDARD.magnetic_field_world
    assert np.subtract(measured, model_field) == pytest.approx((2e-6, -1e-6, 3e-6))


def yaw(q):
    w, x, y, z = q
    return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


@pytest.mark.long
@pytest.mark.parametrize("values", [[], [ANOMALY]])
def test_unknown_declination_offsets_estimated_heading(tmp_path, values):
    """The heading error is the direction of the model's horizontal field minus that of the local field."""
    ideal = [f"sensors.{name}.preset=ideal" for name in ("imu", "magnetometer")]  # a tilt would rotate the field
    sets = [*values, *ideal, "run.duration=1.0", "success.require=[]"]
    command = [sys.executable, "-m", "lapwing", "run", "quad_x", "--mode", "single-process"]
    command += ["--log", str(tmp_path / "a.mcap"), *(part for text in sets for part in ("--set", text))]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    flight = FlightData.read(tmp_path / "a.mcap")
    estimate, truth = flight.topic("estimate"), flight.topic("ground_truth")
    east, north, _ = STANDARD.magnetic_field_world
    expected = math.atan2(north, east) - math.atan2(north - 1e-6, east + 2e-6) if values else 0.0
    wrong = yaw(estimate["pose.orientation"][5][[3, 0, 1, 2]]) - yaw(truth["pose.orientation"][5][[3, 0, 1, 2]])
    assert wrong == pytest.approx(expected, abs=2e-3)
