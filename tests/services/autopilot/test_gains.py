import pytest
from closed_loop import AIRFRAME

from lapwing.services.autopilot.controller_parameters import build
from lapwing.services.autopilot.gains import FOLDER, load, names


def test_paper_gains_are_table_6():
    gains = load("paper")
    assert gains.altitude == (28.0, 22.0, 18.0)
    assert gains.yaw == (129.1, 181.2, 97.17)
    assert gains.roll_inner == (-3.93, -0.09, -15.68)
    assert gains.pitch_inner == (3.93, 0.089, 15.68)
    assert gains.roll_outer == gains.pitch_outer == (0.52, 0.037, 0.74)
    assert not gains.feed_forward


def test_shipped_gain_sets_build_by_name_and_path(tmp_path):
    assert {"paper", "tuned"} <= set(names())
    for name in names():
        build(load(name), AIRFRAME)
    path = tmp_path / "own.toml"
    path.write_text((FOLDER / "tuned.toml").read_text(encoding="utf-8"), encoding="utf-8")
    assert load(str(path)) == load("tuned")


def test_error_is_one_line(tmp_path):
    text = (FOLDER / "paper.toml").read_text(encoding="utf-8")
    cases = {
        "missing.toml": (None, "cannot be read"),
        "damaged.toml": ("altitude = [", "not valid TOML"),
        "unknown.toml": (text + "\nlfit = 1.0", "lfit"),
        "short.toml": (text.replace("altitude = [28.0, 22.0, 18.0]", "altitude = [28.0]"), "altitude"),
        "upright.toml": (
            text.replace("tilt_limit = 1.028", "tilt_limit = 1.6"),
            "tilt_limit: expected a number above 0 and below 1.4 [rad], got 1.6",
        ),
    }
    for name, (content, message) in cases.items():
        if content is not None:
            (tmp_path / name).write_text(content, encoding="utf-8")
        with pytest.raises(ValueError, match=r"\A[^\n]+\Z") as error:
            load(str(tmp_path / name))
        assert name in str(error.value)
        assert message in str(error.value)
    with pytest.raises(ValueError, match=r"unknown gain set 'papr'; did you mean paper\? expected one of "):
        load("papr")


def test_vehicle_too_heavy_to_hover_is_rejected():
    with pytest.raises(ValueError, match=r"below the 49.0 N"):
        build(load("paper"), AIRFRAME._replace(mass=20.0))
