"""Faults as values, and the sentence that they become."""

import pickle

import pytest

from lapwing.dynamics.config_error import KeyedError


@pytest.mark.parametrize(
    ("error", "text"),
    [
        (KeyedError("a.b", "got -1", "a number above 0"), "a.b: expected a number above 0, got -1"),
        (KeyedError("a.b", "missing", "a number"), "a.b: missing; expected a number"),
        (KeyedError("a", "excludes b"), "a: excludes b"),
        (KeyedError("", "excludes b"), "excludes b"),
        (KeyedError.unknown("a", "effect", "wnd", ["wind", "rain"]), "a: unknown effect 'wnd'; did you mean wind? "
         "expected one of rain, wind"),
        (KeyedError.unknown("a", "effect", "x", ["wind", "rain"]), "a: unknown effect 'x'; expected one of rain, wind"),
    ],
)  # fmt: skip
def test_the_line(error, text):
    assert str(error) == text
    assert isinstance(error, ValueError)
    assert str(pickle.loads(pickle.dumps(error))) == text


def test_a_fault_seen_from_the_table_around_it():
    inner = KeyedError("rate", "got -1", "a number above 0")
    assert inner.under("sensors.imu").key == "sensors.imu.rate"
    assert KeyedError("", "excludes b").under("effects.a").key == "effects.a"
    assert inner.under("").key == "rate"
