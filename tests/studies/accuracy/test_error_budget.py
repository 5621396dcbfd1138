"""Error budget on flights with known differences."""

from pathlib import Path

import numpy as np
import pytest
import synthetic_flights

from lapwing.services.scene_resolver import load
from lapwing.studies.accuracy.error_budget import SOURCES, _error_source, difference, errors
from lapwing.studies.simulate import fly

ROOT = Path(__file__).parents[3]


def yaw_quaternion(angle):
    return [0.0, 0.0, np.sin(angle / 2), np.cos(angle / 2)]


def flight(rate, position, orientation):
    truth = {"pose.position": position, "pose.orientation": orientation}
    return synthetic_flights.flight(len(position), rate, ground_truth=truth)


def test_difference_at_common_ticks():
    fine = flight(10, np.array([[0.1 * k, 0, 0] for k in range(7)]), yaw_quaternion(0.0))
    coarse = flight(5, fine.truth.position[::2] + np.array([0, 0.3, 0]), yaw_quaternion(1e-9))
    for one, other in ((fine, coarse), (coarse, fine)):
        position, angle, largest = difference(one, other)
        assert (position, largest) == pytest.approx((0.3, 0.3))
        assert angle == pytest.approx(1e-9)
    opposite = flight(10, fine.truth.position, -fine.truth.orientation)
    assert difference(fine, opposite) == (0.0, 0.0, 0.0)


def test_error_of_a_fleet_is_that_of_its_worst_vehicle():
    exact = [flight(5, np.zeros((5, 3)), yaw_quaternion(0.0)) for _ in range(2)]
    moved = [flight(5, np.full((5, 3), x), yaw_quaternion(a)) for x, a in ((0.0, 1e-9), (0.1, 0.0))]
    row = _error_source("neighbours", 0.2, "", moved, exact)
    assert (row.position, row.attitude) == pytest.approx((0.1 * 3.0**0.5, 1e-9))


def test_flight_in_memory_moves_plant():
    flights = fly(load(ROOT / "lapwing/scenes/os4_experiment_2.toml", ["run.duration=0.4", "solver.integrator=rkmk4"]))
    assert len(flights.truth) == 101
    assert flights.config.interval == 0.004
    t = 0.4
    assert flights.truth.position[-1, 1] > 0.0  # experiment 2 moves to +y
    assert abs(flights.truth.position[-1, 2]) < 1e-3 * 9.81 * t * t


@pytest.mark.long
@pytest.mark.long
def test_errors_decrease_with_step_rate_and_delay():
    scene = load(ROOT / "lapwing/scenes/cooperative_load.toml", ["run.duration=1.0", "solver.integrator=rkmk2"])
    parts = errors(scene)
    by = {source: [p for p in parts if p.source == source] for source in SOURCES}
    steps = [p.position for p in by["plant step"]]
    assert steps[0] / steps[1] == pytest.approx(4.0, rel=0.2)  # second order
    exchange = [p.position for p in by["communication step"]]
    assert exchange[0] > exchange[1] > exchange[2] > 0.0
    delay = [p.position for p in by["coupling delay"]]
    assert delay[0] / delay[1] == pytest.approx(2.0, rel=0.3)  # delay of one communication step, first order


@pytest.mark.long
def test_accuracy_holds_from_take_off_to_rest():
    """Steps of 4 ms and contact at the accuracy, against an eighth of the step and 1/1000 of the accuracy."""
    coarse, fine = (
        fly(load("hover", [f"solver.step={step!r}", f"solver.accuracy={accuracy!r}"]))
        for step, accuracy in ((0.004, 1e-5), (0.0005, 1e-8))
    )
    contact = fine.truth.ground_contact
    assert contact[0]
    assert contact[-1]
    assert not contact.all()
    assert difference(coarse, fine)[2] < 1e-5
