"""Units of scene keys, and their display in the report of a campaign."""

import pytest
from page_texts import page_text

from lapwing.file_schemas.key_units import key_units
from tests.commands import run_command


def test_units_come_from_scene_and_airframe_schemas():
    keys = (
        "vehicle.mass",
        "effects.random_wind_force.sigma",
        "airframe.motor.resistance",
        "solver.step",
        "run.seed",
        "a.b",
    )
    assert key_units(keys) == {
        "vehicle.mass": "kg",
        "effects.random_wind_force.sigma": "m/s",
        "airframe.motor.resistance": "ohm",
        "solver.step": "s",
    }


@pytest.mark.long
def test_campaign_report_has_units_of_parameters(tmp_path):
    command = ["campaign", "hover", "--runs", "12", "--workers", "1", "--out", "c"]
    command += ["--vary", "vehicle.mass=uniform(10.0,10.8)", "--report"]
    run_command(*command, "c.html", code=0, folder=tmp_path)
    assert '"text":"vehicle.mass [kg]"' in page_text(tmp_path / "c.html")
    run_command(*command, "c.pdf", code=0, folder=tmp_path)
    assert (tmp_path / "c.pdf").read_bytes().count(b"/MediaBox [ 0 0 595.44 841.68 ]") >= 2
