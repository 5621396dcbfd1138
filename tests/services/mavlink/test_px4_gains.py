"""Gains of PX4's cascade over MAVLink: listed with PX4's names and changed in flight."""

import math

import pytest
from adapter_harness import Station
from autopilot_harness import AutopilotBench

from lapwing.services.common.mavlink.dialect import mavlink

pytestmark = pytest.mark.long

NAN = math.nan


def roll_after_step(**gains):
    """Return the roll angles [rad] in the 2 s after a step of the velocity to the side, with gains set in flight."""
    bench = AutopilotBench("quad_x", 'autopilot.controller="px4"', "autopilot.estimator=ground_truth")
    station = bench.station_of(Station)
    bench.step(10)
    above = station.last("GLOBAL_POSITION_INT").alt * 1e-3
    assert station.command(400, 1.0) == 0
    assert station.command(22, -1.0, 0.0, 0.0, NAN, NAN, NAN, above + 5.0) == 0
    bench.step(150)
    for name, value in gains.items():
        station.send("param_set", 1, 1, name.encode(), value, mavlink.MAV_PARAM_TYPE_REAL32)
        bench.step(3)
        assert station.last("PARAM_VALUE").param_id == name
        assert station.last("PARAM_VALUE").param_value == pytest.approx(value)
    station.got.clear()
    for _ in range(50):
        station.send(
            "set_position_target_local_ned", 0, 1, 1, 1, 0xDC7, *[0.0] * 3, 3.0, *[0.0] * 7
        )  # north; the vehicle faces east
        station.send("set_mode", 1, 1, 6 << 16)
        bench.step()
    return [m.roll for m in station.all("ATTITUDE")]


def test_rate_gain_set_over_mavlink_acts():
    usual, weak = roll_after_step(), roll_after_step(MC_ROLLRATE_P=0.01, MC_ROLLRATE_I=0.0, MC_ROLLRATE_D=0.0)
    swing = [max(roll) - min(roll) for roll in (usual, weak)]
    assert 0.02 < swing[0] < 0.5
    assert swing[1] > 2.0 * swing[0] or swing[1] < 0.5 * swing[0]
