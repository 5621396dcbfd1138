"""The compiled closed loop gives the services' numbers to the last bit."""

from pathlib import Path

import numpy as np
import pytest

from messages.topics import ACTUATORS, ESTIMATE, SETPOINT, TRUTH
from services.scene import load
from services.single import run_single
from services.table import lockstep_services
from studies.campaign.flight import fly
from studies.flight import Messages

SCENES = Path("scenes")
HOVER = ["trajectory.phase.1.duration=1.0"]


def by_services(scene):
    messages = Messages(scene, (TRUTH, ACTUATORS, ESTIMATE, SETPOINT))
    run_single(scene, lockstep_services(scene), messages, None, lambda *_: False)
    return messages.of


def same(scene):
    flown, said = fly(scene), by_services(scene)
    r = flown.record
    truth, actuators, estimates = said[TRUTH], said[ACTUATORS], said[ESTIMATE]
    assert len(r.power) == len(truth) == len(actuators)
    assert np.array_equal(r.position_world, [m.pose.position for m in truth])
    assert np.array_equal(r.attitude[:, [1, 2, 3, 0]], [m.pose.orientation for m in truth])
    assert np.array_equal(r.velocity_world, [m.velocity for m in truth])
    assert np.array_equal(r.omega_body, [m.angular_velocity for m in truth])
    assert np.array_equal(r.motor_voltage, [m.motor_voltage for m in actuators])
    assert np.array_equal(r.armed, [m.armed for m in actuators])
    every = round((len(r.power) - 1) / (len(estimates) - 1))
    assert np.array_equal(r.estimated_world[::every], [m.pose.position for m in estimates])
    assert np.array_equal(r.position_std[::every], [m.position_std for m in estimates])
    assert np.array_equal(r.health[::every], [m.health for m in estimates])
    assert np.array_equal(r.setpoint_world[:, :3], [m.position for m in said[SETPOINT]][: len(r.power)])
    return flown


@pytest.mark.parametrize("coupling", ["sequential", "parallel"])
def test_same_bits_on_sensors_and_the_same_end(coupling):
    flown = same(load(SCENES / "delivery_mission.toml", [f"exchange.coupling={coupling}", "run.seed=7"]))
    assert flown.finite
    assert flown.finished
