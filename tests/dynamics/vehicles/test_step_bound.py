"""Steps that drag, motors or rotation would make inaccurate are split; the cause is named."""

from pathlib import Path

import numpy as np
import pytest

from lapwing.dynamics import effects
from lapwing.dynamics.integrators import rk4_renormalised
from lapwing.dynamics.noise import stream_key
from lapwing.dynamics.vehicles import multirotor
from lapwing.dynamics.vehicles.airframe import load_airframe
from lapwing.dynamics.vehicles.step_bound import MOST_PARTS, causes, parts

AIRFRAME = load_airframe(Path(__file__).parents[3] / "lapwing/scenes/vehicles/delivery_drone.toml")
DRAG = 1e5  # [N s/m]


def vehicle(linear):
    p = multirotor.parameters(AIRFRAME, tuple(effects.from_scene({"body_drag": {"area": [0, 0, 0]}}, AIRFRAME)))
    (drag,) = p.effects
    return p._replace(effects=(drag._replace(linear=(linear,) * 3),))


def fly(p, state, seconds, h):
    off = (0.0,) * 4
    for tick in range(round(seconds / h)):
        state = multirotor.advance(rk4_renormalised.Method(), p, stream_key(1, "a", "plant"), tick, state, off, h, 1)
    return state.motion


def test_steps_with_fast_drag_or_rotation_are_split(uncompiled):
    """Drag of 1e5 N s/m decays within 0.1 ms, and 3e3 rad/s are 3 rad in a step of 1 ms."""
    start = multirotor.initial_state(vehicle(DRAG), (0.0, 0.0, 50.0), velocity_world=(3.0, 0.0, 0.0))
    motion = fly(vehicle(DRAG), start, 0.002, 1e-3)
    assert motion.velocity_world == pytest.approx((0.0, 0.0, 0.0), abs=1e-6)
    assert motion.position_world[0] == pytest.approx(3.0 * AIRFRAME.mass.total / DRAG, rel=1e-3)
    inertia = np.array(vehicle(0.0).body.inertia)
    spinning = multirotor.initial_state(vehicle(0.0), (0.0, 0.0, 50.0), omega_body=(3e3, 20.0, -30.0))
    before, after = np.array([spinning.motion.omega_body, fly(vehicle(0.0), spinning, 0.002, 1e-3).omega_body])
    assert np.linalg.norm(inertia * after) == pytest.approx(np.linalg.norm(inertia * before), rel=1e-4)
    assert (inertia * after**2).sum() == pytest.approx((inertia * before**2).sum(), rel=1e-4)


def test_fastest_cause_is_named_first():
    p = vehicle(DRAG)
    first, second = causes(p, (() for _ in p.effects))
    assert first.name == "body_drag"
    assert first.rate == pytest.approx(DRAG / AIRFRAME.mass.total)
    assert second == ("motors", p.layout.lag_rate)


@pytest.mark.parametrize(("rate", "expected"), [(1.0, 1), (1e3, 4), (2e6, 8_000), (1e9, 1), (np.nan, 1), (np.inf, 1)])
def test_lost_vehicle_takes_single_steps(uncompiled, rate, expected):
    """In a batch, one member that is not valid would cost the time of ten thousand."""
    p = vehicle(0.0)
    state = multirotor.initial_state(p, (0.0, 0.0, 50.0))
    motion = state.motion._replace(omega_body=(rate, 0.0, 0.0))
    assert parts(p, motion, state.memory, 1e-3) == expected <= MOST_PARTS
