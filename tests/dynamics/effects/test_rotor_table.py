"""Rotor tables against the definitions of their coefficients; faulty tables."""

import math

import numpy as np
import pytest
from effects_helpers import NO_FACTORS, NO_LOADS

from lapwing.dynamics import effects
from lapwing.dynamics.config_error import ConfigError
from lapwing.dynamics.effects.rotor_table import embed, rotor_table

pytestmark = pytest.mark.usefixtures("uncompiled")

SPEED, D = 300.0, 0.5588
N = SPEED / (2 * math.pi)
UIUC = "J CT CP eta\n0.000  0.1000  0.0400  0.000\n0.200  0.0800  0.0380  0.421\n0.400  0.0500  0.0300  0.667"
GRID = "angle,J,CT,CP\n0,0,0.1,0.04\n0,0.2,0.08,0.038\n90,0,0.1,0.04\n90,0.2,0.12,0.036\n"


def make(drone, tmp_path, text=UIUC, **table):
    (tmp_path / "prop.csv").write_text(text)
    table = {"file": "prop.csv", **table}
    embed(table, tmp_path.joinpath)
    (e,) = effects.from_scene({"rotor_table": table}, drone)
    return e


def loads(e, s):
    return rotor_table.py_func(e, (), s, NO_FACTORS, NO_LOADS)


def test_definitions_of_coefficients(drone, situation, tmp_path):
    """T = C_T rho n^2 D^4, P = C_P rho n^3 D^5 at rest, at J = 0.2 and between rows."""
    e = make(drone, tmp_path)
    for j, ct, cp in ((0.0, 0.1, 0.04), (0.2, 0.08, 0.038), (0.3, 0.065, 0.034), (0.9, 0.05, 0.03), (-0.3, 0.1, 0.04)):
        result = loads(e, situation(velocity=(3.0, 0, j * N * D)))
        assert result.thrust == pytest.approx([ct * 1.2 * N**2 * D**4] * 4)
        assert np.array(result.torque) * SPEED == pytest.approx([cp * 1.2 * N**3 * D**5] * 4)
    assert e.thrust_constant * SPEED**2 == pytest.approx(0.1 * N**2 * D**4)


def test_torque_coefficients_commas_and_comments(drone, situation, tmp_path):
    text = "# static row first\nJ, CT, CQ\n" + f"0,0.1,{0.04 / (2 * math.pi)}\n0.2,0.08,{0.038 / (2 * math.pi)}\n"
    by_power, by_torque = make(drone, tmp_path), make(drone, tmp_path, text)
    s = situation(velocity=(0, 0, 0.1 * N * D))
    assert np.array(loads(by_torque, s)) == pytest.approx(np.array(loads(by_power, s)))


def test_grid_over_angle_of_air(drone, situation, tmp_path):
    """Values at 0.1 and at 45 degrees are interpolated between rows."""
    e = make(drone, tmp_path, GRID)
    v = 0.1 * N * D
    for velocity, ct in (((v, 0, 0), 0.11), ((0, 0, v), 0.09), ((v / math.sqrt(2), 0, v / math.sqrt(2)), 0.10)):
        assert loads(e, situation(velocity=velocity)).thrust == pytest.approx([ct * 1.2 * N**2 * D**4] * 4)


def test_each_hub_has_its_advance_and_rotors_at_rest_have_no_loads(drone, situation, tmp_path):
    e = make(drone, tmp_path)
    turning = loads(e, situation(velocity=(0, 0, 5.0), omega=(1.0, 0.0, 0.0))).thrust
    assert turning[0] < turning[2]
    assert loads(e, situation(speed=(0.0,) * 4, velocity=(1, 2, 3))) == ((0.0,) * 4, (0.0,) * 4)


@pytest.mark.parametrize(
    ("text", "output"),
    [
        ("J CT CP\n0 0.1 0.04\n0.2 0.08\n", "line 3 has 2 columns; expected 3|expected 3 as its first line"),
        ("J,CT,CP\n0,0.1,0.04\n0.2,,0.03\n", "line 3: '0.2,,0.03' has no number in a column"),
        ("J CT CP\n0 0.1 0.04\n0.2 nan 0.03\n", "has no number in a column"),
        ("J CT eta\n0 0.1 0.04\n", "names 0 columns CP or CQ"),
        ("J CT CP\n0 0.1 0.04\n0.2 0.09 0.04\n0.1 0.1 0.04\n", "increasing numbers, got 0.1 after 0.2"),
        ("J CT CP\n0 0.1 0.04\n0.2 0.09 0.04\n0.6 0.1 0.04\n", "no row between J = 0.2 and 0.6"),
        ("J CT CP\n0.1 0.1 0.04\n0.2 0.09 0.04\n", r"including J = 0 \(at rest\), got J from 0.1 to 0.2"),
        ("J CT CP\n0 -0.1 0.04\n0.2 0.09 0.04\n", "above 0 there, got -0.1 at J = 0"),
        ("J CT CP\n0 10.1 0.04\n0.2 0.09 0.04\n", "at least -1 and at most 1, got 10.1"),
        ("angle J CT CP\n0 0 .1 .1\n0 .1 .1 .1\n90 0 .1 .1\n", "the J at 90 deg differ from those at 0 deg"),
        ("", "the file is empty"),
    ],
)
def test_table_error_is_one_line(drone, tmp_path, text, output):
    with pytest.raises(ConfigError, match=output) as caught:
        make(drone, tmp_path, text)
    assert "\n" not in str(caught.value)


def test_rotor_table_replaces_other_rotor_effects(drone):
    with pytest.raises(ConfigError, match=r"effects.rotor_table: replaces effects.rotor_thrust"):
        effects.from_scene({"rotor_thrust": {}, "rotor_table": {}}, drone)
