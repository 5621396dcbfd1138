"""Errors of configurations, and effects found in folders."""

import pickle
import sys
from typing import Annotated, Literal, NamedTuple

import pytest
from annotated_types import Ge, Gt, Le
from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError, field_validator

from lapwing.dynamics import discovery
from lapwing.dynamics.config_error import ConfigError
from lapwing.dynamics.validation import fault


class Inner(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)
    share: float = Field(default=0.5, ge=0.0, le=1.0)


class Outer(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)
    inner: Inner | None = None
    several: tuple[Inner, ...] = Field(default=(), strict=False)
    triple: tuple[float, float, float] = Field(default=(0.0, 0.0, 0.0), strict=False)
    either: float | Literal["auto"] = "auto"
    count: Annotated[int, Gt(0)] = 1
    name: str = Field(default="a", pattern="^[a-z]+$")
    on: bool = False
    by_name: dict[Literal["x", "y"], float] = {}
    even: int = 0

    @field_validator("even")
    @classmethod
    def _even(cls, value):
        if value % 2:
            raise ConfigError("", f"got {value}", "an even number")
        return value


KEYS = "charge, delay, force, length, nested, sizes"


class Tuple(NamedTuple):
    charge: Annotated[float, Gt(0), Le(1)]
    length: Annotated[float, Gt(0)] = 1.0  # [m] of something
    force: tuple[float, float, float] = (0.0, 0.0, 0.0)  # [N]
    nested: Inner = Inner()
    delay: Annotated[float, Ge(0)] | None = None
    sizes: tuple[float, Annotated[float, Gt(0)]] = (1.0, 1.0)


@pytest.mark.parametrize(
    ("table", "text"),
    [
        ({"inner": {"share": 2.0}}, "inner.share: expected a number at least 0 and at most 1, got 2.0"),
        ({"inner": {"share": "2"}}, "inner.share: expected a number at least 0 and at most 1, got '2'"),
        ({"inner": {"shar": 2.0}}, "inner.shar: unknown key 'shar'; did you mean share? expected one of share"),
        ({"several": [{}, {"share": -1}]}, "several.1.share: expected a number at least 0 and at most 1, got -1"),
        ({"triple": [1.0, 2.0]}, "triple.2: missing; expected a number"),
        ({"triple": [1.0, "a", 3.0]}, "triple.1: expected a number, got 'a'"),
        ({"count": 0}, "count: expected a whole number above 0, got 0"),
        ({"count": 1.5}, "count: expected a whole number above 0, got 1.5"),
        ({"name": "A"}, "name: expected a text of the form ^[a-z]+$, got 'A'"),
        ({"name": 3}, "name: expected a text, got 3"),
        ({"on": 1}, "on: expected true or false, got 1"),
        ({"by_name": {"z": 1.0}}, "by_name.z: expected 'x' or 'y', got 'z'"),
        ({"even": 3}, "even: expected an even number, got 3"),
        ({"inner": {"share": float("nan")}}, "inner.share: expected a finite number, got nan"),
    ],
)
def test_model_fault_has_key_value_and_expectation(table, text):
    with pytest.raises(ValidationError) as caught:
        Outer.model_validate(table)
    assert str(fault(caught.value, Outer)) == text


@pytest.mark.parametrize(
    ("table", "text"),
    [
        ({}, "charge: missing; expected a number above 0 and at most 1"),
        ({"charge": 2.0}, "charge: expected a number above 0 and at most 1, got 2.0"),
        ({"charge": 0.5, "delay": -1.0}, "delay: expected a number at least 0, got -1.0"),
        ({"charge": 0.5, "length": -1.0}, "length: expected a number above 0 [m], got -1.0"),
        (
            {"charge": 0.5, "force": (0.0, "x", 0.0)},
            "force.1: expected a number [N], got 'x'",
        ),
        ({"charge": 0.5, "nested": 3}, "nested: expected a table of share, got 3"),
        ({"charge": 0.5, "sizes": (1.0, -1.0)}, "sizes.1: expected a number above 0, got -1.0"),
        ({"chrge": 0.5}, f"chrge: unknown key 'chrge'; did you mean charge? expected one of {KEYS}"),
    ],
)
def test_named_tuple_fault_has_key_value_and_expectation(table, text):
    with pytest.raises(ValidationError) as caught:
        TypeAdapter(Tuple, config=ConfigDict(strict=True)).validate_python(table)
    assert str(fault(caught.value, Tuple)) == text


def test_long_value_is_cut():
    with pytest.raises(ValidationError) as caught:
        Outer.model_validate({"name": list(range(1000))})
    assert len(str(fault(caught.value, Outer))) < 120


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


@pytest.fixture
def package(tmp_path, monkeypatch):
    folder = tmp_path / "discovered"
    folder.mkdir()
    (folder / "__init__.py").write_text("")
    (folder / "second.py").write_text("VALUE = 2")
    (folder / "first.py").write_text("VALUE = 1")
    (folder / "_private.py").write_text("raise RuntimeError")
    (folder / "broken.py").write_text("import nothing_of_that_name")
    monkeypatch.syspath_prepend(tmp_path)
    discovery._names.cache_clear()
    discovery._module.cache_clear()
    yield "discovered"
    for name in [n for n in sys.modules if n.partition(".")[0] == "discovered"]:
        del sys.modules[name]
    discovery._names.cache_clear()
    discovery._module.cache_clear()


def test_names_are_sorted_and_private_modules_left_out(package):
    assert discovery.names(package) == ["broken", "first", "second"]


def test_one_module_is_imported_without_others(package):
    assert discovery.get(package, "first", "thing").VALUE == 1
    assert "discovered.second" not in sys.modules


def test_all_modules_are_found_by_name(package, tmp_path):
    (tmp_path / package / "broken.py").write_text("VALUE = 0")
    result = discovery.modules(package)
    assert [(name, m.VALUE) for name, m in result.items()] == [("broken", 0), ("first", 1), ("second", 2)]
    assert discovery.modules(sys.modules[package]) == result


def test_failed_import_names_module(package):
    with pytest.raises(ImportError, match="nothing_of_that_name"):
        discovery.modules(package)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("frist", "unknown thing 'frist'; did you mean first? (things: broken, first, second)"),
        ("zebra", "unknown thing 'zebra' (things: broken, first, second)"),
        ("_private", "unknown thing '_private' (things: broken, first, second)"),
    ],
)
def test_unknown_name_lists_choices(package, name, message):
    with pytest.raises(ValueError) as raised:
        discovery.get(package, name, "thing")
    assert str(raised.value) == message


def test_choice_from_mapping_lists_choices():
    assert discovery.choose({"a": 1}, "a", "preset") == 1
    with pytest.raises(ValueError, match=r"unknown preset 'b' \(presets: a\)"):
        discovery.choose({"a": 1}, "b", "preset")
