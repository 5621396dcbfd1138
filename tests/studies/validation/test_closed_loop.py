import json
from dataclasses import replace

import numpy as np
import pytest
from flight_recordings import INTERVAL, simulated
from page_texts import page_text

from lapwing.flights.log_import.open_flight import open_flight
from lapwing.studies.validation.closed_loop import fly_setpoints
from lapwing.studies.validation.plant_rows import MOTION, PlantRows
from tests.commands import run_command

pytestmark = pytest.mark.long

SCENE = "crazyflie_21"


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    path = tmp_path_factory.mktemp("flown") / "flown.mcap"
    run_command("run", SCENE, "--mode", "single-process", "--log", path, code=0)
    return path


def test_flight_under_its_setpoints_is_reproduced(log):
    flights = fly_setpoints(SCENE, open_flight(log))
    assert flights.time[-1] > 3.0
    assert flights.difference < 0.01  # begins in the recording's climb, from rest


def test_flight_without_setpoints_is_left_out(log):
    assert fly_setpoints(SCENE, replace(open_flight(log), setpoint=np.empty((0, 3)))) is None


def test_power_matches_closed_form():
    plant = PlantRows(SCENE, INTERVAL)
    blocks = plant.start(np.zeros(3, int))
    plant.write(blocks, slice(0, MOTION), np.tile([0.0, 0.0, 3.0, 1.0, *[0.0] * 9], (3, 1)))
    volts = np.array([[2.0, 2.5, 3.0, 3.5]] * 3)
    plant.advance(blocks, volts)
    speed = plant.read(blocks, slice(MOTION, MOTION + 4), 3)
    layout = plant.example.parameters.layout
    drag = next(e.torque_constant for e in plant.example.parameters.effects if hasattr(e, "torque_constant"))
    current = drag * speed**2 / layout.volt_per_speed + layout.no_load_current
    assert plant.power(blocks, 3) == pytest.approx((volts * current).sum(axis=1), rel=1e-9)


def test_power_of_simulated_flight_is_predicted(log):
    from lapwing.studies.validation.procedure import FIELDS, validate

    result = validate(SCENE, [log], None, (1, 50))
    power = result.plant[-1][FIELDS.index("power")].mean
    assert power < 0.01 * np.nanmean(open_flight(log).power)


def test_recording_without_power_has_no_power_error():
    from lapwing.studies.validation.prediction_metrics import constant_velocity

    (flight,) = simulated(PlantRows(SCENE, INTERVAL), 2.0, [1])
    assert np.isnan(constant_velocity(flight, np.arange(20, 40), (1, 10)).power).all()


def test_command_overlays_closed_loop(log, tmp_path):
    out, page = tmp_path / "errors.json", tmp_path / "page.html"
    done = run_command(
        "validate", SCENE, log, "--closed-loop", "--horizons", "50", "--json", out, "--report", page, code=0
    )
    assert "Closed loop: distance from the recorded flight" in done.stdout
    (flight,) = json.loads(out.read_text())["closed_loop"]
    assert flight["difference"] < 0.05
    assert "Closed loop with the recorded setpoints" in page_text(page)


@pytest.mark.parametrize("scene", ["delivery_mission", "crazyflie_21", "px4_quad", "betaflight_quad", "ardupilot_quad"])
@pytest.mark.parametrize("interval", [0.01, 0.008])
def test_sensor_rates_need_not_divide_rate_of_recording(scene, interval):
    assert PlantRows(scene, interval).interval == interval


def test_command_validates_log_with_sensors(tmp_path):
    path, out = tmp_path / "flown.mcap", tmp_path / "errors.json"
    calm = ["--set", "effects.random_wind_force.mean=[0.0, 0.0, 0.0]", "--set", "effects.random_wind_force.sigma=0.0"]
    options = ["--set", "run.duration=15.0", "--set", "success.require=[]", *calm]
    run_command("run", "delivery_mission", "--mode", "single-process", "--log", path, *options, code=0)
    run_command("validate", "delivery_mission", path, "--json", out, *calm, code=0)
    for row in json.loads(out.read_text())["horizons"]:
        error, baseline = row["position"], row["baselines"]["constant_velocity"]["position"]
        assert error < 1e-3, row["steps"]
        assert error < 0.25 * baseline, row["steps"]
