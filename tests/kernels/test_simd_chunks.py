"""Chunks of four keep the members in order, and restore them without padding."""

import pytest

from lapwing.kernels import kernel
from lapwing.kernels.simd import chunk4, unchunk4


@kernel
def round_trip(values):
    groups = chunk4(values, -1.0)
    return groups, unchunk4(groups, values)


@pytest.mark.parametrize("n", [1, 4, 6])
def test_chunks_round_trip(n):
    values = tuple(float(i) for i in range(n))
    groups, back = round_trip(values)
    assert back == values
    assert [member for group in groups for member in group] == [*values, *[-1.0] * (-n % 4)]
    assert (groups, back) == round_trip.py_func(values)
