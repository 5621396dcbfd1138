"""Provenance of a log."""

import subprocess

import pytest

from lapwing.cosim.config import provenance


@pytest.mark.parametrize("error", [FileNotFoundError("git"), subprocess.TimeoutExpired("git", 60.0)])
def test_run_does_not_need_git(error, monkeypatch):
    """On a machine at a load of 40, git did not answer within 5 s and ended the recorder."""

    def fail(*_arguments, **_options):
        raise error

    provenance.source_commit.cache_clear()
    monkeypatch.delenv("LAPWING_COMMIT", raising=False)
    monkeypatch.setattr(provenance.subprocess, "run", fail)
    assert provenance.source_commit() == "unknown"
    provenance.source_commit.cache_clear()
