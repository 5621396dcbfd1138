"""Scenes drawn at random: those that validate fly, and fly alike twice."""

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from lapwing.studies.stability.cases.random_scenes import flights
from lapwing.studies.stability.flights import finite


@given(st.integers(0, 2**31))
@settings(max_examples=8, deadline=None, suppress_health_check=[HealthCheck.too_slow])
def test_what_validates_flies_and_flies_alike_twice(seed):
    found = flights(seed)
    if found is None:
        return
    first, second = found
    assert not first.failure
    assert finite(first)
    assert first.digest == second.digest
