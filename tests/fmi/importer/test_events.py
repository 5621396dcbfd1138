import math
from pathlib import Path

import pytest
from event_fmu import write_event_fmu
from opened_fmu import OpenedFmu

pytest.importorskip("fmpy")

from lapwing.fmi.importer.host_process import HostError

G = 9.81
OUTPUTS = ["h", "v", "count", "bounces"]


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("ball") / "ball.fmu"
    write_event_fmu(path)
    return path


def height(t: float, e: float) -> tuple[float, float, int]:
    """Return height, velocity and number of bounces of a ball that falls from 1 m."""
    begin, v, bounces = math.sqrt(2.0 / G), math.sqrt(2.0 * G), 0
    if t < begin:
        return 1.0 - 0.5 * G * t * t, -G * t, 0
    while True:
        v, bounces = v * e, bounces + 1
        if t < begin + 2.0 * v / G:
            s = t - begin
            return v * s - 0.5 * G * s * s, v - G * s, bounces
        begin += 2.0 * v / G


@pytest.mark.long
@pytest.mark.parametrize("step", [0.004, 0.3])
def test_state_events_are_located_exactly(path: Path, step: float) -> None:
    fmu = OpenedFmu(path, OUTPUTS, ["u"], start={"e": 0.8})
    fmu.initialise(-4.0, -5.81)
    for k in range(1, round(1.8 / step) + 1):
        h, v, _, bounces = fmu.advance(k * step, -4.0, -5.81)
        expected = height(k * step, 0.8)
        assert (h, v) == pytest.approx(expected[:2], abs=1e-8)
        assert bounces == expected[2]
    assert bounces >= 2


@pytest.mark.long
@pytest.mark.parametrize("step", [0.004, 0.03, 0.2])
def test_time_events_occur_at_their_time(path: Path, step: float) -> None:
    fmu = OpenedFmu(path, OUTPUTS, ["u"])
    fmu.initialise(0.0, 0.0)
    for k in range(1, round(0.6 / step) + 1):
        count = fmu.advance(k * step, 0.0, 0.0)[2]
        assert count == math.floor(k * step / 0.05 + 1e-9)


@pytest.mark.long
def test_changed_inputs_act_from_begin_of_step(path: Path) -> None:
    fmu = OpenedFmu(path, OUTPUTS, ["u"])
    fmu.initialise(0.0, 0.0)
    assert fmu.advance(0.1, 0.0, 0.0)[:2] == (1.0, 0.0)
    h, v, _, _ = fmu.advance(0.2, 1.0, 2.0)
    assert (h, v) == pytest.approx((1.015, 0.3), abs=1e-12)


def test_array_elements_are_set_and_read_separately(path: Path) -> None:
    fmu = OpenedFmu(path, ["y[1]", "y[0]"], ["u[1]"], start={"u": [2.0, 3.0]})
    fmu.initialise(1.0)
    assert fmu.advance(0.5, 1.0) == pytest.approx((1.5, 1.375))  # v, h at an acceleration of 2 + 1


def test_number_beyond_type_is_error(path: Path) -> None:
    fmu = OpenedFmu(path, ["h"], ["small"])
    fmu.initialise(-128.0)
    fmu.advance(0.1, 127.0)
    with pytest.raises(HostError, match="small cannot be set to 128"):
        fmu.advance(0.2, 128.0)
