"""Landings on folds of a grid of heights: bounded work, and errors below the accuracy."""

import math
from functools import cache
from typing import NamedTuple

import numpy as np
import pytest

from lapwing.dynamics import integrators
from lapwing.dynamics.effects._hooks import wrench
from lapwing.dynamics.vector import NOTHING
from lapwing.dynamics.vehicles import multirotor
from lapwing.dynamics.vehicles.multirotor_equations import with_tolerance
from lapwing.kernels.state_tree import flatten
from lapwing.services.plant.schema import contact_tolerance
from lapwing.studies.accuracy.coordinates import coordinates
from lapwing.studies.accuracy.landings import cases

pytestmark = pytest.mark.long

SECONDS, TICK = 0.6, 4e-3
FLANKS = {"valley": 0.3, "ridge": -0.3}  # slope on both sides of the fold
WORK = {1e-3: 5e4, 1e-6: 2e5, 1e-8: 5e5}  # force evaluations by accuracy: 1.5 times those of the valley
MANY = 1e6  # force evaluations at which a flight is given up


class Evaluations(NamedTuple):
    """Counter of force evaluations; more than the limit end a step with a state that is not finite."""

    count: np.ndarray  # (1,)
    limit: float


@wrench(Evaluations)
def count_evaluation(e, memory, s, rotors):
    """Return no load, infinite forces beyond the limit."""
    e.count[0] += 1.0
    force = math.inf if e.count[0] > e.limit else 0.0
    return (force, 0.0, 0.0), NOTHING


@cache
def landing(flank, accuracy):
    """Return (states every 4 ms, number of force evaluations) of a landing with the front feet on the fold."""
    tilt = math.atan(flank)
    front = 0.2 * math.cos(tilt) - 0.35 * math.sin(tilt)  # [m] x of the front feet
    case = cases.Landing(
        (0.0, 0.0), 0.0, 0.25, (0.05, 0.1), (0.0, tilt, 0.0), 0.0, (0.0, 0.0, 0.0), 0.0, -front, fold=(flank, 1.0)
    )
    p, state = cases.plant(case)
    counter = Evaluations(np.zeros(1), MANY)
    p = with_tolerance(p._replace(effects=(*p.effects, counter)), contact_tolerance(accuracy))
    state = state._replace(memory=(*state.memory, ()))
    method, motions = integrators.get("rk4_renormalised").Method(), [state.motion]
    for tick in range(round(SECONDS / TICK)):
        state = multirotor.advance(method, p, (0, 0), tick, state, (0.0,) * 4, 1e-3, 4)
        motions.append(state.motion)
    return coordinates(motions[0], np.array([flatten(motion) for motion in motions])), counter.count[0]


@pytest.mark.parametrize("flank", FLANKS.values(), ids=FLANKS)
@pytest.mark.parametrize("accuracy", WORK)
def test_landing_on_fold_takes_bounded_work(flank, accuracy):
    states, evaluations = landing(flank, accuracy)
    assert np.isfinite(states).all()
    assert evaluations < WORK[accuracy]


@pytest.mark.parametrize("flank", FLANKS.values(), ids=FLANKS)
@pytest.mark.parametrize("accuracy", WORK)
def test_landing_on_fold_agrees_with_tighter_one(flank, accuracy):
    states, tighter = landing(flank, accuracy)[0], landing(flank, 0.1 * accuracy)[0]
    assert cases.errors(states, tighter).max() < accuracy
