"""Considered static pressure error against the sensor model in drawn winds, and against a first-order process."""

import math

import numpy as np
import pytest

from lapwing.dynamics import atmosphere
from lapwing.dynamics.environment import STANDARD
from lapwing.dynamics.lie.quaternion import from_roll_pitch_yaw
from lapwing.dynamics.vector import ZERO
from lapwing.services.autopilot import estimator
from lapwing.services.autopilot.estimator import filter_state, static_pressure
from lapwing.services.sensors.barometer import StaticPressureError, position_error
from lapwing.services.sensors.sensor_inputs import Truth

pytestmark = pytest.mark.long

SHARES, WIND = StaticPressureError(), 9.5
P = estimator.PRESETS["rtk"]._replace(static_pressure_error=tuple(SHARES), wind_speed=WIND)
DENSITY = 1.225


def flying(p, velocity=ZERO, yaw=0.0, altitude=10.0):
    """Return the filter's state in level flight."""
    s = estimator.initial(p, estimator.new_memory(), ZERO, (0.0, 0.0, p.gravity), STANDARD.magnetic_field_world)
    attitude = from_roll_pitch_yaw(0.0, 0.0, yaw)
    return s._replace(
        nominal=s.nominal._replace(velocity_world=velocity, attitude=attitude, position_world=(0.0, 0.0, altitude))
    )


def sensor_height(velocity, yaw, wind):
    """Return the height error [m] of the sensor's model in a wind."""
    air = tuple(np.subtract(velocity, wind))
    truth = Truth(attitude=from_roll_pitch_yaw(0.0, 0.0, yaw), air_velocity_world=air, air_density=DENSITY)
    return -position_error(SHARES, truth) / (DENSITY * P.gravity)


def row(p, **situation):
    """Return the height error in still air, and the row of the considered parameters."""
    s = flying(p, **situation)
    s.memory.considered[filter_state.ROW] = 0.0
    height = static_pressure.static_pressure_height(p, s)
    return height, s.memory.considered[filter_state.ROW].copy(), s.memory.considered[filter_state.VARIANCE].copy()


@pytest.mark.parametrize("velocity", [(3.0, 0.0, 0.0), (-2.0, 4.0, 1.0)])
def test_own_motion_is_compensated_in_still_air(velocity):
    calm = P._replace(wind_speed=0.0)
    height, change, _ = row(calm, velocity=velocity, yaw=0.7)
    assert height == pytest.approx(sensor_height(velocity, 0.7, ZERO))
    assert not change.any()


@pytest.mark.parametrize(("velocity", "yaw"), [(ZERO, 0.5 * math.pi), (ZERO, math.pi), ((1.0, 0.0, 0.0), 0.0)])
def test_variance_of_change_in_steady_wind_equals_draws(velocity, yaw):
    """A turn in hover and a start from hover, in winds of the expected speed from all directions."""
    height, after, variance = row(P, velocity=velocity, yaw=yaw)
    start, before, _ = row(P)
    steady = slice(filter_state.WIND, filter_state.GUST)
    predicted = (after - before)[steady] ** 2 @ variance[steady]
    angles = np.linspace(0.0, 2.0 * np.pi, 360, endpoint=False)
    winds = [(WIND * math.cos(a), WIND * math.sin(a), 0.0) for a in angles]
    changes = [sensor_height(velocity, yaw, w) - sensor_height(ZERO, 0.0, w) - (height - start) for w in winds]
    assert predicted == pytest.approx(np.mean(np.square(changes)), rel=0.1)


def test_variance_by_gusts_equals_draws():
    _, change, _ = row(P)
    sigma = 0.1 * WIND / (0.177 + 0.000823 * 10.0 / 0.3048) ** 0.4  # MIL-F-8785C
    random, deviations = np.random.default_rng(1), []
    for a in np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False):
        mean = np.array([WIND * math.cos(a), WIND * math.sin(a), 0.0])
        gusts = np.pad(random.normal(size=(300, 2)) * sigma, ((0, 0), (0, 1)))
        deviations.append(np.var([sensor_height(ZERO, 0.0, tuple(mean + u)) for u in gusts]))
    assert change[filter_state.GUST] ** 2 == pytest.approx(np.mean(deviations), rel=0.1)


def test_barometer_innovations_are_consistent_in_gusts():
    """Readings with a first-order error of the expected deviation: without the model the mean NIS is above 20."""
    random, nis = np.random.default_rng(2), []
    _, change, _ = row(P)
    keep = math.exp(-5 * P.interval * WIND / static_pressure._turbulence(P, flying(P))[2])
    for _ in range(40):
        s = flying(P)
        gust = random.normal()
        s.memory.covariance[filter_state.POSITION + 2, filter_state.POSITION + 2] = 1e-4
        s.memory.covariance[filter_state.BAROMETER, filter_state.BAROMETER] = 2500.0
        for reading in range(500):
            for _ in range(5):
                static_pressure.decorrelate_gusts(P, s)
            gust = keep * gust + math.sqrt(1.0 - keep * keep) * random.normal()
            altitude = P.home.height + 10.0 + change[filter_state.GUST] * gust + 0.125 * random.normal()
            pressure = atmosphere.pressure(STANDARD.atmosphere, altitude)
            s = estimator.update_barometer(P, s, pressure, 1.5**2, True)
            if reading:
                nis.append(s.memory.nis[filter_state.BARO])
    assert np.mean(nis) == pytest.approx(1.0, abs=0.15)
