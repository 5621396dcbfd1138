import math
from pathlib import Path

import pytest

from lapwing.services.autopilot.controller_parameters import build
from lapwing.services.autopilot.gains import load
from lapwing.services.autopilot.margins import margins, open_loops, stable
from lapwing.services.autopilot.nominal_airframe import known_airframe
from lapwing.services.scene_resolver import load as load_scene
from lapwing.studies.tune.bandwidths import Bandwidths
from lapwing.studies.tune.design import (
    GAIN_MARGIN,
    PHASE_MARGIN,
    UNSTABLE,
    assumed_airframe,
    design,
    gain_set,
    shortfalls,
)
from lapwing.studies.tune.linearise import hover

SCENE = load_scene(Path(__file__).parents[3] / "lapwing/scenes" / "hover.toml")
TICK = 0.004


@pytest.fixture(scope="module")
def model():
    return hover(SCENE)


@pytest.fixture(scope="module")
def airframe():
    return known_airframe(SCENE)


def test_linear_model_equals_closed_form(model, airframe):
    """Reference: theory, eqs. (1.13) and (4.30): 4/m, 4 l/J, 4 b/J_z, the motors' lag, and g over the tilt."""
    arm = sum(abs(x) for x in airframe.rotor_x)
    i_x, i_y, i_z = airframe.inertia_body
    assert model.altitude == pytest.approx(4.0 / airframe.mass, rel=1e-6)
    assert model.roll == pytest.approx(arm / i_x, rel=1e-6)
    assert model.pitch == pytest.approx(arm / i_y, rel=1e-6)
    assert model.yaw == pytest.approx(4.0 * airframe.torque_per_thrust / i_z, rel=1e-6)
    assert model.lag == pytest.approx(airframe.motor.time_constant, rel=1e-6)
    assert model.tilt == pytest.approx(airframe.gravity, rel=1e-5)
    weight = 0.25 * airframe.mass * airframe.gravity
    assert model.rotor_speed == pytest.approx(math.sqrt(weight / airframe.motor.thrust_coefficient), rel=1e-6)
    assert model.thrust_slope == pytest.approx(2.0 * weight / model.rotor_speed, rel=1e-6)


@pytest.mark.long
def test_spin_up_reaction_adds_zero_to_yaw():
    """theory, after eq. (4.31): a steady speed has the same effect, its rate adds I_r / (b_T dF/dOmega)."""
    scene = load_scene(SCENE.path.parent / "delivery_mission.toml")
    with_inertia, without, airframe = hover(scene), hover(SCENE), known_airframe(scene)
    assert with_inertia.yaw == pytest.approx(without.yaw, rel=1e-6)
    assert with_inertia.spin_up_zero == pytest.approx(airframe.spin_up_zero, rel=0.01)  # the air is thinner at 50 m
    assert without.spin_up_zero == 0.0
    assert known_airframe(SCENE).spin_up_zero == 0.0
    loops = open_loops(build(load("tuned").plain(), airframe), assumed_airframe(airframe, with_inertia), TICK)
    assert shortfalls(loops) == {}
    assert (
        margins(loops["yaw"]).crossover
        > 5.0
        * margins(
            open_loops(build(load("tuned").plain(), airframe), assumed_airframe(airframe, without), TICK)["yaw"]
        ).crossover
    )


def test_loop_is_unstable_beyond_gain_margins(airframe):
    for name in ("paper", "tuned"):
        loops = open_loops(build(load(name).plain(), airframe), airframe, TICK)
        for loop in ("altitude", "yaw", "x_plant_input", "y_plant_input"):
            m, response = margins(loops[loop]), loops[loop]
            assert stable(response), loop
            assert stable(0.97 * m.gain * response), loop
            assert not stable(1.03 * m.gain * response), loop
            assert stable(1.03 * m.reduction * response), loop
            assert not stable(0.97 * m.reduction * response), loop


@pytest.mark.parametrize("factor", [1.0, 3.0])
def test_design_has_margins_and_reports_reduced_bandwidths(model, airframe, factor):
    output = []
    expected = Bandwidths(*(factor * w for w in Bandwidths()))
    gains = gain_set(model, design(model, airframe, TICK, expected, output.append))
    loops = open_loops(build(gains.plain(), airframe), assumed_airframe(airframe, model), TICK)
    for m in map(margins, loops.values()):
        assert math.degrees(m.phase) >= PHASE_MARGIN
        assert m.gain >= 10.0 ** (GAIN_MARGIN / 20.0)
        assert m.reduction <= 10.0 ** (-GAIN_MARGIN / 20.0)
    assert not shortfalls(loops)
    if factor > 1.0:
        assert any("reduced from" in line for line in output)


def test_unstable_and_weak_gains_are_named(airframe):
    fast = load("tuned").model_copy(update={"altitude": (160.0, 120.0, 3200.0)})
    assert shortfalls(open_loops(build(fast.plain(), airframe), airframe, TICK))["altitude"] == UNSTABLE
    shortfall = shortfalls(open_loops(build(load("paper").plain(), airframe), airframe, TICK))["roll"]
    assert shortfall.reason == "phase margin below 45 deg"
    assert shortfall.value.startswith("2")
    assert shortfalls(open_loops(build(load("tuned").plain(), airframe), airframe, TICK)) == {}


RACER = {"vehicle.airframe": str(Path(__file__).parent / "racer.toml"), "effects.gyroscopic_torque": {}}


@pytest.mark.long
def test_design_ignores_gains_of_other_vehicle():
    """The delivery drone's gains give its yaw loop a gain above 1 at all frequencies."""
    scene, output = load_scene("hover", RACER), []
    model, airframe = hover(scene), known_airframe(scene)
    plant = assumed_airframe(airframe, model)
    present = open_loops(build(load("tuned").plain(), airframe), plant, TICK)
    assert margins(present["yaw"]).crossover == math.inf
    assert shortfalls(present)["yaw"]
    result = gain_set(model, design(model, airframe, TICK, Bandwidths(), output.append))
    assert not shortfalls(open_loops(build(result.plain(), airframe), plant, TICK))
    assert [line.partition(":")[0] for line in output] == ["yaw"]


def test_unreachable_margins_name_loop():
    scene = load_scene("hover", {"airframe.motor.time_constant": 20.0})
    with pytest.raises(ValueError, match=r"no gains with 45 deg and 6 dB found: \w+ loop: .*; use lower bandwidths"):
        design(hover(scene), known_airframe(scene), TICK, Bandwidths(), lambda _: None)
