"""Logs of flights without some quantities, through the commands that read logs."""

import re

import numpy as np
import pytest
from flight_recordings import BATTERY
from flight_writers import GRAVITY, SAMPLES

from lapwing.flights.flight_data import FlightData
from lapwing.flights.log_import.open_flight import open_flight
from lapwing.flights.rotation_arrays import to_euler
from tests.commands import assert_rejected, run_command


def write_blackbox(path, flight, offset=48.0, full_scale=1999.0, **others):
    """Write a flight as `blackbox_decode` does, by default with DShot outputs, and other columns."""
    columns = {
        "loopIteration": np.arange(SAMPLES), " time (us)": 1e4 * np.arange(SAMPLES),
        **{f" gyroADC[{k}]": np.degrees(flight.omega[:, k]) for k in range(3)},
        **{f" accSmooth[{k}]": 2048.0 * flight.specific_force[:, k] / GRAVITY for k in range(3)},
        **{f" motor[{k}]": offset + full_scale * flight.motor_voltage[:, k] / BATTERY for k in range(4)},
        " vbatLatest (V)": flight.battery_voltage,
        **others,
    }  # fmt: skip
    table = np.column_stack(list(columns.values()))
    np.savetxt(path, table, "%.6f", ",", header=",".join(columns), comments="")
    return path


def shown(page):
    """Return the titles of the drawn sections of a report."""
    parts = re.split(r"<h2[^>]*>", page.read_text(encoding="utf-8"))
    return [part.split("<")[0].strip() for part in parts if "Not shown" not in part]


@pytest.mark.long
@pytest.mark.parametrize("attitude", [False, True], ids=["rates", "attitude"])
def test_flight_without_position_has_a_report(tmp_path, flight, attitude):
    angles = to_euler(flight.attitude).T if attitude else ()
    source = write_blackbox(
        tmp_path / "f.csv", flight, **dict(zip((" roll", " pitch", " heading"), angles, strict=bool(attitude)))
    )
    log = tmp_path / "f.mcap"
    run_command("import", source, "--mapping", "betaflight", "--out", log, code=0)
    for arguments in (("report", log), ("report", log, "--out", tmp_path / "f.pdf"), ("info", log)):
        done = run_command(*arguments)
        assert (done.returncode, done.stderr) == (0, "")
    titles = shown(tmp_path / "f.html")
    assert {"Angular velocity", "Motors: speed, voltage and power", "Battery"} <= set(titles)
    assert ("Attitude" in titles) == attitude
    assert not {"Position", "Mission map", "Path from the side"} & set(titles)
    assert_rejected(run_command("render", log, "--out", tmp_path / "f.png"))


def test_unmeasured_quantities_of_a_log_are_nan(tmp_path, flight):
    from lapwing.flights.log_import.write_log import write_log

    source = open_flight(write_blackbox(tmp_path / "f.csv", flight), "betaflight")
    write_log(tmp_path / "f.mcap", source, "f.csv")
    log = FlightData.read(tmp_path / "f.mcap")
    assert not log.located
    assert np.isnan(log.truth.attitude).all()
    assert log.truth.angular_velocity == pytest.approx(flight.omega, abs=1e-6)
    assert np.isnan(log.topic("battery").percentage).all()
    again = open_flight(tmp_path / "f.mcap")
    assert again.valid.all()
    assert again.omega == pytest.approx(flight.omega[: len(again)], abs=1e-6)


def test_pulses_are_scaled_by_their_mapping(tmp_path, flight):
    source = write_blackbox(tmp_path / "f.csv", flight, 1000.0, 1000.0)
    result = open_flight(source, "betaflight_pwm")
    assert result.motor_voltage == pytest.approx(flight.motor_voltage, abs=1e-6)
    assert not any("suspected" in note for note in result.notes)
    assert any("suspected" in note for note in open_flight(source, "betaflight").notes)
