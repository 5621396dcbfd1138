"""Compatibility of recorded message types with those of this version."""

import pytest

from lapwing.cosim.log.log_reader import first_type_difference
from lapwing.messages import TYPES

STATE = "lapwing_msgs/msg/VehicleState"
TEXT = TYPES[STATE].schema_text


@pytest.mark.parametrize("name", TYPES)
def test_every_type_is_compatible_with_itself(name):
    text = TYPES[name].schema_text
    assert first_type_difference(name, text) == ""
    assert (
        first_type_difference(name, "# of another program\n" + text.replace("\n", "\r\n").replace("uint8 ", "char "))
        == ""
    )


def test_nested_types_may_have_any_order():
    bar = "=" * 80 + "\n"
    own, *others = TEXT.split(bar)
    ended = [part if part.endswith("\n") else part + "\n" for part in reversed(others)]
    assert first_type_difference(STATE, bar.join([own, *ended])) == ""
    assert first_type_difference("foreign/msg/A", "anything <= 3") == ""
    assert first_type_difference(STATE, "") == ""


@pytest.mark.parametrize(
    ("current", "recorded", "output"),
    [
        ("float64 air_density", "float32 air_density", "has float32 air_density where this version has float64 air_"),
        ("float64 air_density", "#", "has bool ground_contact where this version has float64 air_density"),
        ("bool ground_contact", "#", "has no more fields where this version has bool ground_contact"),
        (
            "bool ground_contact",
            "bool ground_contact\nint8 more",
            "has int8 more where this version has no more fields",
        ),
        ("float64[] rotor_speed", "float64[4] rotor_speed", "has float64[4] rotor_speed where"),
        ("float64 x", "float32 x", "has float32 pose.position.x where this version has float64 pose.position.x"),
        ("float64 air_density", "wide<=3 air_density", "has a definition that cannot be read"),
    ],
)
def test_first_type_difference_is_named(current, recorded, output):
    assert current in TEXT
    assert first_type_difference(STATE, TEXT.replace(current, recorded)).startswith(output)
