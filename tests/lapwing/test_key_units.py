"""Units of scene keys, and their display in the report of a campaign."""

import os
import subprocess
import sys

import pytest
from page_texts import page_text

from lapwing.file_schemas.json_schema import key_units


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
    command = [sys.executable, "-m", "lapwing", "campaign", "hover", "--runs", "12", "--workers", "1", "--out", "c"]
    command += ["--vary", "vehicle.mass=uniform(10.0,10.8)", "--report", "c.html"]
    subprocess.run(command, cwd=tmp_path, check=True, capture_output=True, env=os.environ | {"PYTHONPATH": os.getcwd()})
    page = page_text(tmp_path / "c.html")
    assert '"text":"vehicle.mass [kg]"' in page
    command[command.index("c.html")] = "c.pdf"
    subprocess.run(command, cwd=tmp_path, check=True, capture_output=True, env=os.environ | {"PYTHONPATH": os.getcwd()})
    assert (tmp_path / "c.pdf").read_bytes().count(b"/MediaBox [ 0 0 595.44 841.68 ]") >= 2
