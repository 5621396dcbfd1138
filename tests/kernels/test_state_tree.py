"""Tree operations: shapes, hand-written values, compiled and uncompiled code."""

import math
import random
from typing import NamedTuple

import numba
import pytest

from lapwing.dynamics.lie import quaternion
from lapwing.dynamics.lie.quaternion import Quaternion
from lapwing.kernels import kernel, state_tree


class State(NamedTuple):
    position: tuple
    attitude: Quaternion
    omega: tuple
    rotors: tuple
    nothing: None
    empty: tuple
    one: tuple


def some(seed, attitude=True):
    r = random.Random(seed)
    vec = lambda n: tuple(r.uniform(-1, 1) for _ in range(n))  # noqa: E731
    q = quaternion.normalise(Quaternion(*vec(4))) if attitude else vec(3)
    return State(vec(3), q, vec(3), (r.random(), vec(2)), None, (), vec(1))


X, U, V = some(1), some(2, attitude=False), some(3, attitude=False)


def test_retract_adds_on_floats_and_turns_attitudes():
    y = state_tree.retract(X, V)
    assert y.position == tuple(a + b for a, b in zip(X.position, V.position, strict=True))
    assert y.attitude == quaternion.retract(X.attitude, V.attitude)
    assert y.rotors[1][1] == X.rotors[1][1] + V.rotors[1][1]
    assert (y.nothing, y.empty, len(y.one)) == (None, (), 1)
    assert type(y) is State
    assert type(y.attitude) is Quaternion


def test_embed_is_derivative_of_retract():
    h = 1e-6
    forward, backward = state_tree.retract(X, state_tree.scale(h, V)), state_tree.retract(X, state_tree.scale(-h, V))
    difference = state_tree.scale(0.5 / h, state_tree.axpy(-1.0, backward, forward))
    derivative = state_tree.embed(X, V)
    assert difference.attitude == pytest.approx(derivative.attitude, abs=1e-9)
    assert difference.rotors[1] == pytest.approx(derivative.rotors[1], abs=1e-9)


def test_axpy_steps_over_stored_numbers_and_keeps_class():
    y = state_tree.axpy(0.5, state_tree.embed(X, V), X)
    assert type(y.attitude) is Quaternion
    assert y.attitude.z == X.attitude.z + 0.5 * quaternion.embed(X.attitude, V.attitude)[3]
    assert state_tree.axpy(2.0, U, V).attitude == tuple(
        v + 2.0 * u for u, v in zip(U.attitude, V.attitude, strict=True)
    )


def test_bracket_and_transport_are_trivial_on_floats():
    assert state_tree.bracket(X, U, V).position == (0.0, 0.0, 0.0)
    assert state_tree.bracket(X, U, V).attitude == quaternion.bracket(U.attitude, V.attitude)
    assert state_tree.transport(X, U, V).position == V.position


def test_flatten_and_unflatten_are_inverse():
    flat = state_tree.flatten(X)
    assert len(flat) == 3 + 4 + 3 + 3 + 1
    assert flat[3:7] == tuple(X.attitude)
    assert state_tree.unflatten(X, flat) == X


@kernel
def everything(x, u, v):
    y = state_tree.normalise(state_tree.axpy(0.1, state_tree.embed(x, v), x))
    return state_tree.retract(
        y, state_tree.transport(x, u, state_tree.bracket(x, u, state_tree.scale(2.0, v)))
    ), state_tree.flatten(y)


def test_compiled_and_uncompiled_code_agree_bit_for_bit():
    assert everything(X, U, V) == everything.py_func(X, U, V)


def test_state_of_invalid_type_is_rejected():
    with pytest.raises(numba.TypingError, match="manifold leaves in a state"):
        state_tree.retract((1.0, "text"), (1.0, 1.0))


def test_relative_difference_is_relative_to_size():
    y = X._replace(rotors=(X.rotors[0] + 0.3, X.rotors[1]), one=(X.one[0] - 0.01,))
    assert state_tree.relative_difference(X, y) == pytest.approx(0.3 / (1.0 + X.rotors[0]))
    assert state_tree.relative_difference(X, X) == state_tree.relative_difference((), ()) == 0.0


@kernel
def compiled_difference(x, y):
    return state_tree.relative_difference(x, y)


def test_relative_difference_is_independent_of_nesting():
    """Compare nested with flat numbers bit for bit; NaN is ignored."""
    numbers = random.Random(1)
    for nan in (False, True):
        x, y = ([numbers.uniform(-9.0, 9.0) for _ in range(9)] for _ in range(2))
        y[4] = math.nan if nan else y[4]
        flat = max(abs(a - b) / (1.0 + abs(a)) for a, b in zip(x, y, strict=True) if not math.isnan(b))
        nested_x, nested_y = (((), (n[:3], n[3:6]), (n[6], (n[7],)), n[8]) for n in (tuple(x), tuple(y)))
        assert state_tree.relative_difference(nested_x, nested_y) == compiled_difference(nested_x, nested_y) == flat
