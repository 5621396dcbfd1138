"""A flight of a campaign is that of the single executor, column by column."""

import made_up
import pytest

from cosim.graph import Graph
from cosim.log import LogWriter
from cosim.recording import Recording
from cosim.single import PAGE, run_single
from services.processes import create_all
from services.table import load, reseed, resolve
from studies.campaign.distributions import parse
from studies.campaign.plan import plan
from studies.campaign.runs import row_of
from studies.campaign.setup import TOPICS, campaign_setup
from studies.flight import Flight
from studies.fly import fly

pytestmark = pytest.mark.long

BREAKS = 'multibody.event=[{time=1.0, propeller=2, becomes="locked"}]'


@pytest.mark.parametrize(
    ("scene", "overrides"),
    [
        ("hover", []),
        ("delivery_mission", ["run.duration=20.0"]),
        ("delivery_mission", ["run.duration=10.0", "exchange.coupling=parallel"]),
        ("hover", ["effects.battery.charge=0.071"]),
        ("hover", ["run.duration=2.0", "vehicle.model=multibody", BREAKS]),
    ],
    ids=["hover", "mission", "parallel", "battery", "five bodies and an event"],
)
def test_a_campaign_flies_what_the_single_executor_flies(scene, overrides, tmp_path):
    in_memory = fly(reseed(campaign_setup(load(scene, overrides)), 7), TOPICS)
    assert in_memory.failure == ""
    rate = in_memory.setup.rate
    setup = resolve(load(scene, [*overrides, "run.seed=7", f"rates.estimate={rate}"]))
    with LogWriter(tmp_path / "log.mcap", {}, {}) as writer:
        run_single(Graph(setup, create_all(setup), PAGE), Recording(writer, setup))
    recorded = Flight.read(tmp_path / "log.mcap")
    assert made_up.differences(in_memory, recorded, [t.name.removeprefix("{vehicle}/") for t in TOPICS]) == []
    assert (in_memory.finished, in_memory.landed) == (recorded.finished, recorded.landed)
    assert in_memory.rmse == recorded.rmse
    assert in_memory.status.failsafe.any() == ("effects.battery.charge=0.071" in overrides)  # the commander acts


def test_runs_in_the_memory_of_others_are_the_same():
    given, rows = plan("hover", ("run.duration=4",), runs=3, vary={"vehicle.mass": parse("uniform(9, 11)")}), {}
    reused = [row_of(given, run, rows) for run in (0, 1, 2, 0)]
    alone = [row_of(given, run) for run in (0, 1, 2, 0)]
    assert repr(reused) == repr(alone)  # to the last digit, NaN included
    assert reused[0] != reused[1]
