"""Shared load whose cable tightens within a step, or that lands within a step, against the closed form."""

import pytest

from lapwing.cosim.diagram.compiled_block import InputSample
from lapwing.dynamics.effects._vehicle_interaction import NeighbourState
from lapwing.dynamics.integrators import LEAST_TOLERANCE, get
from lapwing.dynamics.terrain import LEVEL
from lapwing.dynamics.vector import ZERO
from lapwing.dynamics.vehicles.multirotor_slung import GROUND_DAMPING, GROUND_FREQUENCY, Sling
from lapwing.kernels import kernel
from lapwing.services.plant.blocks import carried_load
from lapwing.services.plant.blocks.carried_load import LoadMotion, LoadPlant
from tests.dynamics.vehicles.rebound import rebound

RK4 = get("rk4_renormalised").Method()
LENGTH, SLACK, SPEED, RATIO = 2.0, 0.02, 1.5, 0.1
FREQUENCY = 8.0  # [rad/s], so slow that RK4 has no error while the cable is taut
SLING = Sling(3.0, LENGTH, 3.0 * FREQUENCY**2, 2.0 * RATIO * FREQUENCY * 3.0, ZERO, 0.0, LEVEL)
SECONDS, INTERVAL = 0.5, 4e-3


@kernel
def move_load_for(p, x, carrier, ticks):
    for tick in range(1, ticks + 1):
        x = carried_load.step(p, x, tick, (InputSample(True, carrier),))[0]
    return x


def closed_form(hook, start, velocity, steps):
    """Return height and vertical speed of a weightless load under a fixed hook."""
    p = LoadPlant((SLING,), ZERO, RK4, INTERVAL / steps, steps, INTERVAL, LEAST_TOLERANCE)
    carrier = NeighbourState(hook_world=(0.0, 0.0, hook))
    x = move_load_for(p, LoadMotion((0.0, 0.0, start), (0.0, 0.0, velocity)), carrier, round(SECONDS / INTERVAL))
    return x.load_position[2], x.load_velocity[2]


@pytest.mark.parametrize("steps", [1, 4])
def test_load_rebounds_from_taut_cable_as_damped_spring(steps):
    height, velocity = closed_form(LENGTH + 1.0, 1.0 + SLACK, -SPEED, steps)
    beyond, rate = rebound(SLACK, SPEED, FREQUENCY, RATIO, SECONDS)
    assert 1.0 - height == pytest.approx(beyond, abs=1e-7)
    assert -velocity == pytest.approx(rate, abs=1e-7)


@pytest.mark.parametrize("steps", [1, 4])
def test_load_rebounds_from_ground_as_damped_spring(steps):
    """The cable stays slack."""
    height, velocity = closed_form(0.5 * LENGTH, SLACK, -SPEED, steps)
    beyond, rate = rebound(SLACK, SPEED, GROUND_FREQUENCY, GROUND_DAMPING, SECONDS)
    assert -height == pytest.approx(beyond, abs=1e-7)
    assert -velocity == pytest.approx(rate, abs=1e-7)
