"""Plan of a campaign: drawn values of its runs, and invalid arguments."""

import re

import numpy as np
import pytest
from scipy import stats

from lapwing.studies.campaign.distributions import KINDS, choice, linspace, loguniform, normal, parse, uniform
from lapwing.studies.campaign.plan import plan
from lapwing.studies.campaign.runs import first_config


def draw_values(new_plan, key):
    return [new_plan.values(run)[key] for run in range(new_plan.runs)]


@pytest.mark.parametrize(
    ("distribution", "reference"),
    [
        (normal(10.4, 0.2), stats.norm(10.4, 0.2)),
        (uniform(-1, 12), stats.uniform(-1, 13)),
        (loguniform(0.1, 100.0), stats.loguniform(0.1, 100.0)),
    ],
)
def test_quantiles_equal_those_of_scipy(distribution, reference):
    for u in (0.001, 0.3, 0.5, 0.97):
        assert distribution.at(u) == pytest.approx(reference.ppf(u))
    assert parse(str(distribution)) == distribution


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("choice(rtk, standard)", ("rtk", "standard")),
        ("choice(a.toml,sets/b.toml)", ("a.toml", "sets/b.toml")),
        ("choice([1.0, 2.0], [3.0, 4.0])", ([1.0, 2.0], [3.0, 4.0])),
        ("choice([[1, 2], 3], [1, 2, 3])", ([[1, 2], 3], [1, 2, 3])),
        ('choice("a, b", true, 3)', ("a, b", True, 3)),
        ("linspace(0, 1, 3)", (0.0, 0.5, 1.0)),
    ],
)
def test_discrete_distribution_has_equal_probabilities(text, values):
    result = parse(text)
    assert result.values == values
    assert [result.at(u) for u in (np.arange(len(values)) + 0.5) / len(values)] == list(values)
    assert parse(str(result)) == result


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("normal(1)", "normal: got '1'"),
        ("normal(a, b)", "normal: got 'a, b'"),
        ("normal(1, -2)", "normal: expected a deviation of at least 0, got 1, -2"),
        ("uniform(2, 1)", "uniform: expected low <= high, got 2, 1"),
        ("loguniform(0, 1)", "loguniform: expected 0 < low <= high"),
        ("linspace(0, 1, 0)", "expected a whole number of values"),
        ("linspace(0, 1, 1000000000)", "expected a whole number of values, up to 1000000"),
        (f"uniform(0, 1{400 * '0'})", "expected low <= high"),
        ("choice([1, 2)", "is not a TOML value"),
        ("choice()", "choice: expected at least one value"),
        ("gauss(1, 2)", f"expected a distribution ({', '.join(KINDS)})"),
        ("3.0", "expected a distribution"),
    ],
)
def test_invalid_distribution_is_rejected(text, message):
    with pytest.raises(ValueError, match=re.escape(message)):
        parse(text)


def test_draws_depend_on_seed_run_and_key_only():
    one = plan("hover", runs=50, seed=3, vary={"a": normal(0, 1), "b": uniform(0, 1)})
    more = plan("hover", runs=80, seed=3, vary={"c": uniform(0, 1), "b": uniform(0, 1)})
    assert draw_values(one, "b") == draw_values(more, "b")[:50]
    assert [one.seed_of(k) for k in range(50)] == [more.seed_of(k) for k in range(50)]
    assert draw_values(one, "b") != draw_values(plan("hover", runs=50, seed=4, vary={"b": uniform(0, 1)}), "b")
    assert [one._replace(seed=1).seed_of(k) for k in range(3)] == [1, 2, 3]
    assert len({plan("hover", seed=s).seed_of(k) for s in (1, 2, 3) for k in range(100)}) == 300
    assert one._replace(seed=2**31 - 1).seed_of(2**32 - 1) < 2**63


def test_drawn_values_follow_distribution():
    new_plan = plan("hover", runs=2000, vary={"a": normal(1.0, 2.0), "b": uniform(0, 1)})
    a, b = draw_values(new_plan, "a"), draw_values(new_plan, "b")
    assert stats.kstest(a, stats.norm(1.0, 2.0).cdf).pvalue > 0.01
    assert stats.kstest(b, stats.uniform.cdf).pvalue > 0.01
    assert abs(np.corrcoef(a, b)[0, 1]) < 0.06


@pytest.mark.parametrize("design", ["lhs", "sobol"])
def test_design_draws_each_interval_once(design):
    new_plan = plan("hover", runs=16, vary={"a": uniform(0, 16), "b": uniform(0, 16)}, design=design)
    for key in "ab":
        assert sorted(map(int, draw_values(new_plan, key))) == list(range(16))  # one in each of 16 intervals
    assert draw_values(new_plan, "a") != draw_values(new_plan, "b")
    assert new_plan.values(7) == plan("hover", runs=16, vary=dict(new_plan.vary), design=design).values(7)


def test_grid_has_all_combinations():
    new_plan = plan("hover", vary={"a": choice(1, 2), "b": linspace(0, 1, 3), "c": uniform(0, 1)}, design="grid")
    assert new_plan.runs == 6
    assert sorted(zip(draw_values(new_plan, "a"), draw_values(new_plan, "b"), strict=True)) == [
        (a, b) for a in (1, 2) for b in (0, 0.5, 1)
    ]
    assert len(set(draw_values(new_plan, "c"))) == 6


def test_sweep_keeps_rows_together(tmp_path):
    (tmp_path / "s.csv").write_text('vehicle.mass, "sensors.gps.preset"\n9.5, rtk\n10.5, standard\n')
    new_plan = plan("hover", runs=3, sweep=tmp_path / "s.csv")
    assert [new_plan.values(k) for k in range(3)] == [
        {"vehicle.mass": 9.5, "sensors.gps.preset": "rtk"},
        {"vehicle.mass": 10.5, "sensors.gps.preset": "standard"},
        {"vehicle.mass": 9.5, "sensors.gps.preset": "rtk"},
    ]
    assert plan("hover", sweep=tmp_path / "s.csv").runs == 2


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "expected a header of distinct keys"),
        ("a,b\n", "expected a header of distinct keys, and a line of values for each run"),
        ("a,b\n1\n", "line 2: expected 2 values, got 1"),
        ("a\n1 2\n", "1 2 is not a TOML value"),
    ],
)
def test_invalid_sweep_is_rejected(tmp_path, text, message):
    (tmp_path / "s.csv").write_text(text)
    with pytest.raises(ValueError, match=message):
        plan("hover", sweep=tmp_path / "s.csv")


def test_sweep_accepts_byte_order_mark(tmp_path):
    (tmp_path / "s.csv").write_text("\ufeffa,b\n1,2\n", encoding="utf-8")
    assert plan("hover", sweep=tmp_path / "s.csv").sweep == ({"a": 1, "b": 2},)


def test_grid_is_accepted_when_first_runs_are_rejected():
    vary = {"effects.random_wind_force.sigma": choice(-1, 1), "vehicle.mass": linspace(10, 11, 20)}
    new_plan = plan("delivery_mission", vary=vary, design="grid")
    assert new_plan.runs == 40
    assert first_config(new_plan)[0] >= 20


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"runs": 40_000_000_000}, "runs 40000000000: expected a number from 1 to 10000000"),
        ({"runs": 0}, "runs 0: expected a number from 1 to 10000000"),
        ({"seed": 0}, "seed 0: expected a whole number from 1 to 2147483647"),
        ({"design": "halton"}, "design halton: expected one of random, lhs, sobol, grid"),
        ({"design": "lhs"}, "design lhs: expected a key that varies"),
        ({"design": "grid", "vary": {"a": uniform(0, 1)}}, r"design grid: expected a key that varies by choice"),
        ({"sweep": "none.csv"}, "sweep none.csv: cannot be read: no such file"),
    ],
)
def test_invalid_plan_is_rejected(arguments, message):
    from pathlib import Path

    if "sweep" in arguments:
        arguments = {"sweep": Path(arguments["sweep"])}
    with pytest.raises(ValueError, match=message):
        plan("hover", **arguments)
