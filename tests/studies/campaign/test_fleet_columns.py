"""Campaigns of fleets: columns of the worst vehicle and of each vehicle."""

import json

import numpy as np
import pytest
from typer.testing import CliRunner

from lapwing.cli.main import app
from lapwing.flights.metrics import metrics
from lapwing.services.scene_resolver import load, resolve
from lapwing.studies.campaign.campaign_config import TOPICS
from lapwing.studies.campaign.folder import read
from lapwing.studies.campaign.plan import plan
from lapwing.studies.campaign.results import Results
from lapwing.studies.campaign.runs import row_of
from lapwing.studies.simulate import fly_each
from lapwing.views.report.plot import NotRecordedError
from lapwing.views.studies.campaign_plots import errors, touchdown
from tests.cosim.memory_log import fly

pytestmark = pytest.mark.long

SHORT = ("run.duration=2.0", 'vehicle.2.success.require=["max_tilt < 0.001"]')
VARY = [
    "--vary",
    "vehicle.0.airframe.mass.total=uniform(9.5,10.5)",
    "--vary",
    "effects.wind_constant.velocity.0=uniform(0,3)",
]


def run_lapwing(*arguments):
    result = CliRunner().invoke(app, [str(a) for a in arguments])
    assert "Traceback" not in result.output
    return result.exit_code, result.output


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("campaign") / "fleet"
    sets = [part for text in SHORT for part in ("--set", text)]
    code, output = run_lapwing("campaign", "fleet", *sets, *VARY, "--runs", 3, "--workers", 1, "--out", path)
    assert code == 0, output
    return path, output


def test_each_flight_of_fleet_has_all_vehicles():
    config = resolve(load("fleet", ["run.duration=1.0"]))
    flights, log = fly_each(config, TOPICS), fly(config)
    assert [flight.vehicle for flight in flights] == ["left", "right", "scout"]
    for flight in flights:
        assert (flight.truth.position == log.view(f"{flight.vehicle}/ground_truth").position).all()
        assert (flight.setpoint.position == log.view(f"{flight.vehicle}/setpoint").position).all()
        assert flight.config.vehicle == flight.vehicle
        assert set(flight.fleet) == {"left", "right", "scout"}


def test_row_has_worst_of_vehicles_and_each_of_them(folder):
    path, output = folder
    result = Results(read(path))
    assert result.vehicles == ["left", "right", "scout"]
    for name in ("rmse.x", "max_tilt", "max_distance"):
        each = [result[f"{vehicle}.{name}"] for vehicle in result.vehicles]
        assert (result[name] == np.max(each, axis=0)).all()
    assert result["energy"] == pytest.approx(sum(result[f"{vehicle}.energy"] for vehicle in result.vehicles))
    assert not result["success"].any()
    assert result["left.success"].all()
    assert not result["scout.success"].any()
    assert all(text.startswith("scout: Completed") for text in result["outcome_text"])
    assert 4.0 < result["nearest"].min() < 4.3  # initial separation 4.24 m
    assert "Smallest separation of two vehicles" in output


def test_report_shows_every_vehicle(folder):
    path, _ = folder
    page, result = (path / "report.html").read_text(), Results(read(path))
    for vehicle in result.vehicles:
        assert f'<th scope="row">{vehicle}</th>' in page
    lines = {mark.name: mark for mark in errors(result).panels[0].marks}
    assert set(lines) == {"left", "right", "scout"}
    for vehicle, line in lines.items():
        assert np.array_equal(line.x, np.sort(result[f"{vehicle}.rmse.x"]))
    with pytest.raises(NotRecordedError, match="no vehicle touches down"):
        touchdown(result)


def test_varied_key_reaches_named_vehicle(folder):
    result = Results(read(folder[0]))
    masses = result["vehicle.0.airframe.mass.total"]
    assert len(set(masses)) == 3
    # a climb with more mass needs more energy
    assert (np.argsort(masses) == np.argsort(result["left.energy"])).all()
    assert json.loads((folder[0] / "campaign.json").read_text())["vehicles"] == result.vehicles


def test_repeated_run_has_equal_row():
    values = plan("fleet", SHORT, runs=2)
    rows = {}
    first = [row_of(values, run, rows) for run in (0, 1, 0)]
    assert repr(first[0]) == repr(first[2])
    assert first[0]["end_state"] != first[1]["end_state"]
    flights = fly_each(resolve(load("fleet", [*SHORT, "run.seed=1", "rates.estimate=250"])), TOPICS)
    assert metrics(flights[1])["rmse.z"] == first[0]["right.rmse.z"]


def test_repeated_run_is_bit_for_bit_identical(folder, tmp_path):
    code, output = run_lapwing(
        "run", "fleet", "--run", 1, "--campaign", folder[0], "--mode", "single-process", "--log", tmp_path / "a.mcap"
    )
    assert "final state bit-for-bit identical" in output
    assert code == 4  # the run fails
