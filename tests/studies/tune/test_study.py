from pathlib import Path

import pytest

from services.autopilot.gains import load
from services.scene import load as load_scene
from studies.flight import fly
from studies.tune.design import Bandwidths
from studies.tune.study import tune, write

SCENES = Path(__file__).parents[3] / "scenes"


def test_what_is_written_can_be_read_and_flown(tmp_path):
    path = tmp_path / "new.toml"
    scene = load_scene(SCENES / "hover.toml")
    found = tune(scene, Bandwidths(), lambda _: None)
    write(path, found.gains)
    assert load(str(path)) == found.gains
    flown = fly(load_scene(SCENES / "hover.toml", [f"autopilot.gains={path}"]))
    assert flown.failure == ""
    stand = flown.position_world[0, 2]
    assert flown.position_world[:, 2].max() - stand == pytest.approx(1.0, abs=0.05)


def test_weak_gains_of_the_scene_are_warned_about_with_the_margin():
    said = []
    tune(load_scene(SCENES / "hover.toml", ["autopilot.gains=paper"]), Bandwidths(), said.append)
    assert any(line.startswith("warning: gains paper: roll: phase margin 2") for line in said)


def test_bad_input_is_one_line():
    with pytest.raises(ValueError, match=r"^--lift -1: expected a bandwidth above 0 rad/s$"):
        tune(load_scene(SCENES / "hover.toml"), Bandwidths(lift=-1.0), lambda _: None)
    with pytest.raises(ValueError, match=r"has no \[autopilot\] to tune"):
        tune(load_scene(SCENES / "gyrostat_attitude.toml"), Bandwidths(), lambda _: None)
