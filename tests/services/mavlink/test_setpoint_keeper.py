"""Repeated setpoints: the autopilot loses a sender when COM_OF_LOSS_T has run out on both clocks."""

import math

import pytest

from lapwing.services.mavlink.clock import Clock, Instant
from lapwing.services.mavlink.setpoint_keeper import SetpointKeeper

TIMEOUT, STEP = 1.0, 0.02  # [s], of simulation time


class Autopilot:
    """Receiver of commands that stores the time of the newest setpoint."""

    def __init__(self, clock):
        self.clock, self.at, self.commands = clock, 0.0, []

    def put(self, kind, source, values=()):
        self.at = self.clock.now.time_ns * 1e-9
        self.commands.append((kind, source, tuple(values)))


def loss(speed):
    """Return the simulation time [s] of the loss after one setpoint at 0, and the repeated commands."""
    clock = Clock()
    clock.now = Instant(0, 0.0)
    autopilot = Autopilot(clock)
    keeper = SetpointKeeper(clock, autopilot, lambda: TIMEOUT)
    keeper.hold("offboard_position", "1/2", (1.0, 2.0))
    for tick in range(1, 5000):
        t = tick * STEP
        clock.now = Instant(round(t * 1e9), t / speed)
        keeper.step()
        if t - autopilot.at > TIMEOUT:
            return t, autopilot.commands
    raise AssertionError("it is never lost")


@pytest.mark.parametrize("speed", [0.5, 1.0])
def test_setpoint_is_not_repeated_up_to_real_time(speed):
    at, inputs = loss(speed)
    assert at == pytest.approx(TIMEOUT, abs=2 * STEP)
    assert inputs == []


@pytest.mark.parametrize("speed", [3.0, 5.0, 20.0])
def test_setpoint_is_lost_by_wall_time_in_fast_runs(speed):
    at, inputs = loss(speed)
    assert at / speed == pytest.approx(TIMEOUT, abs=0.3 / speed + 0.01)
    assert set(inputs) == {("offboard_position", "1/2", (1.0, 2.0))}


def test_newer_setpoint_replaces_older():
    clock = Clock()
    clock.now = Instant(0, 0.0)
    autopilot = Autopilot(clock)
    keeper = SetpointKeeper(clock, autopilot, lambda: TIMEOUT)
    keeper.hold("offboard_position", "1/2", (1.0,))
    keeper.hold("offboard_attitude", "1/2", (2.0,))
    clock.now = Instant(400_000_000, 0.1)
    keeper.step()
    assert autopilot.commands == [("offboard_attitude", "1/2", (2.0,))]


def test_setpoint_is_not_repeated_without_timeout():
    clock = Clock()
    autopilot = Autopilot(clock)
    keeper = SetpointKeeper(clock, autopilot, lambda: math.nan)
    keeper.hold("offboard_position", "1/2", (1.0,))
    clock.now = Instant(400_000_000, 0.1)
    keeper.step()
    assert autopilot.commands == []
