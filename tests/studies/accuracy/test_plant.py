"""Scenes with a multirotor as problems: accepted steps of five bodies, and order of the method."""

from pathlib import Path

import numpy as np
import pytest

from lapwing.services.plant.models.multibody import longest_step
from lapwing.services.scene_resolver import load
from lapwing.studies.accuracy import plant, scenes
from lapwing.studies.accuracy.coordinates import error

pytestmark = pytest.mark.long

HOVER = Path(__file__).parents[3] / "lapwing/scenes/hover.toml"


def test_five_bodies_use_steps_accepted_by_scene(monkeypatch):
    monkeypatch.setattr(plant.integrators, "compatible_methods", lambda p, x: ["rk4_renormalised"])
    scene = load(HOVER, ["vehicle.model=multibody", "solver.accuracy=1e-4"])
    problem = scenes.problem(scene)
    (method,) = problem.methods
    assert method.settings == pytest.approx([1e-3, 5e-4, 2.5e-4, 1.25e-4])
    assert method.settings[0] <= longest_step(scene) < 2.0 * method.settings[0]
    exact = problem.reference()
    errors = [error(method.read(h, method.prepare(h)()).samples[-1], exact) for h in method.settings]
    assert np.all(np.log2(np.array(errors[:-1]) / errors[1:]) > 3.7), errors
    for h in method.settings:
        load(HOVER, ["vehicle.model=multibody", f"solver.step={h!r}"])


def test_limits_of_motors_leave_order_of_method(monkeypatch):
    """Substeps at a limit are so fine that the measured error is that of the step."""
    monkeypatch.setattr(plant.integrators, "compatible_methods", lambda p, x: ["rk4_renormalised"])
    problem = plant.problem(load("os4_hover", ["solver.accuracy=1e-4"]), plant.jumping_voltages)
    (method,) = problem.methods
    exact = problem.reference()
    errors = [error(method.read(h, method.prepare(h)()).samples[-1], exact) for h in (4e-3, 2e-3, 1e-3)]
    assert np.all(np.log2(np.array(errors[:-1]) / errors[1:]) > 3.7), errors
