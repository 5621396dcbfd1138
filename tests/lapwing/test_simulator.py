"""Stepping a vehicle by hand: free fall, hovering thrust, setpoints, and the same bits after a reset."""

import math
import re

import numpy as np
import pytest

import lapwing
from lapwing.services.common.ports import Reference
from lapwing.simulator import Simulator

STILL = {"autopilot.estimator": "ground_truth"}


def test_without_voltage_in_the_air_it_falls_as_galileo_says():
    sim = Simulator("hover", {"effects": {"gravity": {}, "rotor_thrust": {}}}, seed=1)
    seen = sim.step(motor_voltages=(0.0,) * 4, ticks=251)
    start = sim.setup.services["plant"].parameters.start.vehicle.motion.position_world[2]
    assert seen.time == pytest.approx(1.0)
    assert seen.truth.position_world[2] - start == pytest.approx(-0.5 * 9.80665, rel=1e-3)


def test_a_setpoint_is_followed_and_a_reset_gives_the_same_bits():
    sim = Simulator("hover", STILL)
    up = Reference(position_world=(0.0, 0.0, 1.5))
    first = sim.step(setpoint=up, ticks=1500)
    assert first.truth.position_world[2] == pytest.approx(1.5, abs=0.1)
    assert sim.reset().step(setpoint=up, ticks=1500) == first


def test_what_cannot_be_is_refused():
    sim = Simulator("hover")
    with pytest.raises(ValueError, match="and not both"):
        sim.step()
    sim.step(motor_voltages=(0.0,) * 4)
    with pytest.raises(ValueError, match="as before"):
        sim.step(setpoint=Reference())
    with pytest.raises(ValueError, match=r"motor_voltages\[1\] = nan at t = 0.004 s: must be finite"):
        sim.step(motor_voltages=(0.0, float("nan"), 0.0, 0.0))
    with pytest.raises(ValueError, match="nobody steers"):
        Simulator("gyrostat_blocked")


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"motor_voltages": (1.0, 2.0)}, "motor_voltages: expected 4 numbers [V], got (1.0, 2.0)"),
        ({"motor_voltages": (1.0, 2.0, 3.0, math.nan)}, "motor_voltages[3] = nan at t = 0 s: must be finite"),
        ({"motor_voltages": 5.0}, "motor_voltages: expected 4 numbers [V], got 5.0"),
        ({"setpoint": (0.0, 0.0, 1.0)}, "setpoint: expected a Reference of finite numbers"),
        ({"setpoint": lapwing.Reference((0.0, 0.0))}, "setpoint: expected a Reference of finite numbers"),
        ({"setpoint": lapwing.Reference((0.0, 0.0, math.inf))}, "setpoint: expected a Reference of finite numbers"),
        ({"setpoint": lapwing.Reference(), "ticks": 0}, "step: expected ticks = 1, 2, ..., got 0"),
    ],
)
def test_a_command_that_is_not_sound_is_refused(given, said):
    with pytest.raises(ValueError, match=re.escape(said)):
        lapwing.Simulator("hover").step(**given)


def test_positions_may_be_arrays_and_a_scene_may_be_loaded():
    place = np.array([0.0, 0.0, 1.0])
    ends = [
        lapwing.Simulator(scene, seed=2).step(setpoint=lapwing.Reference(position), ticks=50).truth
        for scene, position in (("hover", tuple(place)), (lapwing.load_scene("hover"), place))
    ]
    assert ends[0] == ends[1]
