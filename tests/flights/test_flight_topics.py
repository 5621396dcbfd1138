"""Topics of a flight as arrays and tables."""

import sys

import numpy as np
import pytest

from lapwing.flights.topic_view import TopicView
from lapwing.services.scene_resolver import load, resolve
from lapwing.studies.simulate import fly

TICKS = 500


@pytest.fixture(scope="module")
def in_memory():
    return fly(resolve(load("hover", ["run.duration=2.0"])))


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
    with pytest.raises(AttributeError, match="no field speed"):
        truth.speed  # noqa: B018
    with pytest.raises(AttributeError, match="no field position"):
        in_memory.status.position  # noqa: B018


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
