import pickle
import random
import tracemalloc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from samples import flat, sample, value, varied

from lapwing.messages import TYPES, BatteryState, Estimate, Imu, RotorWrench, Status, Vector3, header, stamp_ns
from lapwing.messages import topic_columns as module
from lapwing.messages.topic_columns import ColumnBuilder, history, history_of_batches


@pytest.mark.parametrize("name", TYPES)
@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 2**32))
def test_columns_are_fields_of_decoded_messages(name, seed):
    rng = random.Random(seed)
    shapes = [sample(name, rng) for _ in range(rng.randint(1, 3))]
    messages = [varied(rng.choice(shapes), rng) for _ in range(9)]
    columns = history(TYPES[name], [message.encode() for message in messages])
    for field, column in columns.items():
        assert len(column) == len(messages)
        for message, result in zip(messages, column, strict=True):
            result = tuple(np.ravel(result).tolist()) if isinstance(result, np.ndarray | np.generic) else result
            assert flat(result if isinstance(result, tuple) else (result,)) == flat((value(message, field),)), field


def test_topic_of_constant_shape_returns_arrays():
    times = [k * 4_000_000 for k in range(500)]
    messages = [Imu(header(t, "body"), angular_velocity=Vector3(t, 1.0, -t)) for t in times]
    columns = history(Imu, [message.encode() for message in messages])
    assert columns["angular_velocity"].tolist() == [[t, 1.0, -t] for t in times]
    assert columns["angular_velocity"].flags.c_contiguous
    assert columns["orientation_covariance"].shape == (500, 9)
    seconds, nanoseconds = columns["header.stamp.sec"], columns["header.stamp.nanosec"]
    assert (seconds * 10**9 + nanoseconds).tolist() == [stamp_ns(message.header) for message in messages]
    assert columns["header.frame_id"] == ["body"] * 500
    assert columns.keys() >= {"header.frame_id", "angular_velocity", "angular_velocity.z"}


def test_strings_of_equal_total_length_are_distinguished():
    words = [("abc", "de"), ("ab", "cde"), ("", "é鳥"), ("ab", "cde")]
    messages = [Status(mode=mode, phase=phase) for mode, phase in words]
    columns = history(Status, [message.encode() for message in messages])
    assert list(zip(columns["mode"], columns["phase"], strict=True)) == words


def test_sequences_of_varying_length():
    messages = [Estimate(rejected_sources=names) for names in [(), ("gps",), ("baro", "mag")]]
    assert history(Estimate, [m.encode() for m in messages])["rejected_sources"] == [(), ("gps",), ("baro", "mag")]
    messages = [BatteryState(cell_voltage=cells) for cells in [(), (1.5,), (2.5, 3.5), (4.5,)]]
    cells = history(BatteryState, [m.encode() for m in messages])["cell_voltage"]
    assert cells.dtype == object
    assert [cell.tolist() for cell in cells] == [[], [1.5], [2.5, 3.5], [4.5]]


def test_field_missing_in_message_has_no_column():
    messages = [RotorWrench(moment=(Vector3(),) * count) for count in (1, 2)]
    columns = history(RotorWrench, [message.encode() for message in messages])
    assert "moment.0" in columns
    assert "moment.1" not in columns
    with pytest.raises(ValueError, match=r"RotorWrench: field moment.1 is not in every message"):
        columns["moment.1"]
    with pytest.raises(KeyError, match="momnt"):
        columns["momnt"]


def test_no_messages_have_empty_columns():
    columns = history(Status, [])
    assert columns["home"].shape == (0, 3)
    assert columns["mode"] == []


def test_damaged_messages_are_rejected():
    good = Status(mode="auto").encode()
    with pytest.raises(ValueError, match="lapwing_msgs/msg/Status"):
        history(Status, [good, good[:-3]])
    at = good.index(b"auto")
    columns = history(Status, [good, good[:at] + b"\xff" + good[at + 1 :]])
    with pytest.raises(ValueError, match="field mode: a string is not UTF-8"):
        columns["mode"]


def test_batches_equal_payloads():
    messages = [
        Status(mode=mode, arming_blockers=why) for mode, why in [("a", ()), ("b", ("x",)), ("c", ()), ("d", ("y",))]
    ]
    payloads = [message.encode() for message in messages]
    expected = history(Status, payloads)

    def batch(*indices):
        return np.array(indices), np.stack([np.frombuffer(payloads[k], np.uint8) for k in indices])

    result = history_of_batches(Status, [batch(0, 2), batch(3), batch(1)])
    assert list(result) == list(expected)
    for name, column in expected.items():
        assert result[name] == column if isinstance(column, list) else np.array_equal(result[name], column), name
    assert result.payloads() == expected.payloads() == payloads
    assert list(history_of_batches(Status, [])) == list(history(Status, []))


def test_history_can_be_pickled():
    columns = history(RotorWrench, [RotorWrench(moment=(Vector3(k, 0.0, 0.0),)).encode() for k in range(3)])
    assert pickle.loads(pickle.dumps(columns))["moment.0.x"].tolist() == [0.0, 1.0, 2.0]


@pytest.mark.parametrize("count", [0, 1, 7, 8, 9, 30])
def test_incremental_columns_equal_complete_columns(monkeypatch, count):
    """Compare columns of batches of eight messages, with two shapes and texts."""
    monkeypatch.setattr(module, "BATCH", 8)
    output = [Status(header(k, "body"), phase="up" if k % 5 else "over there", armed=k > 3) for k in range(count)]
    payloads, gathered = [message.encode() for message in output], ColumnBuilder(Status)
    for k, payload in enumerate(payloads):
        gathered.add(1000 * k, payload)
    times, result = gathered.history()
    assert times.dtype == np.int64
    assert times.tolist() == [1000 * k for k in range(count)]
    whole = history(Status, payloads)
    assert list(result) == list(whole)
    assert result.payloads() == payloads
    for name in whole:
        assert np.array_equal(result[name], whole[name]), name
        assert type(result[name]) is type(whole[name])


def test_incremental_columns_store_messages_once():
    payload, count = Imu(header(0, "body")).encode(), 20_000
    gathered = ColumnBuilder(Imu)
    tracemalloc.start()
    try:
        for k in range(count):
            gathered.add(k, bytes(bytearray(payload)))
        gathered.history()
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 1.5 * count * len(payload)
