import inspect
import random
from pathlib import Path

import numpy as np
import pytest
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from samples import sample

import lapwing.messages
from lapwing.messages import TYPES, Imu, NavSatFix, Odometry, Quaternion, Status, TFMessage, Vector3, VehicleState

ROUNDS = 25
FOLDER = Path(lapwing.messages.__file__).parent / "msg"


def published_store():
    """Return the standard types of the rosbags library, and Lapwing's own types from their text."""
    store = get_typestore(Stores.LATEST)
    shipped = set(store.fielddefs)
    for name, cls in TYPES.items():
        if name not in shipped:
            types = get_types_from_msg(cls.schema_text, name)
            store.register({key: value for key, value in types.items() if key not in shipped})
    return store


STORE = published_store()


def foreign(value, store=STORE):
    """Return one of Lapwing's messages as an object of the rosbags library."""
    if hasattr(value, "type_name"):
        cls = store.types[value.type_name]
        desc = dict(store.fielddefs[value.type_name][1])
        return cls(**{name: foreign_field(getattr(value, name), desc[name], store) for name in value._fields})
    return value


def foreign_field(value, desc, store):
    kind, detail = desc
    if kind.name in ("ARRAY", "SEQUENCE"):
        (element_kind, element), _ = detail
        if element_kind.name == "BASE" and element[0] != "string":
            return np.array(value, dtype=element[0])
        return [foreign(item, store) for item in value]
    return foreign(value, store)


def samples(name):
    rng = random.Random(name)
    return [TYPES[name](), *(sample(name, rng) for _ in range(ROUNDS))]


@pytest.mark.parametrize("name", TYPES)
def test_bytes_equal_those_of_rosbags_library(name):
    for message in samples(name):
        assert message.encode() == bytes(STORE.serialize_cdr(foreign(message), name))


@pytest.mark.parametrize("name", TYPES)
def test_decode_inverts_encode(name):
    for message in samples(name):
        decoded = TYPES[name].decode(message.encode())
        assert decoded == message
        assert type(decoded) is TYPES[name]
        assert all(type(a) is type(b) for a, b in zip(decoded, message, strict=True))


@pytest.mark.parametrize("name", TYPES)
def test_payload_of_wrong_length_is_rejected(name):
    for message in samples(name)[:6]:
        payload = message.encode()
        for size in range(len(payload)):
            with pytest.raises(ValueError, match=name) as caught:
                TYPES[name].decode(payload[:size])
            assert "\n" not in str(caught.value)
        with pytest.raises(ValueError, match=name):
            TYPES[name].decode(payload + b"\0")


@pytest.mark.parametrize("name", TYPES)
def test_damaged_bytes_are_decoded_or_raise_value_error(name):
    rng = random.Random(name)
    faults = []
    for message in samples(name)[:10]:
        payload = bytearray(message.encode())
        payload[rng.randrange(len(payload))] ^= 1 << rng.randrange(8)
        try:
            TYPES[name].decode(bytes(payload))
        except ValueError as fault:
            faults.append(str(fault))
    assert not any("\n" in fault for fault in faults)


def test_huge_length_is_rejected_without_allocation():
    payload = bytearray(TFMessage().encode())
    payload[4:8] = b"\xff\xff\xff\xff"
    with pytest.raises(ValueError, match="runs past the end"):
        TFMessage.decode(bytes(payload))


def test_big_endian_payload_is_rejected():
    with pytest.raises(ValueError, match="expected CDR header"):
        Imu.decode(b"\0\0\0\0" + Imu().encode()[4:])


def test_equal_size_with_other_shape_is_distinguished():
    """Decode two strings that divide the same bytes differently; the layout cached for the size does not fit."""
    first, second = Status(mode="abcdefg", phase="hij"), Status(mode="abc", phase="defghij")
    assert len(first.encode()) == len(second.encode())
    for message in (first, second, first):
        assert Status.decode(message.encode()) == message


def test_string_of_length_zero_without_nul_is_empty_string():
    payload = Imu.decode(Imu().encode()).encode()
    assert payload[12:16] == b"\1\0\0\0"
    assert Imu.decode(payload[:12] + b"\0\0\0\0" + payload[16:]) == Imu()


@pytest.mark.parametrize(
    ("message", "words"),
    [
        (Odometry()._replace(child_frame_id=3), "nav_msgs/msg/Odometry"),
        (Imu()._replace(orientation_covariance=(0.0,) * 8), "orientation_covariance has 8 values, not 9"),
        (Imu()._replace(angular_velocity=(1.0, 2.0)), "sensor_msgs/msg/Imu"),
        (VehicleState()._replace(rotor_speed=None), "lapwing_msgs/msg/VehicleState"),
        (NavSatFix()._replace(position_covariance_type=300), "sensor_msgs/msg/NavSatFix"),
    ],
)
def test_invalid_values_are_rejected(message, words):
    with pytest.raises(ValueError, match=words) as caught:
        message.encode()
    assert "\n" not in str(caught.value)


def test_numpy_arrays_and_tuples_are_encoded():
    state = VehicleState(velocity=Vector3(1.0, 2.0, 3.0), rotor_speed=(1.0, 2.0))
    other = VehicleState(velocity=(1.0, 2.0, 3.0), rotor_speed=np.array([1.0, 2.0]))
    assert state.encode() == other.encode()


@pytest.mark.parametrize("name", TYPES)
def test_schema_text_defines_same_fields_as_published_type(name):
    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(TYPES[name].schema_text, name))
    reference = STORE.fielddefs[name]
    assert store.fielddefs[name][1] == reference[1]
    if name in get_typestore(Stores.LATEST).fielddefs:
        assert sorted(store.fielddefs[name][0]) == sorted(reference[0])  # constants


def test_each_type_has_file():
    files = {f"{path.parent.name}/msg/{path.stem}" for path in FOLDER.glob("*/*.msg")}
    assert set(TYPES) == files
    assert all(getattr(lapwing.messages, cls.__name__) is cls for cls in TYPES.values())


def test_defaults_are_zero_except_identity_quaternion():
    assert Quaternion() == (0.0, 0.0, 0.0, 1.0)
    assert Imu().header.frame_id == ""
    assert Imu().orientation_covariance == (0.0,) * 9
    assert VehicleState().rotor_speed == ()


def test_unknown_names_are_rejected():
    with pytest.raises(ImportError):
        exec("from lapwing.messages import NoSuchMessage")
    with pytest.raises(ValueError, match="unknown message type a/msg/B; known: builtin_interfaces/msg/Time"):
        lapwing.messages.message_class("a/msg/B")


def test_decode_is_static():
    assert isinstance(inspect.getattr_static(Imu, "decode"), staticmethod)
