"""Studies of a scene that a foreign firmware flies: one line that names the fault, and no traceback."""

import pytest

from tests.services.firmware_links import lapwing


def error_of(code, *arguments):
    (line,) = lapwing(*arguments, code=code).stderr.splitlines()
    return line


def test_campaign_without_program_is_rejected(tmp_path):
    line = error_of(2, "campaign", "px4_quad", "--runs", "2", "--out", str(tmp_path / "campaign"))
    assert "autopilot.command" in line
    assert "px4" in line


@pytest.mark.long
@pytest.mark.parametrize("workers", ["1", "2"])
def test_campaign_names_firmware_that_does_not_start(workers, tmp_path):
    line = error_of(
        1, "campaign", "px4_quad", "--runs", "2", "--workers", workers, "--out", str(tmp_path / "campaign"),
        "--set", "run.duration=1", "--set", 'autopilot.command=["true"]',
    )  # fmt: skip
    assert "px4: the program ended" in line


@pytest.mark.parametrize("command", ["tune", "effects"])
def test_study_of_repeatable_flights_rejects_firmware(command, tmp_path):
    line = error_of(2, command, "px4_quad")
    assert "px4_quad.toml" in line
    assert 'autopilot.firmware = "lapwing"' in line
