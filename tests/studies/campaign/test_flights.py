"""Flights of a campaign equal those of the single-process executor."""

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
from lapwing.studies.campaign.plan import plan
from lapwing.studies.campaign.runs import row_of
from lapwing.studies.simulate import fly
from tests.combinations import MISSION

pytestmark = pytest.mark.long

BLOCKED_PROPELLER = 'multibody.event=[{time=1.0, propeller=2, failure="locked"}]'


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


def test_reused_memory_does_not_change_rows():
    values, rows = plan("hover", ("run.duration=4",), runs=3, vary={"vehicle.mass": parse("uniform(9, 11)")}), {}
    reused = [row_of(values, run, rows) for run in (0, 1, 2, 0)]
    alone = [row_of(values, run) for run in (0, 1, 2, 0)]
    assert repr(reused) == repr(alone)  # to the last digit, NaN included
    assert reused[0] != reused[1]
