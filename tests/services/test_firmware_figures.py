"""Script `firmware_figures`: geometry of the square, output in hover, a scripted flight."""

import json
import math
import subprocess
import sys

import numpy as np
import pytest

from tests.services.firmware_figures import distance_from_square, hover_duty


def test_distance_from_square_is_to_nearest_side():
    points = np.array([(5.0, 0.5), (11.0, 5.0), (5.0, 5.0), (-3.0, -4.0), (0.0, 10.0)])
    assert distance_from_square(points) == pytest.approx([0.5, 1.0, 5.0, 5.0, 0.0])


def test_output_in_hover_balances_weight():
    density = 1.225 * (1.0 - 0.0065 * 280.0 / 288.15) ** 4.2559  # standard atmosphere at home
    speed = math.sqrt(1.5 * 9.80665 / 4.0 / (5.84e-6 * density / 1.225))
    assert hover_duty("px4_quad") == pytest.approx(speed * 60.0 / (2.0 * math.pi * 946.0) / 11.1, rel=2e-3)


@pytest.mark.long
@pytest.mark.parametrize(("firmware", "rate"), [("px4", 250), ("ardupilot", 1000)])
def test_scripted_flight_counts_every_exchange(firmware, rate, tmp_path):
    command = [sys.executable, "-m", "tests.services.firmware_figures", firmware, "--scripted", "--out", str(tmp_path)]
    flight = subprocess.run([*command, "--set", "run.duration=2"], capture_output=True, text=True, check=True)
    figures = json.loads(flight.stdout.splitlines()[0])
    assert figures["steps"] == 2 * rate + 1
    assert figures["outcome"] != "failed"
    assert [figures[name] for name in ("skew", "rejected")] == [0, 0]
    assert figures["share"] == pytest.approx(figures["own_us"] / figures["firmware_us"])
    assert (tmp_path / "flight_0.mcap").exists()
    assert "0 of 1 landed" in flight.stdout
