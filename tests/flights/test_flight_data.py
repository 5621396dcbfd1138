"""Flight data from logs and from simulations in memory."""

import pickle

import numpy as np
import pytest
import synthetic_flights

from lapwing.cosim.config.provenance import attachments, metadata
from lapwing.cosim.config.serialise import digest
from lapwing.cosim.diagram.block_diagram import BlockDiagram
from lapwing.cosim.executors.single_process import KEPT_TICKS, run_single
from lapwing.cosim.log import LogWriter
from lapwing.cosim.log.log_sequencer import Recording
from lapwing.flights.flight_data import FlightData
from lapwing.messages.topics import SETPOINT, TRUTH
from lapwing.services.process_table import create_all
from lapwing.services.scene_resolver import load, resolve
from lapwing.studies.simulate import fly

SCENE = "hover"
TICKS = 500
UPSIDE_DOWN = (1.0, 0.0, 0.0, 0.0)


@pytest.fixture(scope="module")
def run():
    return resolve(load(SCENE, ["run.duration=2.0"]))


@pytest.fixture(scope="module")
def in_memory(run):
    return fly(run)


@pytest.fixture(scope="module")
def recorded(run, tmp_path_factory):
    path = tmp_path_factory.mktemp("flight") / "hover.mcap"
    with LogWriter(path, metadata(run, "single-process"), attachments(run, {})) as writer:
        run_single(BlockDiagram(run, create_all(run), KEPT_TICKS), Recording(writer, run))
    return FlightData.read(path)


def test_log_and_memory_flight_are_equal(recorded, in_memory):
    assert set(in_memory.topics) == set(recorded.topics) - {"wall_time"}
    assert synthetic_flights.differences(in_memory, recorded, in_memory.topics) == []
    assert in_memory.digest == recorded.digest != ""
    assert in_memory.rmse == recorded.rmse
    assert in_memory.energy == recorded.energy
    assert digest(recorded.config) == digest(in_memory.config)
    assert recorded.origin.scene == in_memory.origin.scene
    assert recorded.metadata["config"] == in_memory.metadata["config"]


def test_only_requested_topics_are_kept(run):
    result = fly(run, (TRUTH, SETPOINT))
    assert result.topics == ["ground_truth", "setpoint"]
    with pytest.raises(ValueError, match="hover: unknown topic 'status'; expected one of ground_truth, setpoint"):
        result.status  # noqa: B018


def test_only_requested_ports_have_full_history(run):
    diagram = BlockDiagram(run, create_all(run), 64, {"truth"})
    diagram.advance(run.last_tick + 1)
    deep, shallow = diagram.history("truth", 1), diagram.rows("setpoint", np.arange(64))
    assert len(deep) == TICKS + 1
    assert len(np.unique(deep[:, 2])) > 100  # the height at every tick, from the first on
    assert shallow.shape[0] == 64
    assert diagram.rows("setpoint", np.array([0]))[0].tolist() != deep[0].tolist()
    assert (
        diagram.rows("setpoint", np.array([0])).tolist() == diagram.rows("setpoint", np.array([128])).tolist()
    )  # a ring


def test_flight_can_be_pickled(run):
    result = fly(run, (TRUTH,))
    again = pickle.loads(pickle.dumps(result))
    assert np.array_equal(again.truth.position, result.truth.position)
    assert again.energy == result.energy


def test_failure_is_reported():
    result = fly(load("gyrostat_feedback", ["gyrostat.cubic_gain=[-1e250, -1e250, -1e250]", "run.duration=1.0"]))
    assert "not finite" in result.failure
    assert np.isfinite(result.truth.position).all()


def ended(**truth):
    """Return a flight whose autopilot reports a landing."""
    columns = {
        "pose.position": np.linspace((0.0, 0.0, 0.35), (1.0, 0.0, 2.0), 10),
        "pose.orientation": synthetic_flights.LEVEL,
        "velocity": (0.0, 0.0, 0.0),
        "ground_contact": np.arange(10) > 5,
    }
    return synthetic_flights.flight(10, ground_truth=columns | truth, status={"finished": True, "landed": True})


def test_landed_means_upright_slow_and_in_contact():
    assert ended().landed
    assert not ended(**{"pose.orientation": UPSIDE_DOWN}).landed
    half = np.radians(40.0) / 2.0
    assert not ended(**{"pose.orientation": (np.sin(half), 0.0, 0.0, np.cos(half))}).landed
    assert not ended(velocity=(0.4, 0.4, 0.0)).landed
    assert not ended(ground_contact=False).landed
    stood = np.linspace((0.0, 0.0, 0.35), (1.0, 0.0, 0.36), 10)  # a plant without contact information
    assert ended(**{"ground_contact": False, "pose.position": stood}).landed


def test_landed_requires_report_of_autopilot():
    truth = {"pose.position": (0.0, 0.0, 0.0), "pose.orientation": synthetic_flights.LEVEL, "velocity": (0.0, 0.0, 0.0),
             "ground_contact": True}  # fmt: skip
    assert not synthetic_flights.flight(10, ground_truth=truth).landed
    assert not synthetic_flights.flight(10, ground_truth=truth, status={"finished": False, "landed": True}).landed
    assert not synthetic_flights.flight(10, ground_truth=truth, status={"finished": True, "landed": False}).landed


def test_flight_lands(in_memory):
    assert not in_memory.landed  # two seconds are too short
    assert fly(load(SCENE)).landed
