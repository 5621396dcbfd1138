"""Studies of a scene that a foreign firmware flies: one line that names the fault, and no traceback."""

import pytest

from tests.services.firmware_links import lapwing, program, scripted


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


def test_tune_and_effects_name_what_is_missing():
    tune, effects = error_of(2, "tune", "px4_quad"), error_of(2, "effects", "px4_quad")
    assert "px4_quad.toml: px4 has its own gains" in tune
    assert 'autopilot.firmware = "lapwing"' in tune
    assert "px4_quad.toml: autopilot.command: each flight starts px4" in effects
    line = error_of(2, "effects", "px4_quad", "--set", "autopilot.repeatable=false", *program(["true"]))
    assert "autopilot.repeatable = false" in line


@pytest.mark.long
def test_effects_of_firmware_scene_are_compared():
    options = "--only", "body_drag", "--set", "run.duration=2"
    done = lapwing("effects", "px4_quad", *options, *program(scripted("px4")))
    assert "smallest set of effects within 0.01 m: gravity" in done.stdout
    assert "body_drag" in done.stdout
