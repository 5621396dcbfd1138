"""Effects study: differences in closed form, the smallest set for synthetic flights, and a real flight."""

import contextlib
import json
import math
import subprocess
import sys
from pathlib import Path

import pytest
from synthetic_flights import moved

from lapwing.dynamics import effects
from lapwing.services.common.vehicle_schema import Effects
from lapwing.services.scene_resolver import load
from lapwing.studies.effects import console_output, procedure
from lapwing.studies.effects.cost import Cost
from lapwing.studies.effects.procedure import Influence, Row, Study, _smallest, influence
from lapwing.studies.effects.procedure import study as run_study
from lapwing.studies.effects.variants import check_effects, variant
from lapwing.studies.simulate import fly
from lapwing.studies.terminal import console

HOVER = Path(__file__).parents[3] / "lapwing/scenes/hover.toml"


def test_difference_of_two_flights():
    result = influence(moved([0, 1, 2, 3]), moved([0, 1, 4, 2], power=110.0))
    assert result.trajectory == 2.0
    assert result.final == 1.0
    assert result.energy == pytest.approx(0.1)


def test_landed_vehicle_stays_landed():
    assert influence(moved([0, 1, 2]), moved([0, 1, 2, 5])).final == 3.0
    assert influence(moved([0, 1, 2, 5]), moved([0, 1])).trajectory == 4.0


def test_failed_flight_has_infinite_influence():
    result = influence(moved([0, 1]), moved([0], failure="not finite at t = 1 s"))
    assert result.trajectory == math.inf
    assert result.failure == "not finite at t = 1 s"


class FakePool:
    """Pool whose flights differ by the sum of the influences of the missing effects."""

    def __init__(self, influences):
        self.worth = influences

    def fly(self, variants):
        return iter([moved([0, sum(w for n, w in self.worth.items() if n not in tables)]) for tables in variants])


def test_smallest_set_omits_effects_that_are_small_together():
    influences = {"a": 0.001, "b": 0.004, "c": 0.008, "d": 5.0}
    output = []
    remaining, distance = _smallest(
        FakePool(influences), {name: {} for name in influences}, moved([0, 0]), ["a", "b", "c"], 0.01, output.append
    )
    assert list(remaining) == ["c", "d"]
    assert distance == pytest.approx(0.005)
    assert output == ["without a, b, c together", "without a, b together"]
    assert (
        _smallest(FakePool(influences), {name: {} for name in influences}, moved([0, 0]), [], 0.01, output.append)[1]
        == 0.0
    )


@pytest.mark.long
def test_density_changes_real_flight_little():
    scene = load(HOVER, ["run.duration=2.0"])
    tables = dict(scene[Effects].tables)
    first, repeated, thinner = (fly(variant(scene, t)) for t in (tables, tables, tables | {"air_density": {}}))
    assert (first.truth.position == repeated.truth.position).all()
    assert 0.0 < influence(first, thinner).trajectory < 0.01
    # [J] about the ideal hover power over the efficiency, for less than 2 s
    assert 100.0 < first.energy < 4000.0


def test_invalid_effects_return_error():
    scene = load(HOVER)
    assert check_effects(scene, {"gravity": {}, "gravity_altitude": {}}).startswith(
        "effects.gravity_altitude: cannot be combined with"
    )
    assert check_effects(scene, {"wind_gust": {}}).startswith("effects.wind_gust.peak: ")
    assert check_effects(scene, scene[Effects].tables) == ""


@pytest.fixture
def synthetic_flights(monkeypatch):
    """Flights and costs of variants without a simulation."""

    class Same:
        def fly(self, variants):
            return (moved([0.0, 1.0]) for _ in variants)

    monkeypatch.setattr(procedure, "variant_pool", lambda scene: contextlib.nullcontext(Same()))
    monkeypatch.setattr(procedure, "costs", lambda scene, variants: [Cost(1.0, 1.0, 0.1, 0.1)] * len(variants))


@pytest.mark.usefixtures("synthetic_flights")
def test_only_selected_effects_are_studied():
    rows = run_study(load(HOVER), 0.01, lambda *_: None, ["gravity", "body_drag", "collision"]).rows
    assert [(row.name, row.active) for row in rows] == [("gravity", True), ("body_drag", False), ("collision", False)]
    with pytest.raises(ValueError, match="unknown effect 'bodydrag'; did you mean body_drag"):
        run_study(load(HOVER), 0.01, lambda *_: None, ["bodydrag"])


@pytest.mark.usefixtures("synthetic_flights")
def test_every_effect_of_catalogue_is_listed():
    """Effects that cannot be flown have a remark."""
    result = run_study(load(HOVER), 0.01, lambda *_: None)
    rows = {row.name: row for row in result.rows}
    assert sorted(rows) == effects.names()
    for name in ("multirotor_ground_effect", "vortex_ring", "dc_motor", "battery_thevenin"):
        assert rows[name].influence is not None
    assert rows["ceiling_effect"].remark.startswith("effects.ceiling_effect.height: missing")
    assert rows["collision"].remark == "effects.collision: requires other vehicles"
    assert rows["downwash"].remark == "effects.downwash: requires other vehicles"


@pytest.mark.usefixtures("synthetic_flights")
@pytest.mark.parametrize(("table", "active"), [("{}", False), ("{inductance=1e-5, braking_current=5.0}", True)])
def test_options_of_effects_are_studied(table, active):
    scene = load(HOVER, [f"effects.dc_motor={table}", "effects.battery_thevenin={peukert_exponent=1.1}"])
    result = run_study(scene, 0.01, lambda *_: None, ["dc_motor", "battery_thevenin"])
    rows = {row.name: row.active for row in result.rows if not row.remark}
    assert rows["dc_motor.inductance"] == rows["dc_motor.braking_current"] == active
    assert rows["battery_thevenin.peukert_exponent"]
    assert set(result.smallest) <= set(scene[Effects].tables)


@pytest.mark.long
def test_command_shows_influence_of_motor_options(tmp_path):
    path = tmp_path / "effects.json"
    scene = ["hover", "--set", "effects.dc_motor={}", "--set", "run.duration=1.0", "--only", "dc_motor"]
    command = [sys.executable, "-m", "lapwing", "effects", *scene, "--json", str(path)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=900, check=False)
    assert done.returncode == 0, done.stderr
    rows = {row["name"]: row for row in json.loads(path.read_text())["rows"]}
    assert 0.0 < rows["dc_motor.inductance"]["influence"]["trajectory"] < 0.01
    assert "…" not in done.stdout  # no number is cut


def study():
    rows = (
        Row("gravity", True, Influence(math.inf, math.inf, math.inf, "falls"), 1.0, 2.0),
        Row("wind", False, Influence(0.5, 0.1, 0.02), 20.0, 30.0),
        Row("gyroscopic_torque", False, Influence(0.00012, 0.00011, -0.0123), -1234.5, -1234.0),
        Row("gust", False, None, math.nan, math.nan, "gust.peak: field required"),
    )
    return Study("hover", 0.01, 80.0, 500.0, rows, ("gravity",), 0.0, 80.0, 500.0, (1.5, 3.0))


def test_table_json_and_plot(tmp_path, capsys):
    result = study()
    assert [row.name for row in result.missing] == ["wind"]
    console_output.show(console(80), result)
    text = capsys.readouterr().out
    assert max(map(len, text.splitlines())) <= 80
    assert "…" not in text  # no number is cut
    assert "path [m]" in text
    assert "ends early" in text
    assert "< 1.5" in text  # cost of gravity, below the resolution of the measurement
    assert "not flown: gust.peak: field required" in text
    assert "Not in the scene, influence above 0.01 m: wind" in text
    console_output.write_json(tmp_path / "study.json", result)
    data = json.loads((tmp_path / "study.json").read_text())
    assert data["missing"] == ["wind"]
    assert data["rows"][0]["influence"]["trajectory"] is None
    console_output.plot(tmp_path / "study.png", result)
    assert (tmp_path / "study.png").read_bytes().startswith(b"\x89PNG")


def test_system_without_effects_is_rejected():
    with pytest.raises(ValueError, match=r"os4_motors.toml: the model os4 has no effects"):
        run_study(load(HOVER.parent / "os4_motors.toml"), 0.01, print)
