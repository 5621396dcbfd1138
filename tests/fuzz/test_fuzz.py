"""Readers of damaged bytes raise only ValueError; `python -m tests.fuzz` tries more inputs."""

from functools import cache

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.fuzz.mutate import mutated
from tests.fuzz.targets import TARGETS


@cache
def made(name):
    if name in ("requests", "websocket"):
        pytest.importorskip("foxglove", reason="needs the extra `foxglove`")
    return TARGETS[name]()


@pytest.mark.parametrize("name", TARGETS)
def test_damaged_bytes_raise_only_value_error(name):
    target = made(name)

    @settings(max_examples=60, deadline=None, database=None, derandomize=True)
    @given(st.randoms(use_true_random=False))
    def attempt(chance):
        try:
            target.read(mutated(chance, target.seeds))
        except ValueError:
            return

    attempt()


@pytest.mark.parametrize("name", TARGETS)
def test_valid_bytes_are_read(name):
    for seed in made(name).seeds:
        made(name).read(seed)
