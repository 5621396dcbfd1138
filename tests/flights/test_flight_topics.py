"""Topics of a flight, recorded and live."""

import itertools
import re
import sys

import numpy as np
import pytest

import lapwing
from lapwing.cosim.diagram.block_diagram import BlockDiagram
from lapwing.cosim.executors.single_process import KEPT_TICKS
from lapwing.flights.topic_view import TopicView
from lapwing.services.common.event_kinds import KINDS
from lapwing.services.process_table import create_all
from lapwing.services.scene_resolver import load, resolve
from lapwing.studies.simulate import fly
from lapwing.views.live.live_feed import LiveFlight, new_events

TICKS = 500


@pytest.fixture(scope="module")
def in_memory():
    return fly(resolve(load("hover", ["run.duration=2.0"])))


def test_text_of_topic_states_frames_and_units(in_memory, tmp_path):
    assert "angular_velocity   # body frame (FLU) [rad/s]" in repr(in_memory.truth)
    log = lapwing.fly("hover", {"run.duration": 0.5}).save(tmp_path / "flight.mcap")
    assert repr(lapwing.read_log(log).truth).startswith("126 lapwing_msgs/msg/VehicleState\n")


def test_fields_are_attributes(in_memory):
    truth, setpoint = in_memory.truth, in_memory.setpoint
    n = TICKS + 1
    assert (truth.position.shape, truth.orientation.shape, truth.attitude.shape) == ((n, 3), (n, 4), (n, 3))
    assert np.array_equal(truth.position, in_memory.column("ground_truth", "pose.position"))
    assert np.array_equal(truth["pose.position.z"], truth.position[:, 2])
    assert (setpoint.position.shape, setpoint.yaw.shape, truth.rotor_speed.shape) == ((n, 3), (n,), (n, 4))
    assert setpoint.phase[0] == "climb"
    assert {"velocity", "rotor_speed"} <= set(dir(truth))
    assert truth.stamps == pytest.approx(truth.times)
    assert np.array_equal(truth["position"], truth.position)
    assert not {"position", "attitude"} & set(dir(in_memory.status))


@pytest.mark.parametrize(
    ("name", "error"),
    [
        ("pos", "VehicleState: unknown field 'pos'; did you mean position? expected one of acceleration, "),
        ("speed", "VehicleState: unknown field 'speed'; did you mean rotor_speed? expected one of acceleration, "),
        ("pose.position.q", "; did you mean pose.position.z? expected one of pose.position.x, pose.position.y, pose."),
    ],
)
def test_unknown_field_or_topic_names_the_nearest(in_memory, name, error):
    for kind, read in (
        (ValueError, lambda: in_memory.truth[name]),
        (ValueError, lambda: in_memory.column("ground_truth", name)),
        (AttributeError, lambda: getattr(in_memory.truth, name)),
    ):
        with pytest.raises(kind, match=re.escape(error)):
            read()
    with pytest.raises(AttributeError, match="Status: unknown field 'position'; expected one of armed, "):
        in_memory.status.position  # noqa: B018
    with pytest.raises(ValueError, match=r"topic 'ground_truht'; did you mean ground_truth\? expected one of act"):
        in_memory.column("ground_truht", "position")


def test_prompt_completes_fields_of_topic_without_reading_a_property(in_memory):
    completer = pytest.importorskip("IPython.core.completer").IPCompleter(namespace={"flight": in_memory})
    assert [name.rpartition(".")[2] for name in completer.attr_matches("flight.truth.rotor_s")] == ["rotor_speed"]


def test_poses_of_several_bodies():
    pose = np.arange(2 * 3 * 7, dtype=float).reshape(2, 3, 7)
    view = TopicView(np.arange(2), {"pose": pose})
    assert np.array_equal(view.position, pose[:, :, :3])
    assert np.array_equal(view.orientation, pose[:, :, 3:])


def test_dataframe_without_pandas(in_memory, monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(ImportError, match=r"pandas is not installed; pip install lapwing\[dataframe\]"):
        in_memory.to_dataframe()


def test_dataframe_has_column_for_every_number(in_memory):
    pytest.importorskip("pandas")
    frame = in_memory.to_dataframe("ground_truth")
    assert len(frame) == TICKS + 1
    assert frame.index.name == "time"
    assert {"pose.position.x", "velocity.z", "rotor_speed.3", "ground_contact"} <= set(frame.columns)
    assert np.array_equal(frame["rotor_speed.3"], in_memory.truth.rotor_speed[:, 3])
    assert "pose.position" not in frame.columns
    assert "phase" in in_memory.to_dataframe("setpoint").columns


STEP = 50_000_000  # [ns]


@pytest.fixture(scope="module")
def steps():
    """Return the steps of a short mission whose services deliver at different times."""
    config = resolve(load("hover", {"run.duration": 4.0}))
    diagram = BlockDiagram(config, create_all(config), KEPT_TICKS)
    live, result, delayed = LiveFlight(config), [], []
    while not diagram.ended:
        before = diagram.tick
        diagram.advance(min(diagram.tick + 30, config.last_tick + 1))
        pages = list(diagram.record_batches(before, diagram.tick))[::-1]  # a batch for each length of a message
        live.add(delayed + [page for page in pages if page.topic.name.endswith("ground_truth")])
        delayed = [page for page in pages if not page.topic.name.endswith("ground_truth")]  # delivered later
        if (step := live.step((before - 1) * config.interval_ns)) is not None:
            result.append(step)
    live.add(delayed)
    return [*result, live.step(config.last_tick * config.interval_ns)]


@pytest.fixture(scope="module")
def whole():
    return lapwing.fly("hover", {"run.duration": 4.0})


def test_steps_begin_with_last_message_before_and_form_flight(steps, whole):
    assert len(steps) > 10
    for one, other in itertools.pairwise(steps):
        assert one.times("ground_truth")[-1] == other.times("ground_truth")[0]
    rows = [step.truth.position[1:] if k else step.truth.position for k, step in enumerate(steps)]
    assert np.array_equal(np.concatenate(rows), whole.truth.position)
    rows = [step.reference[1:] if k else step.reference for k, step in enumerate(steps)]
    assert np.array_equal(np.concatenate(rows), whole.reference)


def test_events_are_reported_once(steps, whole):
    reported, after = [], -1.0
    for step in steps:
        reported += new_events(step, after)
        after = float(step.truth.times[-1])
        assert not new_events(step, after)
    assert reported == [event for event in whole.events if not KINDS[event.kind].afterwards]
    assert {event.kind for event in reported} >= {"arming", "mode", "phase", "contact"}
