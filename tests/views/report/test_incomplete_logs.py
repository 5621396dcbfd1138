"""Reports of logs that are truncated, damaged or without data."""

import pytest
from circle_report import SECONDS, Page, messages, record, report

from lapwing.flights.flight_data import FlightData
from lapwing.messages import Imu, header
from lapwing.views.report import write


def test_other_file_endings_are_rejected(log, tmp_path):
    with pytest.raises(ValueError, match=r"circle\.txt: expected a name that ends in \.html, \.pdf or \.png"):
        write(FlightData.read(log), tmp_path / "circle.txt")


def test_truncated_log_has_report(log, tmp_path):
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(log.read_bytes()[: log.stat().st_size // 2])
    page = Page(report(cut))
    assert page.after("landed") == "no"
    assert page.after("digest") == "none: the log is incomplete"
    assert 0.0 < float(page.after("duration").removesuffix(" s")) < SECONDS
    assert page.after("x [m]") == "0.1000"
    assert "position" in page.plots


def test_missing_data_is_reported(tmp_path):
    page = Page(report(record(tmp_path / "bare.mcap", messages(std=0.0, rotors=0, reference=False), {})))
    text = " ".join(page.texts)
    assert set(page.plots) == {"mission_map", "timeline", "position", "turning", "attitude", "path", "air"}
    assert "Not shown: the vehicle has no motors." in text
    assert "Not shown: the estimate has no standard deviations (it is the truth)." in text
    assert "The log has no reference" in text


def test_single_sample_is_enough(tmp_path):
    page = Page(report(record(tmp_path / "short.mcap", list(messages())[:5])))
    assert page.after("duration") == "0.00 s"
    assert "position" in page.plots


@pytest.mark.parametrize(
    ("content", "complaint"), [(None, "no such file"), (b"no log", "not an MCAP file")], ids=["missing", "foreign"]
)
def test_non_log_file_is_rejected(tmp_path, content, complaint):
    path = tmp_path / "x.mcap"
    if content:
        path.write_bytes(content)
    with pytest.raises(ValueError, match=complaint) as fault:
        report(path)
    assert str(path) in str(fault.value)
    assert "\n" not in str(fault.value)
    assert not path.with_suffix(".html").exists()


def test_log_without_flight_is_rejected(tmp_path):
    path = record(tmp_path / "imu.mcap", [("imu", Imu(header(0, "drone1")))])
    with pytest.raises(ValueError, match="no flight in this log"):
        report(path)


def test_damaged_scene_is_named(tmp_path):
    path = record(tmp_path / "scene.mcap", messages(), {"config.json": b"[run"})
    with pytest.raises(ValueError, match=r"scene\.mcap: its attachment config\.json cannot be read"):
        report(path)


def test_unwritable_report_error_is_one_line(log, tmp_path):
    copy = tmp_path / "a.mcap"
    copy.write_bytes(log.read_bytes())
    copy.with_suffix(".html").mkdir()
    with pytest.raises(ValueError, match=r"a\.html: cannot be written: "):
        report(copy)
