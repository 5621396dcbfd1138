"""Round trip of trees through canonical text: equal values, types and text."""

import json
import math
import subprocess
import sys
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from lapwing.cosim.config.serialise import ABSENT, digest, first_difference, from_json, to_json
from lapwing.dynamics.effects.gravity import Gravity


class Pair(NamedTuple):
    left: Any
    right: Any = 0.5


@dataclass(frozen=True)
class Point:
    x: Any
    y: Any


@dataclass
class Mutable:
    x: float


LEAVES = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(-(2**70), 2**70),
    st.floats(allow_nan=False),
    st.text(),
    arrays(np.float64, array_shapes(min_dims=0, max_dims=3, max_side=3), elements=st.floats(allow_nan=False)),
    arrays(np.int64, array_shapes(max_dims=2, max_side=3)),
    arrays(bool, 3),
    st.integers(0, 2**64 - 1).map(np.uint64),
    st.floats(allow_nan=False).map(np.float64),
)
TREES = st.recursive(
    LEAVES,
    lambda inner: st.one_of(
        st.lists(inner, max_size=4),
        st.lists(inner, max_size=4).map(tuple),
        st.dictionaries(st.one_of(st.text(), st.just("$")), inner, max_size=4),
        st.builds(Pair, inner, inner),
        st.builds(Point, inner, inner),
    ),
    max_leaves=12,
)


def types_of(tree):
    if isinstance(tree, dict):
        return {key: types_of(value) for key, value in tree.items()}
    if isinstance(tree, tuple | list):
        return type(tree), [types_of(value) for value in tree]
    return (type(tree), tree.dtype, tree.shape) if isinstance(tree, np.ndarray) else type(tree)


@given(TREES)
def test_tree_round_trips(tree):
    text = to_json(tree)
    again = from_json(text)
    assert to_json(again) == text
    assert types_of(again) == types_of(tree)
    assert first_difference(tree, again) is None
    assert digest(again) == digest(tree)


@given(TREES, TREES)
def test_trees_differ_where_their_digests_do(a, b):
    result = first_difference(a, b)
    assert (result is None) == (digest(a) == digest(b))


@given(st.dictionaries(st.text(), st.integers(), min_size=2))
def test_text_is_independent_of_key_order(table):
    assert to_json(dict(reversed(table.items()))) == to_json(table)


@pytest.mark.parametrize("value", [math.inf, -math.inf, math.nan, -0.0, 5e-324, 0.1 + 0.2, 2**63, 2**64 - 1])
def test_numbers_are_exact(value):
    again = from_json(to_json(value))
    assert repr(again) == repr(value)
    json.loads(to_json(value), parse_constant=lambda name: pytest.fail(f"{name} is not JSON"))


def test_class_is_restored_from_its_name():
    text = to_json(Gravity(9.81))
    assert text == '{"$":"lapwing.dynamics.effects.gravity:Gravity","acceleration":9.81}'
    assert from_json(text) == Gravity(9.81)
    assert type(from_json(text)) is Gravity


@pytest.mark.parametrize(
    ("text", "output"),
    [
        ('{"$":"none.such:Thing"}', "none.such:Thing: no such class; expected one of lapwing or "),
        ('{"$":"lapwing.dynamics.effects.gravity:Weight"}', "Weight: no such class"),
        ('{"$":"pathlib:Path"}', "pathlib:Path: expected a NamedTuple"),
        ('{"$":"this:Thing"}', "this:Thing: no such class; expected one of lapwing or "),
        ('{"$":"lapwing.dynamics.effects.gravity:Gravity","g":1}', "has the fields acceleration, got g"),
        ('{"$":"tuple"}', "damaged 'tuple'"),
        ("{", "Expecting"),
    ],
)
def test_invalid_text_is_rejected_with_message(text, output):
    with pytest.raises(ValueError, match=output):
        from_json(text)


def test_unsupported_value_is_rejected_with_path():
    class Local(NamedTuple):
        x: float

    for tree, output in (
        ({"a": [1, {2}]}, r"a\.1: a builtins\.set cannot"),
        ({"a": Mutable(1.0)}, "a: a .*Mutable cannot"),
        ({1: 2}, "key 1: expected a text"),
        (Local(1.0), "Local: no such class"),
        (np.zeros(2, dtype=np.float32), "ndarray cannot"),
    ):
        with pytest.raises(ValueError, match=output):
            to_json(tree)


def test_first_difference_has_path():
    a = {"vehicle": Pair((1.0, [Gravity(9.81)])), "wind": 1}
    b = {"vehicle": Pair((1.0, [Gravity(9.82)])), "wind": 2}
    assert first_difference(a, b) == ("vehicle.left.1.0.acceleration", 9.81, 9.82)
    assert first_difference({"a": 1}, {}) == ("a", 1, ABSENT)
    assert first_difference((1, 2), (1,)) == ("1", 2, ABSENT)
    assert first_difference((1,), [1]) == ("", (1,), [1])
    assert first_difference({"t": np.array([1.0, 2.0])}, {"t": np.array([1.0, 3.0])}) == ("t.1", 2.0, 3.0)
    assert first_difference(0.0, -0.0) == ("", 0.0, -0.0)
    assert first_difference(math.nan, math.nan) is None


def test_import_avoids_slow_modules():
    code = (
        "import lapwing.cosim.config.serialise, sys; print([m for m in ('pydantic', 'scipy', 'numba') if m in "
        "sys.modules])"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout.strip() == "[]"


def test_text_imports_declared_modules_only(tmp_path, monkeypatch):
    (tmp_path / "somebodys.py").write_text("from typing import NamedTuple\nclass Thing(NamedTuple):\n    x: float\n")
    monkeypatch.syspath_prepend(tmp_path)
    text = '{"$":"somebodys:Thing","x":0.5}'
    with pytest.raises(ValueError, match="somebodys:Thing: no such class"):
        from_json(text)
    assert "somebodys" not in sys.modules
    assert from_json(text, ["somebodys"]) == (0.5,)
    sys.modules.pop("somebodys")


@pytest.mark.parametrize(
    "text",
    [
        '{"$":"scalar","dtype":"U1000000000","of":1}',
        '{"$":"array","dtype":"V2000000000","shape":[1],"of":[0]}',
        '{"$":"array","dtype":"float64","shape":[1000000000],"of":[0]}',
        '{"$":"array","dtype":7,"shape":[1],"of":[0]}',
    ],
)
def test_arrays_of_other_types_or_sizes_are_rejected(text):
    with pytest.raises(ValueError, match=r"damaged|reshape"):
        from_json(text)
