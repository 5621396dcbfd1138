"""Text, key and pickling of configuration errors."""

import pickle

import pytest

from lapwing.dynamics.config_error import ConfigError


@pytest.mark.parametrize(
    ("error", "text"),
    [
        (ConfigError("a.b", "got -1", "a number above 0"), "a.b: expected a number above 0, got -1"),
        (ConfigError("a.b", "missing", "a number"), "a.b: missing; expected a number"),
        (ConfigError("a", "excludes b"), "a: excludes b"),
        (ConfigError("", "excludes b"), "excludes b"),
        (ConfigError.unknown("a", "effect", "wnd", ["wind", "rain"]), "a: unknown effect 'wnd'; did you mean wind? "
         "expected one of rain, wind"),
        (ConfigError.unknown("a", "effect", "x", ["wind", "rain"]),
         "a: unknown effect 'x'; expected one of rain, wind"),
    ],
)  # fmt: skip
def test_error_has_expected_text(error, text):
    assert str(error) == text
    assert isinstance(error, ValueError)
    assert str(pickle.loads(pickle.dumps(error))) == text


def test_error_key_gets_prefix_of_its_table():
    inner = ConfigError("rate", "got -1", "a number above 0")
    assert inner.with_prefix("sensors.imu").key == "sensors.imu.rate"
    assert ConfigError("", "excludes b").with_prefix("effects.a").key == "effects.a"
    assert inner.with_prefix("").key == "rate"
