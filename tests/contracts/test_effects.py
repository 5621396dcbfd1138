"""Contract of every effect in the catalogue."""

import math
import re
from pathlib import Path
from typing import get_args, get_origin, get_type_hints

import numpy as np
import pytest

from lapwing.dynamics import effects
from lapwing.dynamics.effects import _hooks as hooks
from lapwing.dynamics.effects._types import Motion
from lapwing.dynamics.integrators import get, rk4_renormalised
from lapwing.dynamics.lie.quaternion import rotation_matrix
from lapwing.dynamics.noise import stream_key
from lapwing.dynamics.vehicles import multirotor
from lapwing.dynamics.vehicles.airframe import load_airframe
from lapwing.dynamics.vehicles.multirotor_equations import STANDARD_DENSITY
from lapwing.kernels import always_inline, kernel
from lapwing.studies.effects.operations import EXAMPLES as NEEDED

ROOT = Path(__file__).parents[2]
DRONE = load_airframe(ROOT / "lapwing/scenes/vehicles/delivery_drone.toml")
EULER, RK4 = get("lie_euler").Method(), get("rk4_renormalised").Method()
KEY = stream_key(1, "drone1", "effects")
HOVER = (32.6, 32.5, 32.7, 32.6)

OTHERS = (  # excluded by another effect of `ALL`
    "battery_thevenin", "coaxial_interference", "gravity", "ground_effect", "dynamic_inflow", "rotor_interference",
    "rotor_quadratic", "rotor_table", "wind_dryden_rates", "wind_von_karman",
)  # fmt: skip
COAXIAL = DRONE.model_copy(
    update={
        "rotors": DRONE.rotors.model_copy(
            update={"position": tuple((0.3 * (-1) ** (k // 2), 0.0, 0.1 * (k % 2)) for k in range(4))}
        )
    }
)
FRAMES = {"coaxial_interference": COAXIAL}  # for effects that do not fit the drone
BESIDE = {
    name: {"rotor_thrust": {}} for name in ("coaxial_interference", "rotor_interference")
}  # effects that an effect needs
FREE = {**NEEDED, "random_wind_force": {"allow_body_drag": True}}
ALL = {name: FREE.get(name, {}) for name in effects.names() if name not in OTHERS}


def made(name, table):
    """Return the effect, on a vehicle that can have it."""
    result = effects.from_scene({**BESIDE.get(name, {}), name: table}, FRAMES.get(name, DRONE))
    return next(e for e in result if type(e) is effects.parameter_class(name))


@pytest.mark.parametrize("name", effects.names())
def test_effect_docstring_has_range_and_equation(name):
    """The docstring has the range of validity and an equation of the theory."""
    text = effects.parameter_class(name).__doc__
    assert "Valid" in text
    equation = re.search(r"theory,\s+eq\.\s+(\(\d+\.\d+\))", text).group(1)
    assert any(f"**{equation}**" in page.read_text() for page in (ROOT / "docs/explanation/theory").glob("*.md"))


@pytest.mark.parametrize("name", effects.names())
def test_effect_registers_hook(name):
    assert any(effects.parameter_class(name) in registered for registered in hooks.HOOKS.values())


@pytest.mark.parametrize("name", effects.names())
def test_scene_table_creates_effect_and_rejects_unknown_keys(name):
    assert isinstance(hooks.initial_discrete_state(made(name, NEEDED.get(name, {}))), tuple)
    with pytest.raises(ValueError, match=rf"^effects\.{name}\.nonsense: ") as error:
        made(name, {**NEEDED.get(name, {}), "nonsense": 1.0})
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("name", NEEDED)
def test_missing_key_is_named(name):
    with pytest.raises(ValueError, match=rf"^effects\.{name}\.{next(iter(NEEDED[name]))}: missing; expected"):
        effects.from_scene({name: {}}, DRONE)


def numbers(name):
    """Yield (key, count of numbers, 0 for a scalar) of the numeric keys in an effect's table."""
    settings = getattr(effects.get(name), "Settings", effects.parameter_class(name))
    for key, hint in get_type_hints(settings).items():
        kinds = [hint, *get_args(hint)]
        triple = next((len(get_args(kind)) for kind in kinds if get_origin(kind) is tuple), 0)
        if triple or float in kinds:
            yield key, triple


@pytest.mark.parametrize(
    ("name", "key", "count"), [(name, *entry) for name in effects.names() for entry in numbers(name)]
)
@pytest.mark.parametrize("value", [-1e12, 1e12])
def test_out_of_range_key_is_named(name, key, count, value):
    if value > 0.0 and key in ("release_time", "start", "duration", "time"):
        pytest.skip("a time may be as late as one likes")
    table = {**NEEDED.get(name, {}), key: [value] * count if count else value}
    with pytest.raises(ValueError, match=rf"^effects\.{name}\.{key}\b.*expected"):
        effects.from_scene({name: table}, DRONE)


def test_range_error_names_both_limits():
    for charge, wrong in ((1.5, "got 1.5"), (-1.0, "got -1.0")):
        with pytest.raises(ValueError) as error:
            effects.from_scene({"battery": {"initial_charge": charge}}, DRONE)
        assert str(error.value) == f"effects.battery.initial_charge: expected a number above 0 and at most 1, {wrong}"
    with pytest.raises(ValueError, match=r"start: missing; expected a number at least 0"):
        effects.from_scene({"wind_gust": {"peak": [1.0, 0.0, 0.0]}}, DRONE)


def test_unknown_effect_lists_choices():
    with pytest.raises(
        ValueError, match=r"unknown effect 'gravitation'; did you mean gravity_altitude\? expected one of air_density"
    ):
        effects.from_scene({"gravitation": {}}, DRONE)


def test_effects_of_equal_kind_exclude_each_other():
    with pytest.raises(ValueError, match=r"effects.gravity_altitude: cannot be combined with effects.gravity, also"):
        effects.from_scene({"gravity": {}, "gravity_altitude": {}}, DRONE)


def fly(tables, method=EULER, seconds=0.2, height=20.0):
    p = multirotor.parameters(DRONE, effects.from_scene(tables, DRONE))
    state = multirotor.initial_state(p, (0.0, 0.0, height), rotor_speed=330.0)
    for tick in range(round(seconds / 0.004)):
        state = multirotor.advance(method, p, KEY, tick, state, HOVER, 1e-3, 4)
    return state


@pytest.mark.long
def test_all_effects_at_once_fly():
    state = fly(ALL)
    numbers = np.concatenate([np.ravel(part) for part in state.motion])
    assert np.isfinite(numbers).all()
    assert np.linalg.norm(state.motion.velocity_world) < 5.0
    assert [len(memory) > 0 for memory in state.memory].count(True) >= 6


UNCOMPILED = (  # effects whose tests use the fixture `uncompiled`
    "air_density", "axial_inflow", "body_drag", "ceiling_effect", "dc_motor", "downwash", "gravity_altitude",
    "gyroscopic_torque", "multirotor_ground_effect", "rotor_thrust",
)  # fmt: skip


@pytest.mark.long
def test_uncompiled_plant_equals_compiled_plant(request):
    tables = {name: FREE.get(name, {}) for name in UNCOMPILED}
    compiled = fly(tables, seconds=0.008, height=0.5)
    request.getfixturevalue("uncompiled")
    assert fly(tables, seconds=0.008, height=0.5) == compiled


def test_effects_are_independent_of_table_order():
    one = effects.from_scene(ALL, DRONE)
    assert one == effects.from_scene(dict(reversed(ALL.items())), DRONE)


@always_inline
def bare_rate(p, t, m):
    """Return gravity, thrust and lag, written by hand with the same constants."""
    layout, w = p.layout, m.rotor_speed
    b = p.effects[1].thrust_constant * STANDARD_DENSITY
    d = p.effects[1].torque_constant * STANDARD_DENSITY
    f = (b * (w[0] * w[0]), b * (w[1] * w[1]), b * (w[2] * w[2]), b * (w[3] * w[3]))
    q = (d * (w[0] * w[0]), d * (w[1] * w[1]), d * (w[2] * w[2]), d * (w[3] * w[3]))
    x, y, s = layout.x_body, layout.y_body, layout.reaction_sign
    mx = (y[0] * f[0] + y[1] * f[1]) + (y[2] * f[2] + y[3] * f[3])
    my = -((x[0] * f[0] + x[1] * f[1]) + (x[2] * f[2] + x[3] * f[3]))
    mz = (s[0] * q[0] + s[1] * q[1]) + (s[2] * q[2] + s[3] * q[3])
    R, lift, k = rotation_matrix(m.attitude), (f[0] + f[1]) + (f[2] + f[3]), p.body.inverse_mass
    weight = p.effects[0].acceleration * p.body.mass
    g, i, o = p.body.gyration, p.body.inverse_inertia, m.omega_body
    spin = (g[0] * (o[1] * o[2]) + i[0] * mx, g[1] * (o[2] * o[0]) + i[1] * my, g[2] * (o[0] * o[1]) + i[2] * mz)
    a, r, v = layout.lag_rate, layout.speed_per_volt, HOVER
    lag = (a * (r * v[0] - w[0]), a * (r * v[1] - w[1]), a * (r * v[2] - w[2]), a * (r * v[3] - w[3]))
    acceleration = (k * (lift * R[2]), k * (lift * R[5]), k * (lift * R[8] - weight))
    return Motion(m.velocity_world, o, acceleration, spin, lag)


one_step = rk4_renormalised.step


@kernel
def bare_steps(p, m, h, n):
    for k in range(n):
        m = one_step(bare_rate, p, k * h, m, h)
    return m


@pytest.mark.long
def test_absent_effects_change_no_bit():
    """Compare the plant, with all effects installed, with a kernel without the machinery of effects."""
    state = fly({"gravity": {}, "rotor_thrust": {}}, RK4)
    p = multirotor.parameters(DRONE, effects.from_scene({"gravity": {}, "rotor_thrust": {}}, DRONE))
    start = multirotor.initial_state(p, (0.0, 0.0, 20.0), rotor_speed=330.0)
    assert bare_steps(p, start.motion, 1e-3, 200) == state.motion
    assert not math.isclose(state.motion.omega_body[0], 0.0)


@pytest.mark.long
def test_disabled_effect_changes_no_bit():
    """Fly high above the ground, where contact has no effect."""
    assert fly({"gravity": {}, "ground_contact": {}}, RK4).motion == fly({"gravity": {}}, RK4).motion
