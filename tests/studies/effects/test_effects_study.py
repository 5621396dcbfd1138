"""Effects study: differences in closed form, the smallest set for synthetic flights, and a real flight."""

import contextlib
import json
import math
from pathlib import Path

import pytest
from synthetic_flights import moved

from lapwing.dynamics import effects
from lapwing.dynamics.effects._vehicle_interaction import NeighbourState
from lapwing.dynamics.effects.downwash import Downwash, wind_of_jets
from lapwing.dynamics.vector import ZERO
from lapwing.services.common.schemas.vehicle_schema import Effects
from lapwing.services.scene_resolver import load
from lapwing.studies.effects import cost, procedure
from lapwing.studies.effects.cost import Cost
from lapwing.studies.effects.procedure import Influence, Row, Study, _smallest, influence
from lapwing.studies.effects.procedure import study as run_study
from lapwing.studies.effects.variants import Change, changes, check_effects, fly_for_truth, tables_of, variant
from lapwing.views.report.plot import Line, Stretch
from lapwing.views.studies import effects_result
from lapwing.views.studies.study_result import show, write_json, write_plot
from lapwing.views.terminal import console
from tests.commands import run_command
from tests.scenes import head, phase, vehicle

SCENES = Path(__file__).parents[3] / "lapwing/scenes"
HOVER = SCENES / "hover.toml"


def test_difference_of_two_flights():
    result = influence([moved([0, 1, 2, 3])], [moved([0, 1, 4, 2], power=110.0)])
    assert result.trajectory == 2.0
    assert result.final == 1.0
    assert result.energy == pytest.approx(0.1)


def test_landed_vehicle_stays_landed():
    assert influence([moved([0, 1, 2])], [moved([0, 1, 2, 5])]).final == 3.0
    assert influence([moved([0, 1, 2, 5])], [moved([0, 1])]).trajectory == 4.0


def test_failed_flight_has_infinite_influence():
    result = influence([moved([0, 1])], [moved([0], failure="not finite at t = 1 s")])
    assert result.trajectory == math.inf
    assert result.failure == "not finite at t = 1 s"


def test_largest_influence_of_all_vehicles_is_reported():
    reference = [moved([0, 0, 0]), moved([0, 1, 2], power=300.0)]
    reference[1].vehicle = "right"
    result = influence(reference, [moved([0, 0, 1]), moved([0, 4, 2], power=340.0)])
    assert (result.trajectory, result.final, result.vehicle) == (3.0, 1.0, "right")
    assert result.energy == pytest.approx(0.1)  # of both vehicles


class FakePool:
    """Pool whose flights differ by the sum of the influences of the missing effects."""

    def __init__(self, influences):
        self.worth = influences

    def fly(self, variants):
        for (own,) in variants:
            yield [moved([0, sum(w for n, w in self.worth.items() if n not in own)])]


def test_smallest_set_omits_effects_that_are_small_together():
    influences = {"a": 0.001, "b": 0.004, "c": 0.008, "d": 5.0}
    pool, tables, reference, output = FakePool(influences), ({n: {} for n in influences},), [moved([0, 0])], []
    (remaining,), distance = _smallest(pool, tables, reference, ["a", "b", "c"], 0.01, output.append)
    assert list(remaining) == ["c", "d"]
    assert distance == pytest.approx(0.005)
    assert output == ["without a, b, c together", "without a, b together"]
    assert _smallest(pool, tables, reference, [], 0.01, output.append)[1] == 0.0


def test_effect_of_some_vehicles_is_removed_there_and_added_to_others():
    wind = {"velocity": [1.0, 0.0, 0.0]}
    tables = {"gravity": {}}, {"gravity": {}, "wind_constant": wind}
    assert changes(tables, ["gravity", "wind_constant", "downwash"]) == {
        Change("gravity", True): ({}, {"wind_constant": wind}),
        Change("wind_constant", True): ({"gravity": {}}, {"gravity": {}}),
        Change("wind_constant", False): ({"gravity": {}, "wind_constant": wind}, tables[1]),
        Change("downwash", False): ({"gravity": {}, "downwash": {}}, {**tables[1], "downwash": {}}),
    }


def test_option_of_some_vehicles_is_removed_there_and_added_to_others():
    tables = {"dc_motor": {"inductance": 2e-5}}, {"dc_motor": {}}, {}
    result = changes(tables, ["dc_motor"])
    assert result[Change("dc_motor.inductance", True)] == ({"dc_motor": {}}, {"dc_motor": {}}, {})
    added = {"dc_motor": {"inductance": effects.options("dc_motor")["inductance"]}}
    assert result[Change("dc_motor.inductance", False)] == (tables[0], added, {})


@pytest.mark.long
def test_inductance_changes_real_flight_little():
    scene = load(HOVER, ["run.duration=1.0", "effects.dc_motor={}"])
    tables = tables_of(scene)
    changed = changes(tables, ["dc_motor"])[Change("dc_motor.inductance", False)]
    first, other = (fly_for_truth(variant(scene, t)) for t in (tables, changed))
    assert 0.0 < influence(first, other).trajectory < 0.01
    # [J] about the ideal hover power over the efficiency, for less than 1 s
    assert 100.0 < first[0].energy < 2000.0


def test_invalid_effects_return_error():
    scene = load(HOVER)
    assert check_effects(scene, ({"gravity": {}, "gravity_altitude": {}},)).startswith(
        "effects.gravity_altitude: cannot be combined with"
    )
    assert check_effects(scene, ({"wind_gust": {}},)).startswith("effects.wind_gust.peak: ")
    assert check_effects(scene, tables_of(scene)) == ""


@pytest.fixture
def synthetic_flights(monkeypatch):
    """Flights and costs of variants without a simulation."""

    class Same:
        def fly(self, variants):
            return ([moved([0.0, 1.0]) for _ in tables] for tables in variants)

    monkeypatch.setattr(procedure, "variant_pool", lambda scene: contextlib.nullcontext(Same()))
    monkeypatch.setattr(procedure, "costs", lambda scene, variants, report: [Cost(1.0, 1.0, 0.1, 0.1)] * len(variants))


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
def test_effects_between_vehicles_are_studied_in_fleet():
    scene = load(SCENES / "fleet.toml", ["vehicle.2.effects.gyroscopic_torque={}"])
    result = run_study(scene, 0.01, lambda *_: None)
    assert result.vehicles == ("left", "right", "scout")
    rows = {(row.name, row.active): row for row in result.rows}
    assert {name for name, _ in rows} == set(effects.names())
    assert rows["downwash", False].influence is not None
    assert rows["collision", False].influence is not None
    assert rows["gyroscopic_torque", True].influence is not None
    assert rows["gyroscopic_torque", False].influence is not None
    assert rows["shared_slung_load", False].remark.startswith("effects.shared_slung_load.mass: missing")


def test_effect_that_fleet_cannot_have_returns_error():
    scene = load(SCENES / "fleet.toml", ["vehicle.1.initial_position=[0.0, 2.5]"])
    tables = tuple({**own, "collision": {}} for own in tables_of(scene))
    assert check_effects(scene, tables).startswith("vehicle.1.initial_position: expected at least")


def test_variant_of_fleet_has_tables_of_each_vehicle():
    scene = load(SCENES / "fleet.toml")
    changed = variant(scene, ({"gravity": {}}, {"gravity": {}, "body_drag": {}}, {}))
    names = [["gravity"], ["body_drag", "gravity"], []]
    assert [sorted(vehicle[Effects].tables) for vehicle in changed.vehicles] == names
    assert [sorted(vehicle["effects"]) for vehicle in changed.resolved["vehicle"]] == names


@pytest.mark.usefixtures("synthetic_flights")
@pytest.mark.parametrize(("table", "active"), [("{}", False), ("{inductance=1e-5, braking_current=5.0}", True)])
def test_options_of_effects_are_studied(table, active):
    scene = load(HOVER, [f"effects.dc_motor={table}", "effects.battery_thevenin={peukert_exponent=1.1}"])
    result = run_study(scene, 0.01, lambda *_: None, ["dc_motor", "battery_thevenin"])
    rows = {row.name: row.active for row in result.rows if not row.remark}
    assert rows["dc_motor.inductance"] == rows["dc_motor.braking_current"] == active
    assert rows["battery_thevenin.peukert_exponent"]
    assert set(result.smallest) <= set(scene[Effects].tables)


CALM = {"wind_constant": "velocity = [0.0, 0.0, 0.0]"}
STACKED = head(2.5, "body_drag", "downwash", **CALM) + "".join(  # without downwash, the effects of the scene `fleet`
    vehicle(name, phase("climb", 2.0, z=height)) for name, height in (("upper", 3.0), ("lower", 1.0))
)


@pytest.mark.long
def test_command_shows_that_stacked_vehicles_need_downwash(tmp_path):
    scene, path = tmp_path / "stacked.toml", tmp_path / "effects.json"
    scene.write_text(STACKED)
    done = run_command("effects", scene, "--only", "downwash,collision", "--json", path, code=0)
    result = json.loads(path.read_text())
    rows = {row["name"]: row for row in result["rows"]}
    assert rows["downwash"]["influence"]["trajectory"] > 0.01
    assert rows["downwash"]["influence"]["vehicle"] == "lower"
    assert "downwash" in result["smallest"]
    assert rows["collision"]["remark"].startswith("vehicle.1.initial_position: ")  # their spheres touch at the start
    assert "…" not in done.stdout  # no number is cut
    distant = load(scene, ["vehicle.1.initial_position=[20.0, 0.0]"])
    tables = tables_of(distant)
    flights = [
        fly_for_truth(variant(distant, t)) for t in (tables, changes(tables, ["downwash"])[Change("downwash", True)])
    ]
    assert influence(*flights).trajectory < 1e-6


def study():
    rows = (
        Row("gravity", True, Influence(math.inf, math.inf, math.inf, "falls"), 1.0, 2.0),
        Row("wind", False, Influence(0.5, 0.1, 0.02), 20.0, 30.0),
        Row("gyroscopic_torque", False, Influence(0.00012, 0.00011, -0.0123), -1234.5, -1234.0),
        Row("rotor_interference", False, Influence(4.5e-05, 5.6e-17, 3.1e-08), 2684.0, 3630.0),
        Row("multirotor_ground_effect", False, Influence(8.1e-06, 0.0, -0.066), 5.6, 1970.0),
        Row("gust", False, None, math.nan, math.nan, "gust.peak: field required"),
    )
    return Study("hover", 0.01, 80.0, 500.0, rows, ("gravity",), 0.0, 80.0, 500.0, (1.5, 3.0), ("drone1",))


def test_table_json_and_plot(tmp_path, capsys):
    result = study()
    assert [row.name for row in result.missing] == ["wind"]
    page = effects_result.result(result)
    show(console(80), page)
    text = capsys.readouterr().out
    assert "…" not in text  # no number is cut
    assert ["effect", "[ns]", "share", "[ns]", "[m]", "[m]", "energy"] in [line.split() for line in text.splitlines()]
    assert "ends early" in text
    assert "each studied effect of the scene is needed within 0.01 m: gravity" in text.splitlines()[0]
    assert "saves" not in text
    assert "25 %" in text  # 20 of 80 ns
    assert "< 1.5" in text  # cost of gravity, below the resolution of the measurement
    assert "not flown: gust.peak: field required" in text
    assert "Not in the scene, influence above 0.01 m: wind" in text
    write_json(tmp_path / "study.json", page)
    data = json.loads((tmp_path / "study.json").read_text())
    assert data["missing"] == ["wind"]
    assert data["rows"][0]["influence"]["trajectory"] is None
    write_plot(tmp_path / "study.png", page)
    assert (tmp_path / "study.png").read_bytes().startswith(b"\x89PNG")


def test_plot_has_no_bar_without_change_and_legend_of_drawn_kinds():
    small = [Row(name, False, Influence(e, e, e), 5.6, 1.0) for name, e in (("collision", 0.0), ("rotor_damage", 9e-7))]
    changed = study()
    plot = effects_result.result(changed._replace(rows=(*changed.rows, *small))).plots["Influence of effects"]()
    (panel,) = plot.panels
    lanes = {mark.lane: mark.end - mark.start for mark in panel.marks if isinstance(mark, Stretch)}
    assert lanes["(collision), 5.6 ns, 0 m"] == lanes["(rotor_damage), 5.6 ns, < 1e-06 m"] == 0.0
    assert lanes["gravity, < 1.5 ns, ends early"] > lanes["(wind), 20 ns"] > 0.49
    legend = [mark.name for mark in panel.marks if isinstance(mark, Line)]
    assert legend == ["needed", "(missing)", "(not needed)", "tolerance 0.01 m"]


def test_table_of_fleet_names_vehicles(capsys):
    rows = (
        Row("downwash", True, Influence(2.0, 0.019, -0.06, vehicle="third"), 44.9, 1.0),
        Row("collision", False, Influence(math.inf, math.inf, math.inf, "left: falls"), 92.4, 1.0),
        Row("wind_boundary_layer", False, Influence(0.00012, 0.00011, -0.0123, vehicle="wing"), -1234.5, -1234.0),
    )
    vehicles = "leader", "wing", "third"
    result = Study("formation", 0.01, 658.0, 2258.0, rows, ("downwash",), 0.0, 6.0, 2.0, (1.5, 3.0), vehicles)
    show(console(80), effects_result.result(result))
    text = capsys.readouterr().out
    assert "plant step of all 3 vehicles: 658 ns hovering" in text
    assert "largest change for third: downwash\n" in text
    assert "largest change for wing: wind_boundary_layer\n" in text
    assert "Not in all vehicles, influence above 0.01 m: collision" in text
    assert "…" not in text


def test_cost_of_fleet_counts_equal_vehicles_once():
    assert [number for number, *_ in cost._calls(load(SCENES / "formation.toml"))] == [3]
    assert [number for number, *_ in cost._calls(load(SCENES / "fleet.toml"))] == [2, 1]
    assert [number for number, *_ in cost._calls(load(HOVER))] == [1]


@pytest.mark.long
def test_cost_of_fleet_includes_interactions():
    effect, memory = Downwash(disc_radius=0.3, spread=0.113, core=0.0), (ZERO,)
    own = NeighbourState(air_density=1.2)
    other = NeighbourState((0.0, 0.0, 2.0), thrust_world=(0.0, 0.0, 50.0), air_density=1.2, disc_radius=0.3)
    assert cost._with_interactions((effect,), memory, (own,), 0.01) == memory
    (wind,) = cost._with_interactions((effect,), memory, (own, other), 0.01)
    assert wind == wind_of_jets(effect, ZERO, own, (other,), 0.01)
    assert wind[2] < -1.0


def test_system_without_effects_is_rejected():
    with pytest.raises(ValueError, match=r"os4_motors.toml: the model os4 has no effects"):
        run_study(load(SCENES / "os4_motors.toml"), 0.01, print)
