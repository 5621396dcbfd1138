"""Random scenes: valid scenes fly, and repeated flights are bit-for-bit identical."""

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from lapwing.studies.stability.cases.random_scenes import flights
from lapwing.studies.stability.flights import finite


@pytest.mark.long
@given(st.integers(0, 2**31))
@settings(max_examples=8, deadline=None, suppress_health_check=[HealthCheck.too_slow])
def test_valid_random_scene_flies_repeatably(seed):
    result = flights(seed)
    if result is None:
        return
    first, second = result
    assert not first.failure
    assert finite(first)
    assert first.digest == second.digest
