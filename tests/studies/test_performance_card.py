"""Performance card: computed and published figures."""

import json
import math
import re
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import linprog

from lapwing.dynamics.constants import STANDARD_GRAVITY
from lapwing.dynamics.vehicles import performance
from lapwing.dynamics.vehicles.airframe import load_airframe
from lapwing.services.autopilot.controller_parameters import rotor_effectiveness
from lapwing.services.autopilot.controller_parameters import shares as law_shares
from lapwing.services.autopilot.nominal_airframe import known_airframe
from lapwing.services.scene_resolver import load, resolve
from lapwing.studies.performance import card
from lapwing.views.studies.performance_result import result
from lapwing.views.studies.study_result import show, write_json
from lapwing.views.terminal import console
from tests.commands import run_command

ROOT = Path(__file__).parents[2]
VEHICLE = ROOT / "lapwing/scenes/vehicles/delivery_drone.toml"


def test_scene_and_its_vehicle_have_same_card():
    assert card(VEHICLE) == card(ROOT / "lapwing/scenes/hover.toml")


def test_units_of_card():
    rows = {row.name: row for row in card(VEHICLE)}
    drone = load_airframe(VEHICLE)
    assert rows["hover time"].computed == pytest.approx(performance.hover_time(drone) / 60.0)
    assert rows["maximum tilt"].computed == pytest.approx(math.degrees(performance.maximum_tilt(drone)))
    assert rows["hover time"].published == pytest.approx(19.3)
    assert rows["maximum tilt"].published == pytest.approx(58.9, abs=0.05)


def test_default_models_are_close_to_paper():
    rows = {row.name: row for row in card(VEHICLE)}
    for name in ("hover time", "maximum payload", "maximum tilt"):
        assert rows[name].computed == pytest.approx(rows[name].published, rel=0.06), name
    ceiling = rows["ceiling"]  # in the standard atmosphere, which is denser at height than the paper's law
    assert 1.1 < ceiling.computed / ceiling.published < 1.2


def test_published_figures_have_reason_for_difference():
    assert all(row.reason for row in card(VEHICLE) if row.published is not None)


def test_json(tmp_path):
    write_json(tmp_path / "card.json", result(VEHICLE, card(VEHICLE)))
    written = json.loads((tmp_path / "card.json").read_text())
    figures = {figure["name"]: figure["computed"] for figure in written["figures"]}
    assert written["mark"] == "good"
    assert written["verdict"].startswith(
        f"thrust over weight {figures['thrust over weight']:.3g}: it flies; hover time "
    )


@pytest.mark.parametrize(("mass", "mark"), [(10.0, "good"), (18.0, "warn"), (40.0, "bad")])
def test_verdict_says_whether_the_vehicle_flies(tmp_path, mass, mark):
    path = tmp_path / "heavy.toml"
    path.write_text(re.sub(r"(?m)^total = .*$", f"total = {mass}", VEHICLE.read_text(), count=1))
    verdict = result(path, card(path))
    assert verdict.mark == mark, verdict.verdict


def test_unknown_target_is_rejected(tmp_path):
    (tmp_path / "x.toml").write_text("[nonsense]\n")
    with pytest.raises(ValueError, match="nonsense"):
        card(tmp_path / "x.toml")
    with pytest.raises(ValueError, match=r"none\.toml"):
        card(tmp_path / "none.toml")


def airframe_without(tmp_path, *tables):
    """Return the path of the delivery drone's file without some tables."""
    parts = re.split(r"(?m)^(?=\[)", VEHICLE.read_text())
    path = tmp_path / "vehicle.toml"
    path.write_text("".join(part for part in parts if not part.startswith(tuple(f"[{name}" for name in tables))))
    return path


def test_units_are_printed_within_80_columns(capsys):
    show(console(80), result(VEHICLE, card(VEHICLE)))
    output = capsys.readouterr().out
    assert "hover time [min]" in output
    assert "maximum speed [m/s]" in output
    assert max(map(len, output.splitlines()[1:])) <= 80  # below the verdict


def test_card_without_drag_or_battery_is_partial(tmp_path, capsys):
    rows = {row.name: row for row in card(airframe_without(tmp_path, "drag", "battery", "published"))}
    whole = {row.name: row for row in card(VEHICLE)}
    for name in ("maximum payload", "ceiling", "maximum tilt"):
        assert rows[name].computed == whole[name].computed
    assert (rows["maximum speed"].computed, rows["maximum speed"].reason) == (None, "the vehicle has no [drag]")
    assert (rows["hover time"].computed, rows["hover time"].reason) == (None, "the vehicle has no [battery]")
    show(console(80), result(VEHICLE, list(rows.values())))
    assert "the vehicle has no [drag]" in capsys.readouterr().out


QUADRATIC = "\n[effects.rotor_quadratic]\nthrust_constant = 4.0e-4\ntorque_constant = 2.0e-5\n"


def scene_with_constants(tmp_path, vehicle):
    """Return the path of the hover scene with `rotor_quadratic`, which needs no propeller."""
    text = (ROOT / "lapwing/scenes/hover.toml").read_text().replace("[effects.rotor_thrust]", QUADRATIC)
    path = tmp_path / "scene.toml"
    path.write_text(text.replace('"delivery_drone"', f'"{vehicle}"'))
    return path


@pytest.mark.parametrize("tables", [("propeller",), ()], ids=["without a propeller", "with both"])
def test_card_and_autopilot_use_active_rotor_model(tmp_path, tables):
    scene = scene_with_constants(tmp_path, airframe_without(tmp_path, *tables))
    nominal = known_airframe(load(scene))
    assert nominal.motor.thrust_coefficient == 4.0e-4
    assert nominal.torque_per_thrust == pytest.approx(2.0e-5 / 4.0e-4)
    assert resolve(load(scene)).vehicle == "drone1"
    rows = {row.name: row for row in card(scene)}
    weight = load_airframe(VEHICLE).mass.total * STANDARD_GRAVITY
    speed = math.sqrt(0.25 * weight / 4.0e-4)
    motor = load_airframe(VEHICLE).motor
    current = 2.0e-5 * speed**2 / motor.rotor_constant + motor.no_load_current
    power = 4.0 * current * (motor.rotor_constant * speed + motor.resistance * current)
    energy = performance.battery_energy(load_airframe(VEHICLE))
    assert rows["hover time"].computed == pytest.approx(energy / power / 60.0)
    assert rows["ceiling"].reason == "[effects.rotor_quadratic] has no air density"


def test_airframe_without_rotor_model_is_rejected(tmp_path):
    with pytest.raises(ValueError, match=r"no \[propeller\]; use a scene with \[effects.rotor_quadratic\]"):
        card(airframe_without(tmp_path, "propeller"))
    with pytest.raises(ValueError, match=r"effects.rotor_thrust: the vehicle has no \[propeller\]"):
        load("hover", {"vehicle.airframe": str(airframe_without(tmp_path, "propeller"))})


def test_hexacopter_without_rotor_equals_linear_programming():
    """Thrusts are limited and torques are zero; the autopilot's least squares is close to the optimum."""
    rows = {row.name: row for row in card(ROOT / "lapwing/scenes/vehicles/hexacopter.toml")}
    nominal = known_airframe(load("hexacopter"))
    B, whole = rotor_effectiveness(nominal), rows["thrust over weight"].computed
    bounds, most = [(0.0, 1.0)] * 6, []
    for k, shares in enumerate(law_shares(nominal)[1:]):
        torques = B[1:] if any(share[3] for share in shares) else B[1:3]
        free = [(0.0, 0.0) if j == k else bound for j, bound in enumerate(bounds)]
        most.append(-linprog(-B[0], A_eq=torques, b_eq=np.zeros(len(torques)), bounds=free).fun / 6.0)
    result = rows["the same without a rotor"].computed
    assert 0.75 * min(most) * whole < result <= min(most) * whole * (1.0 + 1e-9)
    assert result > 1.0  # still controllable


def test_four_rotors_cannot_lose_one():
    row = next(row for row in card(VEHICLE) if row.name == "the same without a rotor")
    assert (row.computed, row.reason) == (None, "the 4 rotors cannot lose one")


def test_torque_below_ideal_rotors_has_no_power():
    """The flights of the Crazyflie do not determine its torque constant; a tenth of it predicts them best."""
    rows = {row.name: row for row in card(Path("crazyflie_21"))}
    thrust = 0.25 * 0.034 * 9.80665
    shaft = 9.0e-12 * (thrust / 1.75e-8) ** 1.5
    ideal = thrust**1.5 / math.sqrt(2.0 * 1.225 * math.pi * 0.065**2)
    reason = f"the torque constant is too small: a rotor takes {shaft:.2g} W in hover, an ideal one {ideal:.2g} W"
    for name in ("hover power", "hover current", "ESC margin in hover", "hover time"):
        assert (rows[name].computed, rows[name].reason) == (None, reason)
    assert rows["thrust over weight"].computed == pytest.approx(2.07, abs=0.01)


@pytest.mark.parametrize("scene", ["delivery_mission", "quad_x", "racer_250", "hexacopter"])
def test_shipped_vehicles_take_more_power_than_ideal_rotors(scene):
    assert all(row.computed is not None for row in card(Path(scene)) if row.name.startswith("hover"))


@pytest.mark.long
def test_command_prints_loads_and_margins_in_hover(tmp_path):
    result = run_command("performance", "quad_x", "--json", tmp_path / "card.json", code=0, COLUMNS="80")
    rows = {row["name"]: row for row in json.loads((tmp_path / "card.json").read_text())["figures"]}
    for name, unit in {
        "hover power": "W",
        "hover current": "A",
        "hover throttle": "%",
        "motor current in hover": "A",
        "ESC margin in hover": "%",
        "battery margin in hover": "%",
    }.items():
        assert f"{name} [{unit}]" in result.stdout
        assert rows[name]["unit"] == unit
    assert rows["hover power"]["computed"] == pytest.approx(223, abs=1)
