"""Landings against the event-located reference: errors of the state are below the accuracy at all times."""

import numpy as np
import pytest

import lapwing
from lapwing.studies.accuracy.coordinates import error, of_state
from lapwing.studies.accuracy.landings import cases, measure
from lapwing.studies.accuracy.systems.landing import TOUCH_DOWNS, problems
from tests.combinations import rest_nightly

pytestmark = pytest.mark.long


def test_sliding_touch_down_meets_accuracy():
    case = TOUCH_DOWNS["landing_level"]
    exact, events = cases.exact(case)
    assert events > 5
    for accuracy in cases.ACCURACIES:
        assert cases.errors(cases.fly(case, accuracy)[0], exact).max() < accuracy


@pytest.mark.parametrize("seed", rest_nightly(6, 75, 0, 11, keep=2))
def test_random_landing_meets_accuracy(seed):
    """`python -m benchmarks.landings` has 200 landings; 11 and 75 are on bumps, and 75 amplifies round-off most."""
    case = cases.draw(seed)
    exact, events = cases.exact(case)
    assert events > 20
    for accuracy in (1e-3, 1e-6, 1e-9):
        assert cases.errors(cases.fly(case, accuracy)[0], exact).max() < accuracy


def test_strike_of_propeller_comes_before_feet():
    case = cases.DRAWS["strikes"](0)
    p, state = cases.plant(case)
    points = np.array(cases.contact_of(p).feet) @ of_state(state.motion.attitude).reshape(3, 3).T
    over = points[:, 2] - points[:, :2] @ case.slope
    assert over.argmin() >= 4
    reach = np.linalg.norm(np.array(cases.contact_of(p).feet)[4:], axis=1)
    assert reach == pytest.approx(0.35171491 * np.sqrt(2.0) + 0.2794)


@pytest.mark.parametrize(
    ("kind", "seed"),
    [
        ("steps", 0),
        ("steps", 2),
        ("steps", 3),
        ("steps", 16),
        ("folds", 1),
        ("folds", 2),
        ("toppling", 0),
        ("toppling", 6),
        ("toppling", 7),
        ("strikes", 0),
    ],
)
def test_landing_at_step_fold_toppling_or_strike_meets_accuracy(kind, seed):
    """Cases: into a wall, over an edge, on a ridge and in a valley, over one foot onto the hull, on a propeller.

    At steps 2 and 16 a foot is in wall and ground at once.
    """
    case = cases.DRAWS[kind](seed)
    exact, events = cases.exact(case)
    assert events > 50
    for accuracy in (1e-3, 1e-6, 1e-9):
        assert cases.errors(cases.fly(case, accuracy)[0], exact).max() < accuracy


def test_last_bit_of_start_is_not_multiplied_by_round_off():
    """Plain sums make 1.0e-9 and 1.6e-9 of it: round-off of every substep grows with the bounces."""
    assert cases.round_off(cases.draw(75)) < 2e-10
    assert cases.round_off(cases.draw_toppling(7)) < 2e-10


def test_reference_is_independent_of_its_tolerance():
    case = cases.draw(2)
    coarse, fine = (cases.exact(case, tolerance)[0] for tolerance in (1e-11, 1e-13))
    assert cases.errors(coarse, fine).max() < 1e-8


def test_accuracy_problem_improves_with_its_setting():
    problem = problems()["landing_level"]
    method = problem.methods[0]
    ends = [method.read(a, method.prepare(a)()).samples[-1] for a in (1e-3, 1e-8)]
    coarse, fine = (error(end, problem.reference()) for end in ends)
    assert fine < 1e-8 < 1e-3
    assert fine < coarse < 1e-3


def test_batch_of_sliding_landings_meets_accuracy():
    """A touchdown with errors of millimetres in former versions at any accuracy."""
    ends = []
    for accuracy in (1e-4, 1e-6, 1e-10):
        solver = {"solver.accuracy": accuracy, "solver.integrator": "rk4_renormalised", "solver.step": 0.001}
        batch = lapwing.BatchSimulator("hover", 1, overrides=solver)
        batch.reset(position_world=(0, 0, 0.355), velocity_world=(0.4, 0, -0.1), rotor_speed=np.zeros(4))
        state = batch.step(motor_voltages=np.zeros((1, 4)), ticks=60)
        ends.append(np.concatenate([state.position_world[0], state.velocity_world[0]]))
    assert np.abs(ends[0] - ends[2]).max() < 1e-4
    assert np.abs(ends[1] - ends[2]).max() < 1e-6


def test_step_in_air_meets_share_of_accuracy():
    """After bounces at 1 ms the decay of the rotors alone had an error of 6e-9 at any accuracy."""
    p, _ = cases.plant(cases.FASTEST)
    for accuracy in (1e-4, 1e-9):
        z = p.layout.lag_rate * cases.INTERVAL / cases.airborne_steps(accuracy, "rk4_renormalised")
        step = 1.0 - z + z**2 / 2.0 - z**3 / 6.0 + z**4 / 24.0  # RK4 step of the decay
        times = cases.times()
        exact = 300.0 * np.exp(-p.layout.lag_rate * times)
        numeric = 300.0 * step ** (p.layout.lag_rate * times / z)
        assert (np.abs(numeric - exact) / (1.0 + exact)).max() < 1.5 * 3e-3 * accuracy


def test_landings_are_added_to_file(tmp_path):
    path = tmp_path / "landings.json"
    assert measure.read(path) == {}
    landings = [measure.LandingErrors(k, 7, (1e-4,) * 7, (0.1,) * 7, (0.2,) * 7, 1e-10) for k in (12, 3)]
    measure.write(path, landings)
    assert measure.read(path) == {landing.seed: landing for landing in landings}
    assert [landing.seed for landing in measure.read(path).values()] == [3, 12]
    assert list(measure.measure([])) == []
