"""User-defined estimators."""

from pathlib import Path

import numpy as np
import pytest

from lapwing.dynamics.config_error import ConfigError
from lapwing.services.scene_resolver import load, resolve
from lapwing.studies.simulate import fly

# Integrates the IMU from rest: accurate for some seconds with ideal sensors.
DEAD_RECKONING = """
import numpy as np
from scipy.spatial.transform import Rotation
from lapwing.services.autopilot.custom.estimator_api import StateEstimate

class DeadReckoning:
    rate = 250.0

    def __init__(self, vehicle, gravity=9.80665):
        self.g = np.array([0.0, 0.0, gravity])
        self.p, self.v, self.R = np.array([0.0, 0.0, vehicle.resting_height]), np.zeros(3), Rotation.identity()
        self.dt = vehicle.interval

    def step(self, time, readings):
        omega = a = np.zeros(3)
        if "imu" in readings:
            omega = np.array(readings["imu"].omega_body)
            self.R = self.R * Rotation.from_rotvec(self.dt * omega)
            a = self.R.apply(readings["imu"].specific_force_body) - self.g
            self.p, self.v = self.p + self.dt * (self.v + 0.5 * self.dt * a), self.v + self.dt * a
        x, y, z, w = self.R.as_quat()
        return StateEstimate(self.p, (w, x, y, z), self.v, omega, a)
"""


@pytest.fixture
def scene(tmp_path):
    def make(text, name, *overrides):
        (tmp_path / "own_estimator.py").write_text(text)
        path = tmp_path / "hover.toml"
        path.write_text(
            Path("lapwing/scenes/hover.toml").read_text() + '[sensors.imu]\npreset = "ideal"\n[sensors.gps]\n'
        )
        return load(path, [f"autopilot.estimator=own_estimator:{name}", *overrides])

    return make


def test_custom_estimate_is_used_and_logged(scene):
    flight = fly(scene(DEAD_RECKONING, "DeadReckoning"))
    assert flight.failure == ""
    assert flight.rmse["z"] < 0.1
    assert flight.landed
    estimate = flight.topic("estimate")["pose.position"][:400, 2]  # up to the descent, at 50 Hz
    assert np.ptp(estimate) == pytest.approx(1.0, abs=0.1)


def test_reading_is_passed_once_and_estimate_is_latched(scene):
    text = DEAD_RECKONING.replace("rate = 250.0", "rate = 125.0").replace(
        'if "imu" in readings:', 'self.p = self.p + [float("gps" in readings), 0.0, 0.0]\n        if False:'
    )
    flight = fly(scene(text, "DeadReckoning", "run.duration=1.0", "rates.estimate=250"))
    x = flight.topic("estimate")["pose.position"][:, 0]
    assert x[-1] == 11.0  # at 10 Hz, tick 0 included
    assert (x[0:250:2] == x[1:251:2]).all()


def test_custom_estimator_errors_are_one_line(scene):
    with pytest.raises(
        ConfigError, match=r"autopilot.estimator: own_estimator:DeadReckoning: TypeError: step returned"
    ):
        resolve(scene(DEAD_RECKONING.replace("return State", "return print or State"), "DeadReckoning"))
    with pytest.raises(
        ConfigError, match=r"autopilot.estimator_options: TypeError: .* unexpected keyword argument 'x'"
    ):
        resolve(scene(DEAD_RECKONING, "DeadReckoning", "autopilot.estimator_options.x=1.0"))
    with pytest.raises(ConfigError, match="unknown estimator 'sensor'; expected one of ground_truth, kalman"):
        load("hover", ["autopilot.estimator=sensor"])
    text = DEAD_RECKONING.replace("        x, y", "        if time > 1.0: 1 / 0\n        x, y")
    output = "estimator own_estimator:DeadReckoning: ZeroDivisionError: division by zero"
    assert output in fly(scene(text, "DeadReckoning")).failure
