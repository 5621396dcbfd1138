"""Type hashes against published ones of ROS 2 and those of the rosbags library."""

import pytest
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from lapwing.messages import TYPES
from lapwing.messages.parse import parse
from lapwing.services.ros2.node import known_type_hash, type_hash

STANDARD = get_typestore(Stores.ROS2_JAZZY)
PUBLISHED = {  # from rmw_zenoh's documentation and ROS 2 nodes
    "std_msgs/msg/String": "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18",
    "std_msgs/msg/Header": "RIHS01_f49fb3ae2cf070f793645ff749683ac6b06203e41c891e17701b1cb597ce6a01",
}


@pytest.mark.parametrize(("name", "published"), PUBLISHED.items())
def test_hash_equals_published(name, published):
    assert known_type_hash(name) == published


@pytest.mark.parametrize("name", TYPES)
def test_hash_equals_rosbags_library(name):
    """Compare with the library's definitions of standard types, and with Lapwing's text for the others."""
    store = STANDARD
    if name not in STANDARD.fielddefs:
        store = get_typestore(Stores.EMPTY)
        store.register(get_types_from_msg(TYPES[name].schema_text, name))
    assert known_type_hash(name) == store.hash_rihs01(name)


def test_hash_covers_every_kind_of_field():
    text = """
bool a
byte b
int8 d
uint8 e
int16 f
uint16 g
int32 h
uint32 i
int64 j
uint64 k
float32 l
float64[3] m
string[] n
Other o
Other[] p
uint8 CONSTANT=1
"""
    other = "float32[] x\n"
    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(other, "own/msg/Other") | get_types_from_msg(text, "own/msg/Every"))
    definitions = {name: parse(name, t) for name, t in (("own/msg/Every", text), ("own/msg/Other", other))}
    assert type_hash("own/msg/Every", definitions) == store.hash_rihs01("own/msg/Every")
