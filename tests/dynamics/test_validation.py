"""Texts of validation errors by pydantic."""

from typing import Annotated, Literal, NamedTuple

import pytest
from annotated_types import Ge, Gt, Le
from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError, field_validator

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
        ({"charge": 0.5, "force": (0.0, "x", 0.0)}, "force.1: expected a number [N], got 'x'"),
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
