"""Pilot: signs of the sticks, and a flight of a point mass to a position and back to the ground."""

import math

import pytest

from lapwing.services.betaflight.packets import RC_HIGH, RC_LOW, RC_MIDDLE
from lapwing.services.betaflight.pilot import LOST_AFTER, Motion, Pilot
from lapwing.services.common.ports import Setpoint
from lapwing.services.scene_resolver import load, resolve

START = (0.0, 0.0, 0.04)
AT_REST = Motion(START, (0.0, 0.0, 0.0), 0.0)
INTERVAL = 0.01


@pytest.fixture(scope="module")
def pilot_setup():
    return resolve(load("betaflight_quad")).services["betaflight"].parameters.own


def flying(pilot_setup):
    pilot = Pilot(pilot_setup, START)
    pilot.step(1.0, INTERVAL, Setpoint((0.0, 0.0, 1.0)), AT_REST)
    assert pilot.stage == "flying"
    return pilot


def sticks(pilot_setup, position=(0.0, 0.0, 1.0), yaw=0.0, heading=0.0):
    motion = Motion((0.0, 0.0, 1.0), (0.0, 0.0, 0.0), heading)
    return flying(pilot_setup).step(1.0, INTERVAL, Setpoint(position, yaw=yaw), motion)


def test_target_ahead_lowers_nose(pilot_setup):
    result = sticks(pilot_setup, (1.0, 0.0, 1.0))
    assert result.pitch > RC_MIDDLE + 50
    assert (result.roll, result.yaw) == (RC_MIDDLE, RC_MIDDLE)


def test_target_to_left_rolls_left(pilot_setup):
    result = sticks(pilot_setup, (0.0, 1.0, 1.0))
    assert result.roll < RC_MIDDLE - 50
    assert result.pitch == RC_MIDDLE


def test_target_is_rotated_by_heading(pilot_setup):
    result = sticks(pilot_setup, (0.0, 1.0, 1.0), yaw=math.pi / 2, heading=math.pi / 2)
    assert result.pitch > RC_MIDDLE + 50
    assert result.roll == RC_MIDDLE


def test_higher_target_needs_more_throttle(pilot_setup):
    lower, level, higher = (sticks(pilot_setup, (0.0, 0.0, z)).throttle for z in (0.0, 1.0, 2.0))
    assert lower + 20 < level < higher - 20


def test_yaw_turns_the_shorter_way(pilot_setup):
    assert sticks(pilot_setup, yaw=0.5).yaw < RC_MIDDLE
    assert sticks(pilot_setup, yaw=-3.0, heading=3.0).yaw < RC_MIDDLE


def test_throttle_is_low_and_switch_open_at_start(pilot_setup):
    result = Pilot(pilot_setup, START).step(0.0, INTERVAL, Setpoint(START), AT_REST)
    assert (result.throttle, result.arm, result.angle) == (RC_LOW, RC_LOW, RC_HIGH)
    result = Pilot(pilot_setup, START).step(1.0, INTERVAL, Setpoint(START), AT_REST)
    assert (result.throttle, result.arm) == (RC_LOW, RC_HIGH)


def test_point_mass_flies_to_target_and_lands(pilot_setup):
    """Fly independent dynamics: tilt and thrust follow the sticks at once; losses are 10 % of the thrust."""
    pilot, g = Pilot(pilot_setup, START), pilot_setup.gravity
    x, v, t, farthest = list(START), [0.0, 0.0, 0.0], 0.0, 0.0
    while not pilot.finished and t < 40.0:
        expected = Setpoint((2.0, -1.0, 1.0)) if t < 12.0 else Setpoint((2.0, -1.0, START[2]), final=True)
        if t < 1.0:
            expected = Setpoint(START)
        s = pilot.step(t, INTERVAL, expected, Motion(tuple(x), tuple(v), 0.0))
        tilt = math.radians(pilot_setup.tilt_limit_deg)
        pitch, roll = ((c - RC_MIDDLE) / 500 * tilt for c in (s.pitch, s.roll))
        u = 0.055 + 0.945 * max(0, s.throttle - 1050) / 950 if s.arm == RC_HIGH else 0.0
        thrust = 0.9 * g * (u / pilot_setup.hover_output) ** 2
        a = (thrust * math.sin(pitch) * math.cos(roll), -thrust * math.sin(roll))
        up = thrust * math.cos(pitch) * math.cos(roll) - g
        for k, rate in enumerate((*a, up)):
            v[k] += rate * INTERVAL
            x[k] += v[k] * INTERVAL
        if x[2] <= START[2]:
            x[2], v[:] = START[2], [0.0, 0.0, 0.0]
        if 11.0 < t < 12.0:
            farthest = max(farthest, math.dist(x, (2.0, -1.0, 1.0)))
        t += INTERVAL
    assert pilot.finished
    assert farthest < 0.15
    assert math.dist(x, (2.0, -1.0, START[2])) < 0.15


def test_point_mass_without_position_descends_level_and_lands(pilot_setup):
    """The position is lost at 5 s in forward flight at 2 m; losses are 10 % of the thrust."""
    pilot, g = Pilot(pilot_setup, START), pilot_setup.gravity
    z, v, t, fastest = START[2], 0.0, 0.0, 0.0
    while not pilot.finished and t < 40.0:
        motion = Motion((0.0, 0.0, z), (1.0, 0.0, v), 0.0, max(0.0, t - 5.0), v)
        s = pilot.step(t, INTERVAL, Setpoint((5.0, 0.0, 2.0) if t > 1.0 else START), motion)
        if t > 5.0 + LOST_AFTER:
            assert (s.roll, s.pitch, s.yaw) == (RC_MIDDLE,) * 3
            fastest = min(fastest, v)
        u = 0.055 + 0.945 * max(0, s.throttle - 1050) / 950 if s.arm == RC_HIGH else 0.0
        v += (0.9 * g * (u / pilot_setup.hover_output) ** 2 - g) * INTERVAL
        z += v * INTERVAL
        if z <= START[2]:
            z, v = START[2], 0.0
        t += INTERVAL
    assert pilot.lost
    assert pilot.finished
    assert -1.5 < fastest < -0.5
    assert t < 15.0


def test_pilot_does_not_arm_without_position(pilot_setup):
    motion = AT_REST._replace(age=2.0)
    assert Pilot(pilot_setup, START).step(2.0, INTERVAL, Setpoint((0.0, 0.0, 1.0)), motion).arm == RC_LOW


def test_hover_throttle_matches_firmware(pilot_setup):
    """Betaflight 4.6.0 has the output 0.303 at 1300 us, recorded from the firmware: 5.5 % idle, from 1050 us on."""

    def output(throttle):
        return 0.055 + 0.945 * (throttle - 1050) / 950

    assert output(1300) == pytest.approx(0.303, abs=1e-3)
    assert output(sticks(pilot_setup).throttle) == pytest.approx(pilot_setup.hover_output, abs=1e-3)
