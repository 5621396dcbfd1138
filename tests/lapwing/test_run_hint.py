"""Advice of a slow flight in processes."""

import pytest

from lapwing.runs.multi_process_run import Clock
from lapwing.runs.observer import Elapsed, Silent
from lapwing.services.scene_resolver import load, resolve


@pytest.mark.parametrize(
    ("wall", "block_times", "text"),
    [
        (20.0, {"plant": 1.5, "autopilot": 0.5}, "the same bits in about 2.0 s instead of 20.0 s"),
        (3.0, {"plant": 0.2, "autopilot": 0.1}, ""),  # short
        (20.0, {"plant": 9.0, "autopilot": 2.0}, ""),  # one process is hardly faster
        (20.0, {"plant": 1.5}, ""),  # unknown
    ],
)
def test_slow_flight_in_processes_advises_single_process(wall, block_times, text):
    clock = Clock(Silent(), resolve(load("hover")))
    clock.elapsed = Elapsed(17.0, wall)
    clock._block_times = block_times
    assert clock.faster_mode(["plant", "autopilot"]).removeprefix("--mode single-process: ") == text
