import random

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from samples import flat, sample, value, varied

from lapwing.messages import (
    TYPES,
    BodyStates,
    Clock,
    Imu,
    Pose,
    RotorWrench,
    Vector3,
    VehicleState,
    header,
    stamp,
    stamp_ns,
)
from lapwing.messages.cdr_arrays import Record, number_fields, stamp_columns

N = 7
TWO_ROTORS = VehicleState(header(0, "world"), rotor_speed=(1.0, 2.0))


def payloads(records):
    return [record.tobytes() for record in records]


@pytest.mark.parametrize("name", TYPES)
@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 2**32))
def test_batch_bytes_equal_single_encodings(name, seed):
    rng = random.Random(seed)
    base = sample(name, rng)
    messages = [varied(base, rng) for _ in range(N)]
    record = Record.of(base)
    fields = number_fields(record.dtype)
    outermost = [field for field in fields if not any(field.startswith(f"{other}.") for other in fields)]
    innermost = [field for field in fields if not any(other.startswith(f"{field}.") for other in fields)]
    for chosen in (outermost, innermost):
        columns = {}
        for field in chosen:
            numbers = np.array([flat(value(message, field)) for message in messages])
            columns[field] = numbers.reshape(N, *record.dtype[field].shape)
        assert payloads(record.encode(N, columns)) == [message.encode() for message in messages]


def test_without_columns_sample_is_repeated():
    records = Record.of(TWO_ROTORS).encode(3, {})
    assert payloads(records) == [TWO_ROTORS.encode()] * 3
    assert records.dtype.itemsize == len(TWO_ROTORS.encode())
    assert payloads(Record.of(TWO_ROTORS).encode(0, {"velocity": np.empty((0, 3))})) == []


def test_copies_keep_strings_and_padding():
    records = Record.of(TWO_ROTORS).encode(6, {"air_density": np.arange(6.0)})
    expected = payloads(records)
    assert payloads(records.copy()) == expected
    assert payloads(records[[3, 1, 2]]) == [expected[k] for k in (3, 1, 2)]
    assert payloads(np.ascontiguousarray(records[::2])) == expected[::2]


def test_nested_float64_messages_are_one_field():
    dtype = Record.of(TWO_ROTORS).dtype
    assert dtype["pose"].shape == (7,)
    assert dtype["pose.position"].shape == (3,)
    assert dtype["rotor_speed"].shape == (2,)
    records = Record.of(TWO_ROTORS).encode(1, {"pose.orientation": np.array([[1.0, 2.0, 3.0, 4.0]])})
    assert VehicleState.decode(records.tobytes()).pose.orientation == (1.0, 2.0, 3.0, 4.0)  # x, y, z, w
    assert records["pose.orientation.w"] == 4.0


def test_elements_of_sequences_have_their_number_in_name():
    bodies = BodyStates(name=("a", "b"), pose=(Pose(),) * 2, velocity=(Vector3(),) * 2)
    record = Record.of(bodies)
    decoded = BodyStates.decode(record.encode(1, {"pose.1.position": (1.0, 2.0, 3.0)}).tobytes())
    assert [pose.position for pose in decoded.pose] == [(0.0, 0.0, 0.0), (1.0, 2.0, 3.0)]
    assert record.dtype["velocity"].shape == (2, 3)


def test_single_value_and_column_of_width_one_are_broadcast():
    lift = Record.of(RotorWrench(thrust=(0.0,), moment=(Vector3(),)))
    column = np.array([1.0, 2.0, 3.0])
    records = lift.encode(3, {"thrust": column, "moment.0": (4.0, 5.0, 6.0), "moment.0.z": 7})
    decoded = [RotorWrench.decode(payload) for payload in payloads(records)]
    assert [message.thrust for message in decoded] == [(1.0,), (2.0,), (3.0,)]
    assert {message.moment for message in decoded} == {((4.0, 5.0, 7.0),)}


def test_stamp_columns_have_given_times():
    times = np.array([0, 999_999_999, 1_000_000_000, 86_400_000_000_004])
    records = Record.of(Imu(header(5, "body"))).encode(4, stamp_columns(times))
    assert [stamp_ns(Imu.decode(payload).header) for payload in payloads(records)] == times.tolist()
    records = Record.of(Clock()).encode(4, stamp_columns(times, "clock"))
    assert payloads(records) == [Clock(stamp(t)).encode() for t in times.tolist()]


def test_whole_floats_fit_integer_fields():
    records = Record.of(TWO_ROTORS).encode(2, {"ground_contact": np.array([0.0, 1.0])})
    assert [VehicleState.decode(payload).ground_contact for payload in payloads(records)] == [False, True]


@pytest.mark.parametrize(
    ("columns", "words"),
    [
        ({"rotor_sped": 0.0}, "VehicleState: no field rotor_sped; near it: rotor_speed"),
        ({"CDR": 0.0}, "no field CDR"),
        ({"header.frame_id": 0.0}, "no field header.frame_id"),
        ({"rotor_speed": np.zeros((3, 4))}, r"rotor_speed has shape \(3, 4\), expected \(3, 2\) or \(2,\) or \(\)"),
        ({"velocity": np.zeros(4)}, r"column velocity has shape \(4,\)"),
        ({"air_density": np.zeros(2)}, r"column air_density has shape \(2,\), expected \(3,\) or \(\)"),
        ({"air_density": "dense"}, "column air_density holds <U5, expected numbers"),
        ({"ground_contact": 2.0}, "column ground_contact holds values that bool cannot"),
        ({"header.stamp.nanosec": np.array([0, -1, 0])}, "nanosec holds values that uint32 cannot"),
        ({"header.stamp.sec": np.array([0.0, np.nan, 0.0])}, "sec holds values that int32 cannot"),
    ],
)
def test_invalid_columns_are_rejected(columns, words):
    with pytest.raises(ValueError, match=words) as caught:
        Record.of(TWO_ROTORS).encode(3, columns)
    assert "\n" not in str(caught.value)
