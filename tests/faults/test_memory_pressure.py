"""A run names the process that the kernel killed, and leaves nothing behind."""

import pytest

from tests.combinations import NIGHTLY
from tests.faults import memory_pressure

pytestmark = [
    pytest.mark.long,
    NIGHTLY,
    pytest.mark.skipif(not memory_pressure.available(), reason="needs permission to create memory cgroups"),
]


@pytest.mark.parametrize("seed", range(3))
def test_run_with_little_memory_names_killed_process(seed):
    assert memory_pressure.fly(seed, 180.0).wrong == []
