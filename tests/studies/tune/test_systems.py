"""Frequency responses and margins of python-control against Lapwing's."""

import math
from pathlib import Path

import control
import numpy as np
import pytest

from lapwing.services.autopilot.controller_parameters import build
from lapwing.services.autopilot.gains import load
from lapwing.services.autopilot.margins import FREQUENCIES, margins, open_loops, stable
from lapwing.services.autopilot.nominal_airframe import known_airframe
from lapwing.services.scene_resolver import load as load_scene
from lapwing.studies.tune.systems import close_loop, step, systems

TICK, DELAY = 0.004, 1
SCENES = Path(__file__).parents[3] / "lapwing/scenes"


@pytest.fixture(scope="module", params=["hover", "delivery_mission"])
def airframe(request):
    return known_airframe(load_scene(SCENES / f"{request.param}.toml"))


@pytest.mark.parametrize("name", ["tuned", "paper"])
def test_responses_margins_and_stability_are_equal(name, airframe):
    p = build(load(name).plain(), airframe)
    responses = open_loops(p, airframe, TICK, DELAY)
    for loop, system in systems(p, airframe, TICK, DELAY).items():
        in_range = FREQUENCIES < 200.0
        response = system(1j * FREQUENCIES[in_range])
        assert np.allclose(response, responses[loop][in_range], rtol=1e-4), loop
        up, phase, _, _ = control.margin(system)
        m = margins(responses[loop])
        assert math.radians(phase) == pytest.approx(m.phase, abs=5e-3), loop
        assert any(up == pytest.approx(g, rel=5e-3) for g in (m.gain, m.reduction)), loop
        assert stable(responses[loop]) == (close_loop(system).poles().real.max() < 0.0), loop


def test_step_of_first_order_loop_is_closed_form():
    w = 4.0
    result = step(control.tf([w], [1.0, 0.0]), 3.0)
    assert np.allclose(result.value, 1.0 - np.exp(-w * result.time), atol=1e-6)
    assert result.rise == pytest.approx(math.log(9.0) / w, rel=0.02)
    assert result.overshoot == pytest.approx(0.0, abs=1e-4)


def test_steps_settle_at_setpoint(airframe):
    loops = systems(build(load("tuned").plain(), airframe), airframe, TICK, DELAY)
    for loop in ("altitude", "yaw", "x", "y"):
        assert step(loops[loop], 6.0).value[-1] == pytest.approx(1.0, abs=0.01)
