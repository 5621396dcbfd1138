"""Statistics of campaigns, and rows that do not depend on the process."""

import numpy as np
import pytest
import synthetic_flights

from lapwing.cosim.diagram.block_diagram import BlockDiagram
from lapwing.cosim.executors.single_process import KEPT_TICKS, run_single
from lapwing.cosim.log import LogWriter
from lapwing.cosim.log.log_sequencer import Recording
from lapwing.flights.flight_data import FlightData
from lapwing.services.process_table import create_all
from lapwing.services.scene_resolver import load, reseed, resolve
from lapwing.studies.campaign.campaign_config import TOPICS, campaign_config
from lapwing.studies.campaign.distributions import parse
from lapwing.studies.campaign.explanation import least_failing
from lapwing.studies.campaign.plan import plan
from lapwing.studies.campaign.runs import row_of
from lapwing.studies.campaign.statistics import (
    ellipse,
    interval,
    paired_difference,
    percent,
    rank_correlation,
    ratio_change,
    spread,
    variance_share,
)
from lapwing.studies.simulate import fly
from tests.combinations import MISSION


def test_interval_is_clopper_pearson():
    assert interval(0, 100)[1:] == pytest.approx((0.0, 1.0 - 0.025 ** (1 / 100)))
    assert interval(10, 10)[1:] == pytest.approx((0.025 ** (1 / 10), 1.0))
    assert interval(81, 263)[1:] == pytest.approx((0.2527, 0.3676), abs=1e-4)  # Newcombe 1998, table I
    assert interval(0, 0)[1:] == (0.0, 1.0)


def test_spread_has_worst_run():
    values, runs = np.append(np.arange(101.0), np.nan), np.arange(102) + 100
    assert spread(values, runs) == (50.0, 5.0, 95.0, 100.0, 200)
    assert spread(values, runs, least=True).run == 100
    assert spread(np.array([np.nan]), runs[:1]) is None


def test_paired_difference_removes_common_noise():
    noise = np.random.default_rng(1).normal(0.0, 10.0, 400)
    result = paired_difference(noise, noise + np.tile([0.9, 1.1], 200))
    assert result.value == pytest.approx(1.0)
    assert result.high - result.low == pytest.approx(2.0 * 1.966 * 0.1 / 20.0, rel=0.01)


def test_rank_correlation_of_monotone_and_independent_columns():
    x = np.random.default_rng(2).uniform(size=500)
    assert rank_correlation(x, np.exp(5.0 * x)).value == pytest.approx(1.0)
    none = rank_correlation(x, np.random.default_rng(3).uniform(size=500))
    assert none.low < 0.0 < none.high
    together = rank_correlation(x, np.random.default_rng(3).uniform(size=500), tests=5)
    assert together.high - together.low == pytest.approx(2.5758 / 1.9600 * (none.high - none.low), rel=0.01)
    assert np.isnan(rank_correlation(x, np.ones(500)).value)


def test_variance_shares_of_ishigamis_function():
    x = np.random.default_rng(4).uniform(-np.pi, np.pi, (4000, 3))
    y = np.sin(x[:, 0]) + 7.0 * np.sin(x[:, 1]) ** 2 + 0.1 * x[:, 2] ** 4 * np.sin(x[:, 0])
    result = [variance_share(column, y) for column in x.T]
    assert [s.value for s in result] == pytest.approx([0.3139, 0.4424, 0.0], abs=0.04)  # Saltelli et al. 2008
    assert [s.low > 0.0 for s in result] == [True, True, False]
    assert np.isnan(variance_share(np.ones(100), y[:100]).value)


def test_ratio_change_is_relative_and_paired():
    a = np.random.default_rng(6).uniform(0.1, 10.0, 400)
    result = ratio_change(a, a * np.tile([1.03, 1.05], 200))
    assert result.value == pytest.approx(0.04, abs=1e-4)
    assert 0.038 < result.low < result.high < 0.042
    assert percent(result, signed=True) == "+4.00 % (95 % confidence interval +3.90 to +4.09)"
    assert percent(interval(0, 100)) == "0 % (95 % confidence interval 0 to 4)"
    assert percent(interval(0, 100_000)) == "0.000 % (95 % confidence interval 0.000 to 0.004)"


def test_least_failing_value_is_bracketed():
    for limit, nominal, drawn in ((3.3, 0.0, 10.0), (-7.77, 1.0, -20.0)):
        distance = abs(limit - nominal)
        least, passes = least_failing(lambda x, n=nominal, d=distance: abs(x - n) > d, nominal, drawn)
        assert abs(passes - nominal) <= distance < abs(least - nominal)
        assert abs(least - passes) < 2.0 * abs(drawn - nominal) / 128


def test_ellipse_contains_share_of_points():
    points = np.random.default_rng(5).multivariate_normal([1.0, 2.0], [[4.0, 1.5], [1.5, 1.0]], 20000)
    outline = ellipse(points, 0.95) - points.mean(axis=0)
    inverse = np.linalg.inv(np.cov(points.T))
    radius = np.einsum("ni,ij,nj->n", outline, inverse, outline)
    away = points - points.mean(axis=0)
    assert radius == pytest.approx(radius[0])
    assert (np.einsum("ni,ij,nj->n", away, inverse, away) < radius[0]).mean() == pytest.approx(0.95, abs=0.005)


BLOCKED_PROPELLER = 'multibody.event=[{time=1.0, propeller=2, failure="locked"}]'


@pytest.mark.long
@pytest.mark.parametrize(
    ("scene", "overrides"),
    [
        ("hover", []),
        ("delivery_mission", ["run.duration=20.0"]),
        ("delivery_mission", ["run.duration=10.0", "communication.coupling=jacobi"]),
        ("hover", ["effects.battery.initial_charge=0.071"]),
        ("hover", ["run.duration=2.0", "vehicle.model=multibody", *MISSION, BLOCKED_PROPELLER]),
    ],
    ids=["hover", "mission", "parallel", "battery", "five bodies and an event"],
)
def test_campaign_equals_single_process(scene, overrides, tmp_path):
    in_memory = fly(reseed(campaign_config(load(scene, overrides)), 7), TOPICS)
    assert in_memory.failure == ""
    rate = in_memory.config.rate
    config = resolve(load(scene, [*overrides, "run.seed=7", f"rates.estimate={rate}"]))
    with LogWriter(tmp_path / "log.mcap", {}, {}) as writer:
        run_single(BlockDiagram(config, create_all(config), KEPT_TICKS), Recording(writer, config))
    recorded = FlightData.read(tmp_path / "log.mcap")
    names = [t.name.removeprefix("{vehicle}/") for t in TOPICS]
    assert synthetic_flights.differences(in_memory, recorded, [name for name in names if recorded.has(name)]) == []
    assert (in_memory.finished, in_memory.landed) == (recorded.finished, recorded.landed)
    assert in_memory.rmse == recorded.rmse
    assert in_memory.status.failsafe.any() == (
        "effects.battery.initial_charge=0.071" in overrides
    )  # the commander acts


@pytest.mark.long
def test_reused_memory_does_not_change_rows():
    values, rows = plan("hover", ("run.duration=4",), runs=3, vary={"vehicle.mass": parse("uniform(9, 11)")}), {}
    reused = [row_of(values, run, rows) for run in (0, 1, 2, 0)]
    alone = [row_of(values, run) for run in (0, 1, 2, 0)]
    assert repr(reused) == repr(alone)  # to the last digit, NaN included
    assert reused[0] != reused[1]
