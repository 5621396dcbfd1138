"""The learning example changes its policy; docs/benchmarks.md has its results."""

import math

import pytest

pytest.importorskip("skrl", reason="the extra learn is not installed")
pytest.importorskip("jax", reason="the extra learn is not installed")

pytestmark = pytest.mark.long


def test_few_updates_change_policy(monkeypatch):
    from examples import ppo_hover

    monkeypatch.setattr(ppo_hover, "VEHICLES", 8)
    monkeypatch.setattr(ppo_hover, "EVALUATED", 4)
    before, after = ppo_hover.main(2 * ppo_hover.ROLLOUT)
    assert all(map(math.isfinite, (*before, *after)))
    assert before != after
