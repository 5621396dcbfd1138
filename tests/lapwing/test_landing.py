"""Landings through `lapwing run`: how high the vehicle is when its motors stop, and how fast it touches down."""

import numpy as np
import pytest

import lapwing as package

RUN = ("run", "hover", "--mode", "single-process", "--log", "a.mcap")
FAST = 'trajectory.phase.2.z={kind="ramp", to=0.0, rate=1.0}'


def landing(lapwing, *overrides):
    """Return the truth of a landing of `hover`, and the rows of its touch-down and of the stop of its motors."""
    sets = [part for text in overrides for part in ("--set", text)]
    code, _, errors = lapwing(*RUN, *sets)
    assert (code, errors) == (0, "")
    flight = package.read_log("a.mcap")
    contact = flight.truth.ground_contact
    touch = int(np.flatnonzero(contact[1:] & ~contact[:-1] & (flight.truth.times[1:] > 6.0))[0])
    return flight, touch, int(np.flatnonzero(flight.armed)[-1]) + 1


@pytest.mark.parametrize(("overrides", "speed"), [((), 0.1), ((FAST,), 0.33)], ids=["minimum jerk", "ramp of 1 m/s"])
def test_motors_stop_on_the_ground_after_a_soft_touch(lapwing, overrides, speed):
    flight, touch, stop = landing(lapwing, *overrides)
    height = flight.truth.position[:, 2]
    assert flight.landed
    assert height[stop] - height[-1] == pytest.approx(0.0, abs=0.010)
    assert -flight.truth.velocity[touch, 2] < speed
    assert np.ptp(height[touch:]) < 0.010  # no bounce
    assert flight.truth.ground_contact[touch + 125 :].all()
    assert flight.actuators.thrust[stop - 1].sum() < 0.01 * flight.actuators.thrust[1000].sum()  # nothing left to cut


@pytest.mark.long
@pytest.mark.parametrize("height", [1.0, 0.6], ids=["ends at the roof", "ends below the roof"])
def test_trajectory_that_ends_on_a_roof_lands_there(lapwing, height):
    box = "environment.terrain.box=[{position=[3.0,0.0],size=[2.0,4.0],top=1.0}]"
    way = [("0.z", 2.5), ("1.x", 3.0), ("2.z", height)]
    sets = [f'trajectory.phase.{key}={{kind="minimum_jerk", to={to}, duration=3.0}}' for key, to in way]
    flight, touch, stop = landing(lapwing, box, *sets)
    assert flight.landed
    assert "touched down on building 1" in str(flight.outcome)
    assert flight.truth.position[-1] == pytest.approx([3.0, 0.0, 1.35], abs=0.02)
    assert flight.truth.times[stop] - flight.truth.times[touch] < 2.0


def test_cut_height_drops_the_vehicle(lapwing):
    flight, touch, stop = landing(lapwing, "autopilot.landing.cut_height=0.05")
    height = flight.truth.position[:, 2]
    assert height[stop] - height[-1] == pytest.approx(0.05, abs=0.003)
    fall = np.sqrt(2.0 * 9.80665 * 0.05 + flight.truth.velocity[stop, 2] ** 2)
    assert -flight.truth.velocity[touch, 2] == pytest.approx(fall, rel=0.15)  # the rotors still push
