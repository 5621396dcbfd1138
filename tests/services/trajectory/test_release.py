"""Payload release by trajectory phases."""

import numpy as np
import pytest

from lapwing.services.scene_resolver import load
from lapwing.studies.simulate import fly


def height(to):
    return {"kind": "minimum_jerk", "to": to, "duration": 3.0}


@pytest.mark.long
def test_payload_is_released_only_on_ground():
    phases = [
        {"name": "climb", "z": height(1.0)},
        {"name": "hover", "duration": 3.0, "release": True},
        {"name": "descend", "z": height(0.0), "release": True},
        {"name": "stand", "duration": 2.0, "release": True},
        {"name": "climb again", "z": height(1.0)},
        {"name": "hover again", "duration": 3.0},
        {"name": "descend again", "z": height(0.0)},
    ]
    flight = fly(load("hover", {"effects.payload_release": {}, "trajectory.phase": phases, "run.duration": 18.0}))
    t, thrust = flight.config.interval * np.arange(len(flight.truth)), flight.truth.rotor_thrust.sum(axis=1)
    first, second = ((t > begin) & (t < begin + 1.0) for begin in (4.5, 15.5))
    weight = [mass * 9.80665 for mass in (10.0224, 8.0224)]
    assert [thrust[first].mean(), thrust[second].mean()] == pytest.approx(weight, rel=0.01)
