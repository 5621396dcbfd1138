import pytest

from lapwing.cosim.config import provenance
from lapwing.flights.logs import log_comparison

RECORDED = {"commit": "abc", "mode": "single-process"}


@pytest.mark.parametrize(
    ("metadata", "here", "beginning"),
    [
        (RECORDED, "abc", "equal"),
        (RECORDED, "def", "not certain"),
        (RECORDED, "abc+", "unknown"),
        ({"mode": "single-process"}, "abc", "unknown"),
        ({**RECORDED, "mode": "imported"}, "abc", "imported"),
    ],
)
def test_expectation_follows_from_commits(monkeypatch, metadata, here, beginning):
    monkeypatch.setattr(log_comparison, "source_commit", lambda: here)
    assert log_comparison.expectation(metadata).startswith(beginning)


def test_facts_name_this_machine():
    facts = {fact.name: fact for fact in log_comparison.facts({**provenance.machine(), "processor": "armv9"})}
    assert facts["python"].recorded == facts["python"].here
    assert facts["processor"].recorded != facts["processor"].here
    assert facts["commit"].recorded == "unknown"
