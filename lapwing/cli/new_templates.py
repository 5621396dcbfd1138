"""Templates of `lapwing new`: a module that works and its test, by kind of extension."""

EFFECT = '''"""Linear air drag, an effect for Lapwing scenes.

In a scene in the same folder:

    [effects.{name}]
    module = "{name}"
    coefficient = 0.5
"""

from typing import Annotated, NamedTuple

from annotated_types import Ge

from lapwing.plugins import ZERO, scale, subtract, wrench


class {cls}(NamedTuple):
    """Keys of the scene table, checked against their annotations."""

    coefficient: Annotated[float, Ge(0)] = 0.5  # [N s/m]


@wrench({cls})
def {name}(e, memory, s, rotors):
    """Return the force [N], world, and the torque [N m], body, at the centre of mass.

    Args:
        e: {cls}.
        memory: discrete state of the effect, () if it has none.
        s: lapwing.plugins.EffectInputs: s.t [s], s.motion, s.air, ...
        rotors: thrust, torque and current of each rotor.
    """
    airspeed_world = subtract(s.motion.velocity_world, s.air.wind_world)
    return scale(-e.coefficient, airspeed_world), ZERO
'''

EFFECT_TEST = '''"""Tests of the effect {name}."""

from pathlib import Path
from types import SimpleNamespace

import pytest

import lapwing
from lapwing.plugins import python_function


@pytest.fixture(autouse=True)
def module_path(monkeypatch):
    monkeypatch.syspath_prepend(Path(__file__).parent)


def fly(coefficient):
    effect = {{"effects.{name}.module": "{name}", "effects.{name}.coefficient": coefficient}}
    return lapwing.fly("hover", {{**effect, "effects.wind_constant.velocity": [5.0, 0.0, 0.0]}})


def test_force_opposes_airspeed():
    from {name} import {cls}, {name}

    s = SimpleNamespace(
        motion=SimpleNamespace(velocity_world=(1.0, 0.0, 0.0)), air=SimpleNamespace(wind_world=(0.0, 2.0, 0.0))
    )
    force_world, torque_body = python_function({name})({cls}(0.5), (), s, None)
    assert force_world == (-0.5, 1.0, 0.0)
    assert torque_body == (0.0, 0.0, 0.0)


def test_wind_displaces_vehicle():
    assert fly(2.0).rmse["x"] > 10.0 * fly(0.0).rmse["x"]


def test_negative_coefficient_is_rejected():
    with pytest.raises(lapwing.SceneError, match="effects.{name}.coefficient"):
        fly(-1.0)
'''

SENSOR = '''"""Speed sensor with white noise, a sensor for Lapwing scenes.

In a scene in the same folder:

    [sensors.{name}]
    module = "{name}"
    deviation = 0.1
"""

from typing import NamedTuple

from lapwing.plugins import kernel, norm, normal


class {cls}(NamedTuple):
    """Keys of the scene table."""

    deviation: float = 0.0  # [m/s] of the white noise
    rate: float = 50.0  # [Hz]


class {cls}Reading(NamedTuple):
    """One reading."""

    speed: float = 0.0  # [m/s]
    valid: bool = False


class State(NamedTuple):
    """State between two readings."""

    samples: float = 0.0


PRESETS = {{"ideal": {cls}(), "noisy": {cls}(0.1)}}  # the first is the default
READING = {cls}Reading()


def blank():
    """Return a state of the right type."""
    return State()


@kernel
def initial(p, key, truth):
    """Return the state at the start of a run."""
    return State(0.0)


@kernel
def sample(p, s, key, tick, truth):
    """Return the next state and the reading.

    Args:
        p: {cls}.
        s: State.
        key: key of this sensor's random numbers.
        tick: index of the reading's tick.
        truth: lapwing.plugins.TrueState.
    """
    speed = norm(truth.velocity_world) + p.deviation * normal(key, tick, 0)
    return State(s.samples + 1.0), {cls}Reading(speed, True)
'''

SENSOR_TEST = '''"""Tests of the sensor {name}."""

from pathlib import Path

import numpy as np
import pytest

import lapwing


@pytest.fixture(autouse=True)
def module_path(monkeypatch):
    monkeypatch.syspath_prepend(Path(__file__).parent)


def readings(**keys):
    keys = {{"module": "{name}", **keys}}
    flight = lapwing.fly("hover", {{f"sensors.{name}.{{key}}": value for key, value in keys.items()}})
    return flight, flight.topic("custom_sensor/{name}")["values"][:, 0]


def test_ideal_sensor_measures_the_speed():
    flight, speed = readings()
    assert speed == pytest.approx(np.linalg.norm(flight.truth["velocity"][::5], axis=1))


def test_noise_has_its_deviation():
    noise = readings(deviation=0.5)[1] - readings()[1]
    assert noise.std() == pytest.approx(0.5, rel=0.2)
'''

CONTROLLER = '''"""Cascaded position and attitude controller, for Lapwing scenes.

In a scene in the same folder:

    [autopilot]
    controller = "{name}:{cls}"
    [autopilot.controller_options]
    position = 2.0
"""

import math

import numpy as np

from lapwing.plugins import Reference, StateEstimate, ThrustAndMoments, VehicleModel


class {cls}:
    """Proportional-derivative loops for position and attitude, each critically damped."""

    rate = 250.0  # [Hz], divides the communication rate

    def __init__(self, vehicle: VehicleModel, position: float = 1.5, attitude: float = 8.0):
        """Create the controller at a take-off.

        Args:
            vehicle: nominal parameters.
            position: bandwidth of the position loop [rad/s].
            attitude: bandwidth of the attitude loop [rad/s].
        """
        self.vehicle, self.position, self.attitude = vehicle, position, attitude

    def step(self, time: float, estimate: StateEstimate, setpoint: Reference) -> ThrustAndMoments:
        """Return thrust [N] and moments [N m], body, at `time` [s]."""
        gravity, b = self.vehicle.gravity, self.position
        position = np.subtract(setpoint.position_world, estimate.position_world)
        velocity = np.subtract(setpoint.velocity_world, estimate.velocity_world)
        ax, ay, az = np.add(setpoint.acceleration_world, b * b * position + 2.0 * b * velocity)
        w, x, y, z = estimate.attitude
        roll = math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
        pitch = math.asin(max(-1.0, min(1.0, 2.0 * (w * y - x * z))))
        yaw = math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
        c, s = math.cos(yaw), math.sin(yaw)
        limit = 0.4  # [rad]
        desired_pitch = max(-limit, min(limit, (c * ax + s * ay) / gravity))
        desired_roll = max(-limit, min(limit, (s * ax - c * ay) / gravity))
        turn = (setpoint.yaw - yaw + math.pi) % (2.0 * math.pi) - math.pi
        angles = np.array([desired_roll - roll, desired_pitch - pitch, turn])
        bandwidth = self.attitude * np.array([1.0, 1.0, 0.3])
        moments = self.vehicle.inertia_body * (bandwidth**2 * angles - 2.0 * bandwidth * estimate.omega_body)
        thrust = self.vehicle.mass * (gravity + az) / max(math.cos(roll) * math.cos(pitch), 0.5)
        return ThrustAndMoments(thrust, tuple(moments), (desired_roll, desired_pitch))
'''

CONTROLLER_TEST = '''"""Tests of the controller {name}."""

from pathlib import Path

import pytest

import lapwing


@pytest.fixture(autouse=True)
def module_path(monkeypatch):
    monkeypatch.syspath_prepend(Path(__file__).parent)


def test_controller_follows_the_trajectory():
    flight = lapwing.fly("hover", {{"autopilot.controller": "{name}:{cls}"}})
    assert flight.outcome.kind == "landed"
    assert flight.rmse["z"] < 0.2


def test_unknown_option_is_rejected():
    with pytest.raises(lapwing.SceneError, match="controller_options"):
        lapwing.fly("hover", {{"autopilot.controller": "{name}:{cls}", "autopilot.controller_options.gain": 1.0}})
'''

ESTIMATOR = '''"""Inertial navigation with GPS velocity, an estimator for Lapwing scenes.

In a scene in the same folder, with an IMU and GPS:

    [autopilot]
    estimator = "{name}:{cls}"
"""

import numpy as np

from lapwing.plugins import StateEstimate, VehicleModel


class {cls}:
    """Integrates the IMU from rest, and corrects the velocity with the GPS."""

    rate = 250.0  # [Hz], divides the communication rate

    def __init__(self, vehicle: VehicleModel, correction: float = 1.0):
        """Create the estimator at rest on the ground.

        Args:
            vehicle: nominal parameters.
            correction: bandwidth of the velocity correction [rad/s].
        """
        self.gravity, self.correction = np.array([0.0, 0.0, vehicle.gravity]), correction
        self.position, self.velocity = np.array([0.0, 0.0, vehicle.resting_height]), np.zeros(3)
        self.attitude = np.array([1.0, 0.0, 0.0, 0.0])  # w, x, y, z, body to world

    def step(self, time: float, readings: dict) -> StateEstimate:
        """Return the estimate at `time` [s] from the newest reading of each sensor, by its name."""
        imu, gps = readings.get("imu"), readings.get("gps")
        if imu is None or not imu.valid:
            return self.estimate(np.zeros(3), np.zeros(3))
        interval, omega = 1.0 / self.rate, np.array(imu.omega_body)
        w, x, y, z = self.attitude
        p, q, r = omega
        change = np.array([-x * p - y * q - z * r, w * p + y * r - z * q, w * q + z * p - x * r, w * r + x * q - y * p])
        self.attitude = self.attitude + 0.5 * interval * change
        self.attitude /= np.linalg.norm(self.attitude)
        acceleration = self.to_world(np.array(imu.specific_force_body)) - self.gravity
        self.velocity = self.velocity + interval * acceleration
        if gps is not None and gps.valid:
            self.velocity += interval * self.correction * (np.array(gps.velocity_world) - self.velocity)
        self.position = self.position + interval * self.velocity
        return self.estimate(omega, acceleration)

    def to_world(self, vector: np.ndarray) -> np.ndarray:
        """Return a body vector in world coordinates."""
        w, v = self.attitude[0], self.attitude[1:]
        return vector + 2.0 * np.cross(v, np.cross(v, vector) + w * vector)

    def estimate(self, omega: np.ndarray, acceleration: np.ndarray) -> StateEstimate:
        """Return the present estimate."""
        values = {{
            "position_world": self.position,
            "attitude": self.attitude,
            "velocity_world": self.velocity,
            "omega_body": omega,
            "acceleration_world": acceleration,
        }}
        return StateEstimate(**{{name: tuple(value) for name, value in values.items()}})
'''

ESTIMATOR_TEST = '''"""Tests of the estimator {name}."""

from pathlib import Path

import numpy as np
import pytest

import lapwing


@pytest.fixture(autouse=True)
def module_path(monkeypatch):
    monkeypatch.syspath_prepend(Path(__file__).parent)


def test_estimate_follows_the_true_position():
    sensors = {{"sensors.imu.preset": "ideal", "sensors.gps.preset": "rtk"}}
    flight = lapwing.fly("hover", {{"autopilot.estimator": "{name}:{cls}", **sensors}})
    assert flight.outcome.kind == "landed"
    estimate, truth = flight.topic("estimate"), flight.truth
    true = np.array([np.interp(estimate.times, truth.times, truth.position[:, k]) for k in range(3)]).T
    in_flight = estimate.times < 8.0  # [s] before touch-down
    assert np.linalg.norm(estimate["pose.position"] - true, axis=1)[in_flight].max() < 0.1
'''

TEMPLATES = {
    "effect": (EFFECT, EFFECT_TEST),
    "sensor": (SENSOR, SENSOR_TEST),
    "controller": (CONTROLLER, CONTROLLER_TEST),
    "estimator": (ESTIMATOR, ESTIMATOR_TEST),
}
