"""Stepping of one vehicle: free fall, hover thrust, setpoints, and bit-for-bit identical steps after a reset."""

import math
import re

import numpy as np
import pytest

import lapwing
from lapwing.api.simulator import Simulator
from lapwing.services.common.ports import Setpoint

STILL = {"autopilot.estimator": "ground_truth"}


def test_vehicle_without_voltage_is_in_free_fall():
    sim = Simulator("hover", {"effects": {"gravity": {}, "rotor_thrust": {}}}, seed=1)
    seen = sim.step(motor_voltages=(0.0,) * 4, ticks=251)
    start = sim.config.services["plant"].parameters.start.vehicle.motion.position_world[2]
    assert seen.time == pytest.approx(1.0)
    assert seen.truth.position_world[2] - start == pytest.approx(-0.5 * 9.80665, rel=1e-3)


def test_setpoint_is_followed_and_reset_is_exact():
    sim = Simulator("hover", STILL)
    up = Setpoint(position_world=(0.0, 0.0, 1.5))
    first = sim.step(setpoint=up, ticks=1500)
    assert first.truth.position_world[2] == pytest.approx(1.5, abs=0.1)
    assert sim.reset().step(setpoint=up, ticks=1500) == first


def test_invalid_simulator_arguments_are_rejected():
    sim = Simulator("hover")
    with pytest.raises(ValueError, match="and not both"):
        sim.step()
    sim.step(motor_voltages=(0.0,) * 4)
    with pytest.raises(ValueError, match="as before"):
        sim.step(setpoint=Setpoint())
    with pytest.raises(ValueError, match=r"motor_voltages\[1\] = nan at t = 0.004 s: must be finite"):
        sim.step(motor_voltages=(0.0, float("nan"), 0.0, 0.0))
    with pytest.raises(ValueError, match="has no autopilot"):
        Simulator("gyrostat_blocked")


@pytest.mark.parametrize(
    ("values", "text"),
    [
        ({"motor_voltages": (1.0, 2.0)}, "motor_voltages: expected 4 numbers [V], got (1.0, 2.0)"),
        ({"motor_voltages": (1.0, 2.0, 3.0, math.nan)}, "motor_voltages[3] = nan at t = 0 s: must be finite"),
        ({"motor_voltages": 5.0}, "motor_voltages: expected 4 numbers [V], got 5.0"),
        ({"setpoint": (0.0, 0.0, 1.0)}, "setpoint: expected a Setpoint of finite numbers"),
        ({"setpoint": lapwing.Setpoint((0.0, 0.0))}, "setpoint: expected a Setpoint of finite numbers"),
        ({"setpoint": lapwing.Setpoint((0.0, 0.0, math.inf))}, "setpoint: expected a Setpoint of finite numbers"),
        ({"setpoint": lapwing.Setpoint(), "ticks": 0}, "step: expected ticks = 1, 2, ..., got 0"),
    ],
)
def test_non_finite_command_is_rejected(values, text):
    with pytest.raises(ValueError, match=re.escape(text)):
        lapwing.Simulator("hover").step(**values)


def test_positions_may_be_arrays_and_scene_may_be_loaded():
    place = np.array([0.0, 0.0, 1.0])
    ends = [
        lapwing.Simulator(scene, seed=2).step(setpoint=lapwing.Setpoint(position), ticks=50).truth
        for scene, position in (("hover", tuple(place)), (lapwing.load_scene("hover"), place))
    ]
    assert ends[0] == ends[1]
