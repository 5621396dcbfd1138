"""Coaxial rotors with `coaxial_interference`: the autopilot's model equals the plant."""

import json
import math

import numpy as np
import pytest

from lapwing.dynamics import effects
from lapwing.dynamics.vehicles import multirotor
from lapwing.dynamics.vehicles.multirotor_equations import StepInputs, evaluate
from lapwing.kernels import python_function
from lapwing.services.autopilot import controller_parameters
from lapwing.services.autopilot.allocation import virtual_control_effectiveness
from lapwing.services.autopilot.motor import thrust_at
from lapwing.services.autopilot.nominal_airframe import known_airframe
from lapwing.services.common.schemas.vehicle_schema import Effects, airframe
from lapwing.services.scene_resolver import load, resolve
from lapwing.studies.performance import card
from lapwing.studies.tune import corners
from lapwing.studies.tune.linearise import hover

DRONE = load("hover").lookup("airframe")
ARMS = [tuple(place[:2]) for place in DRONE.rotors.position]
SPINS = [spin for ccw in (True, False, True, False) for spin in (("ccw", "cw") if ccw else ("cw", "ccw"))]
X8 = {
    "airframe.mass.total": 12.0, "airframe.mass.payload": 0.0, "airframe.mass.inertia": [0.54, 0.52, 0.84],
    "airframe.rotors.position": [[*arm, z] for arm in ARMS for z in (0.0, 0.1)],
    "airframe.rotors.spin_direction": SPINS,
    "effects.coaxial_interference": {},
}  # fmt: skip


def wrench(scene, thrust):
    """Return force along body z [N] and torque [N m] of the hovering plant for thrusts of isolated rotors."""
    nominal, frame = known_airframe(scene), airframe(scene)
    tables = {
        name: table for name, table in scene[Effects].tables.items() if name in ("rotor_thrust", "coaxial_interference")
    }
    p = multirotor.parameters(frame, effects.from_scene(tables, frame))
    state = multirotor.initial_state(p, (0.0, 0.0, 50.0))
    speeds = tuple(map(float, np.sqrt(np.asarray(thrust) / nominal.motor.thrust_coefficient)))
    motion = state.motion._replace(rotor_speed=speeds)
    u = StepInputs(p, p.body, state.memory, (0.0,) * len(speeds))
    _, _, force, torque = python_function(evaluate)(u, 0.0, motion)
    return np.array([force[2], *torque])


def test_coaxial_effectiveness_is_slope_of_plant_wrench():
    scene = load("hover", X8)
    result = controller_parameters.rotor_effectiveness(known_airframe(scene))
    for k, column in enumerate(result.T):
        step = 1e-3 * np.eye(8)[k]
        assert column == pytest.approx((wrench(scene, 12.0 + step) - wrench(scene, 12.0 - step)) / 2e-3, abs=1e-7)


def test_hover_is_balanced_at_one_speed_of_all_rotors():
    """The feed-forward thrust carries the weight in the plant; without the wakes it is too small by 1.39."""
    scene = load("hover", X8)
    nominal = known_airframe(scene)
    assert [share[0] for share in controller_parameters.shares(nominal)[0]] == pytest.approx([1.0] * 8)
    force, *torque = wrench(scene, [controller_parameters.hover_thrust(nominal)] * 8)
    assert force == pytest.approx(nominal.mass * nominal.gravity, rel=1e-12)
    assert torque == pytest.approx([0.0] * 3, abs=1e-9)
    without = {key: value for key, value in X8.items() if key != "effects.coaxial_interference"}
    alone = controller_parameters.hover_thrust(known_airframe(load("hover", without)))
    assert controller_parameters.hover_thrust(nominal) / alone == pytest.approx(1.39, abs=0.01)


def test_coaxial_virtual_controls_are_decoupled():
    nominal = known_airframe(load("hover", X8))
    B, shares = controller_parameters.rotor_effectiveness(nominal), np.array(controller_parameters.shares(nominal)[0])
    assert B @ shares == pytest.approx(np.diag(virtual_control_effectiveness(B)), abs=1e-12)


def test_coaxial_motor_failure_is_not_identified():
    assert len(controller_parameters.shares(known_airframe(load("hover", X8)))) == 1


def test_weight_above_thrust_in_wakes_is_rejected():
    heavy = {**X8, "airframe.mass.total": 30.0}
    assert resolve(load("hover", {k: v for k, v in heavy.items() if k != "effects.coaxial_interference"}))
    with pytest.raises(ValueError, match=r"per rotor is below the .* N needed to hover"):
        resolve(load("hover", heavy))


def test_performance_card_and_autopilot_agree_on_hover(tmp_path):
    """Except for the voltage drop in the motors' resistance, which the control loops compensate."""
    table = "\n".join(f"{key.removeprefix('airframe.')} = {json.dumps(X8[key])}" for key in X8 if "airframe" in key)
    scene = tmp_path / "x8.toml"
    text = load("hover").path.read_text()
    scene.write_text(f"{text}\n[effects.coaxial_interference]\n[airframe]\n{table}\n")
    nominal = known_airframe(load(scene))
    assert nominal == known_airframe(load("hover", X8))
    ideal = python_function(thrust_at)(nominal.motor, nominal.voltage_max) / controller_parameters.hover_thrust(nominal)
    computed = {row.name: row.computed for row in card(scene)}["thrust over weight"]
    assert 0.85 * ideal < computed < ideal


@pytest.mark.long
def test_tuner_uses_nominal_airframe():
    scene = load("hover", X8)
    result, nominal = hover(scene), known_airframe(scene)
    assert result.rotor_speed == pytest.approx(
        math.sqrt(controller_parameters.hover_thrust(nominal) / nominal.motor.thrust_coefficient), rel=1e-3
    )
    assert result.altitude == pytest.approx(controller_parameters.lift(nominal) / nominal.mass, rel=1e-3)
    moments = controller_parameters.moments(nominal)
    for axis, k in (("roll", 0), ("pitch", 1), ("yaw", 2)):
        assert getattr(result, axis) == pytest.approx(moments[k] / nominal.inertia_body[k], rel=0.02), axis
    assert result.spin_up_zero == pytest.approx(nominal.spin_up_zero, rel=0.15)


def test_tuner_corner_scales_thrust_of_every_rotor():
    active = effects.from_scene({"rotor_thrust": {}, "coaxial_interference": {}}, airframe(load("hover", X8)))
    wash, rotor = (corners._stronger(e, 1.2) for e in active)
    assert wash.thrust_constant == rotor.thrust_constant == pytest.approx(1.2 * active[1].thrust_constant)
