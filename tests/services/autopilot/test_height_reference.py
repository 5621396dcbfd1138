"""EKF2_HGT_REF: source of the height in flight, and height above a sloping ground."""

import numpy as np
import pytest
from flights import ENABLED, NAN, command, error, fly, fly_by_sensors, height, inject, place

from lapwing.dynamics.config_error import ConfigError
from lapwing.services.autopilot import estimator
from lapwing.services.autopilot.estimator import filter_state
from lapwing.services.autopilot.schema import NEEDED
from lapwing.services.common.failure_types import OFF, WRONG
from lapwing.services.scene_resolver import load

SONAR = "autopilot.parameters.EKF2_HGT_REF=2"
# the scene `groundstation`: other tests also compile its plant over a slope
EFFECTS = [f"effects.{name}={{}}" for name in ("air_density", "gyroscopic_torque", "battery")]
WIND = ["effects.random_wind_force.mean=[3.0,1.0,0.0]", "effects.random_wind_force.sigma=1.0"]
AHEAD = {0.04: [command("takeoff", 3.0), command("arm", NAN, 10.0)], 8: [command("goto", 14.0, 0.0, 3.0, 0.0, 2.0)]}


@pytest.mark.long
@pytest.mark.parametrize(("reference", "least", "most"), [(0, 0.03, 0.1), (1, 0.005, 0.02), (2, 0.03, 0.1)])
def test_height_source_follows_parameter(reference, least, most):
    up = {0.04: [command("takeoff", 15.0), command("arm", NAN, 10.0)]}  # beyond the sonar's reach
    sets = [f"EKF2_HGT_REF={reference}", "MPC_TKO_SPEED=3"]
    flight = fly_by_sensors(20, up, *[f"autopilot.parameters.{each}" for each in sets])
    spread = flight.column("estimate", lambda m: m.position_std.z)[flight.times("estimate") > 17.0].mean()
    assert least < spread < most  # the barometer is less accurate, and continues beyond the sonar's range
    assert error(flight, 15.0) < 0.3


def test_ground_variation_leaves_barometer_sum_unchanged():
    """The ground's variation changes only the variance of z, not of z + b_h or of other states."""
    p, rng = estimator.PRESETS["rtk"], np.random.default_rng(3)
    s = estimator.initial(p, estimator.new_memory(), (0.0, 0.0, 0.35), (0.0, 0.0, 9.81), p.magnetic_field_world)
    s = s._replace(nominal=s.nominal._replace(velocity_world=(3.0, 4.0, 1.0)))
    root = rng.normal(size=(filter_state.SIZE, filter_state.SIZE))
    s.memory.covariance[:] = root @ root.T
    s.memory.since[filter_state.SONAR] = 25
    before = s.memory.covariance.copy()
    estimator.follow_ground(p, s)
    z, b = filter_state.POSITION + 2, filter_state.BAROMETER
    added = s.memory.covariance - before
    dt = 25 * p.interval
    assert added[z, z] == pytest.approx((0.5**2 * 5.0**2 + 0.5**2) * dt**2)
    total = np.zeros(filter_state.SIZE)
    total[[z, b]] = 1.0
    assert total @ added @ total == pytest.approx(0.0, abs=1e-12)
    added[np.ix_([z, b], [z, b])] = 0.0
    assert not added.any()


@pytest.mark.long
def test_downward_rangefinder_replaces_sonar():
    sensors = [f"sensors.{name}={{}}" for name in (*NEEDED, "barometer")]
    laser = ["sensors.rangefinder.preset=lidar_lite_v3", "sensors.rangefinder.position=[0,0,-0.2]"]
    slope = "environment.terrain={slope=[0.1,0.0]}"
    flight = fly(17, AHEAD, SONAR, "autopilot.estimator=kalman", *sensors, *laser, slope, *EFFECTS, *WIND)
    x, _, z = place(flight, 17.0)
    assert x == pytest.approx(14.0, abs=0.2)
    assert z - 0.1 * x == pytest.approx(3.0, abs=0.15)


@pytest.mark.long
@pytest.mark.parametrize("ground", ["slope=[0.1,0.0]", "steps={distance=[4.0],rise=[0.6]}"])
def test_sonar_keeps_height_over_rising_ground(ground):
    flight = fly_by_sensors(17, AHEAD, SONAR, f"environment.terrain={{{ground}}}")
    x, _, z = place(flight, 17.0)
    assert x == pytest.approx(14.0, abs=0.2)
    rise = 0.1 * x if "slope" in ground else 0.6
    assert z - rise == pytest.approx(3.0, abs=0.15)


@pytest.mark.long
@pytest.mark.parametrize("unit", ["barometer", "distance_sensor"])
def test_other_height_sensor_replaces_failed_sensor(unit):
    kind = WRONG if unit == "barometer" else OFF
    flight = fly_by_sensors(14, {8: [inject(unit, kind)]}, SONAR, ENABLED)
    assert height(flight, 14.0) == pytest.approx(height(flight, 8.0), abs=0.2)


def test_missing_reference_is_rejected():
    with pytest.raises(ConfigError, match=r"EKF2_HGT_REF.*\[sensors\.sonar\]"):
        load("hover", [SONAR, "autopilot.estimator=kalman", *[f"sensors.{name}={{}}" for name in NEEDED]])
