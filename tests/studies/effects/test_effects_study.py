"""The study of effects: differences in closed form, the smallest set on flights made up, and a real one."""

import json
import math
from pathlib import Path

import pytest
from synthetic_flights import moved

from lapwing.services.common.vehicle_schema import Effects
from lapwing.services.scene_resolver import load
from lapwing.studies.effects import console_output
from lapwing.studies.effects.influence import Influence, influence
from lapwing.studies.effects.procedure import Row, Study, _smallest
from lapwing.studies.effects.procedure import study as run_study
from lapwing.studies.effects.variants import refusal, variant
from lapwing.studies.simulate import fly
from lapwing.studies.terminal import console

HOVER = Path(__file__).parents[3] / "lapwing/scenes/hover.toml"


def test_difference_of_two_flights():
    found = influence(moved([0, 1, 2, 3]), moved([0, 1, 4, 2], power=110.0))
    assert found.trajectory == 2.0
    assert found.final == 1.0
    assert found.energy == pytest.approx(0.1)


def test_who_has_landed_earlier_stays_there():
    assert influence(moved([0, 1, 2]), moved([0, 1, 2, 5])).final == 3.0
    assert influence(moved([0, 1, 2, 5]), moved([0, 1])).trajectory == 4.0


def test_a_flight_without_end_is_infinitely_far():
    found = influence(moved([0, 1]), moved([0], failure="not finite at t = 1 s"))
    assert found.trajectory == math.inf
    assert found.failure == "not finite at t = 1 s"


class Crew:
    """Flights that are off by the sum of what the missing effects are worth."""

    def __init__(self, worth):
        self.worth = worth

    def fly(self, variants):
        return iter([moved([0, sum(w for n, w in self.worth.items() if n not in tables)]) for tables in variants])


def test_the_smallest_set_leaves_out_all_that_may_go_together():
    worth = {"a": 0.001, "b": 0.004, "c": 0.008, "d": 5.0}
    said = []
    kept, apart = _smallest(
        Crew(worth), {name: {} for name in worth}, moved([0, 0]), ["a", "b", "c"], 0.01, said.append
    )
    assert list(kept) == ["c", "d"]
    assert apart == pytest.approx(0.005)
    assert said == ["without a, b, c together", "without a, b together"]
    assert _smallest(Crew(worth), {name: {} for name in worth}, moved([0, 0]), [], 0.01, said.append)[1] == 0.0


def test_density_changes_a_real_flight_a_little():
    scene = load(HOVER, ["run.duration=2.0"])
    tables = dict(scene[Effects].tables)
    one, again, thinner = (fly(variant(scene, t)) for t in (tables, tables, tables | {"air_density": {}}))
    assert (one.truth.position == again.truth.position).all()
    assert 0.0 < influence(one, thinner).trajectory < 0.01
    # [J] what hovering takes is about the ideal power over the efficiency; here for less than 2 s
    assert 100.0 < one.energy < 4000.0


def test_effects_that_cannot_be_say_why():
    scene = load(HOVER)
    assert refusal(scene, {"gravity": {}, "gravity_altitude": {}}).startswith("effects.gravity_altitude: excludes")
    assert refusal(scene, {"wind_gust": {}}).startswith("effects.wind_gust.peak: ")
    assert refusal(scene, scene[Effects].tables) == ""


def study():
    rows = (
        Row("gravity", True, Influence(math.inf, math.inf, math.inf, "falls"), 1.0, 2.0),
        Row("wind", False, Influence(0.5, 0.1, 0.02), 20.0, 30.0),
        Row("gyroscopic_torque", False, Influence(0.00012, 0.00011, -0.0123), -1234.5, -1234.0),
        Row("gust", False, None, math.nan, math.nan, "gust.peak: field required"),
    )
    return Study("hover", 0.01, 80.0, 500.0, rows, ("gravity",), 0.0, 80.0, 500.0)


def test_table_json_and_plot(tmp_path, capsys):
    found = study()
    assert [row.name for row in found.missing] == ["wind"]
    console_output.show(console(80), found)
    text = capsys.readouterr().out
    assert max(map(len, text.splitlines())) <= 80
    assert "…" not in text  # no digit is cut
    assert "path [m]" in text
    assert "ends early" in text
    assert "not flown: gust.peak: field required" in text
    assert "Left out, and worth more than 0.01 m: wind" in text
    console_output.write_json(tmp_path / "study.json", found)
    data = json.loads((tmp_path / "study.json").read_text())
    assert data["missing"] == ["wind"]
    assert data["rows"][0]["influence"]["trajectory"] is None
    console_output.plot(tmp_path / "study.png", found)
    assert (tmp_path / "study.png").read_bytes().startswith(b"\x89PNG")


def test_a_system_without_effects_is_refused():
    with pytest.raises(ValueError, match=r"os4_motors.toml: the model os4 knows no effects"):
        run_study(load(HOVER.parent / "os4_motors.toml"), 0.01, print)
