"""Identification of a known plant from flights with several excitations."""

import re
from pathlib import Path

import pytest

from lapwing.services.autopilot.controller_parameters import build
from lapwing.services.autopilot.gains import load
from lapwing.services.autopilot.nominal_airframe import known_airframe
from lapwing.services.scene_resolver import load as load_scene
from lapwing.services.scene_resolver import parse
from lapwing.studies.simulate import fly
from lapwing.studies.tune.identify import identify
from lapwing.studies.tune.linearise import hover

SCENES = Path(__file__).parents[3] / "lapwing/scenes"
UP = '[[trajectory.phase]]\nname = "up"\nz = { kind = "minimum_jerk", to = 3.0, duration = 4.0 }\n'
CLOSE = {"altitude": 0.05, "roll": 0.05, "pitch": 0.05, "yaw": 0.05, "spin_up_zero": 0.15, "lag": 0.1}


def identify_scene(scene):
    return identify(fly(scene), build(load("tuned").plain(), known_airframe(scene)), hover(scene))


def excitation_scene(kind, overrides=()):
    """Return the scene `excitation` with steps or a square wave like that of a relay on every axis."""
    text = (SCENES / "excitation.toml").read_text()
    head = text[: text.index("[[trajectory.phase]]")]
    phases = [UP]
    for axis, size in (("z", 0.3), ("yaw", 0.3), ("x", 0.3), ("y", 0.3)):
        base = 3.0 if axis == "z" else 0.0
        count, pause = (1, 3.0) if kind == "step" else (6, 0.4)
        for k in range(2 * count):
            to = base + (size if k % 2 == 0 else 0.0)
            segment = f'{axis} = {{ kind = "step", to = {to} }}'
            phases.append(f'[[trajectory.phase]]\nname = "{axis}{k}"\nduration = {pause}\n{segment}\n')
    return parse(SCENES / "excited.toml", head + "".join(phases), ["run.duration=40.0", *overrides])


@pytest.mark.parametrize("kind", ["chirp", "step", "relay"])
def test_identified_gains_and_lag_equal_linear_model(kind):
    scene = load_scene(SCENES / "excitation.toml") if kind == "chirp" else excitation_scene(kind)
    true, result = hover(scene), identify_scene(scene)
    for name, within in CLOSE.items():
        assert getattr(result.model, name) == pytest.approx(getattr(true, name), rel=within), name
    assert min(result.fit.values()) > 75.0


def test_heavier_vehicle_is_identified(tmp_path):
    airframe = (SCENES / "vehicles" / "delivery_drone.toml").read_text()
    heavy_file = tmp_path / "heavy.toml"
    heavy_file.write_text(re.sub(r"^total = .*$", "total = 12.0", airframe, count=1, flags=re.MULTILINE))
    light = load_scene(SCENES / "excitation.toml")
    heavy = load_scene(SCENES / "excitation.toml", [f"vehicle.airframe={heavy_file}"])
    result = identify(fly(heavy), build(load("tuned").plain(), known_airframe(light)), hover(light))
    assert result.model.altitude == pytest.approx(hover(heavy).altitude, rel=0.03)
    assert result.model.altitude == pytest.approx(4.0 / 12.0, rel=0.03)


def test_log_without_excitation_is_rejected():
    scene = load_scene(SCENES / "hover.toml")
    with pytest.raises(ValueError, match=r"hover: roll is not excited .* use a log of the scene excitation"):
        identify_scene(scene)
