"""Faults and gusts between two ticks against SciPy's DOP853, split at their edges."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from lapwing.dynamics import effects
from lapwing.dynamics.integrators import get
from lapwing.dynamics.lie.quaternion import NO_ROTATION
from lapwing.dynamics.vehicles import multirotor
from lapwing.dynamics.vehicles.airframe import load_airframe
from lapwing.dynamics.vehicles.multirotor_equations import STANDARD_DENSITY, StepInputs
from lapwing.studies.accuracy.coordinates import error, of_state
from lapwing.studies.accuracy.reference import dop853
from lapwing.studies.accuracy.systems.multirotor import START, VOLTAGE, right_hand_side
from tests.combinations import rest_nightly

pytestmark = pytest.mark.long

DRONE = load_airframe(Path(__file__).parents[3] / "lapwing/scenes/vehicles/delivery_drone.toml")
TICK, N, END = 0.004, 4, 0.1  # [s], steps of a tick, [s]
DAMAGE, RELEASE = 0.0413, 0.0779  # [s] between two ticks and two steps
BROKEN = {
    "gravity": {},
    "rotor_thrust": {},
    "payload_release": {"release_time": RELEASE},
    "rotor_damage": {"rotor": 2, "time": DAMAGE, "remaining_thrust": 0.3, "remaining_torque": 0.6},
}


def fly(tables, start, voltage=VOLTAGE, integrator="rk4_renormalised"):
    p = multirotor.parameters(DRONE, effects.from_scene(tables, DRONE))
    state = multirotor.initial_state(p)._replace(motion=start)
    for tick in range(round(END / TICK)):
        state = multirotor.advance(get(integrator).Method(), p, (0, 0), tick, state, voltage, TICK / N, N)
    return p, state.motion


def broken_by_reference(p):
    """Return the coordinates after damage and release, each part integrated separately."""
    by_name = dict(zip(sorted(BROKEN), p.effects, strict=True))
    gravity, rotor, box = by_name["gravity"], by_name["rotor_thrust"], by_name["payload_release"]
    damage = by_name["rotor_damage"]
    torn = rotor._replace(
        thrust_constant=rotor.thrust_constant * np.array(damage.remaining_thrust),
        torque_constant=rotor.torque_constant * np.array(damage.remaining_torque),
    )
    y = of_state(START)
    for seconds, body, blades in (
        (DAMAGE, box.loaded, rotor),
        (RELEASE - DAMAGE, box.loaded, torn),
        (END - RELEASE, box.empty, torn),
    ):
        part = StepInputs(p._replace(effects=(gravity, blades), body=body), body, (), VOLTAGE)
        y = dop853(lambda t, x, part=part: right_hand_side(part, x), y, seconds)
    return y


@pytest.mark.parametrize(
    ("integrator", "bound"), rest_nightly(("rk4_renormalised", 1e-10), ("rk8_renormalised", 1e-12))
)
def test_faults_between_ticks_are_exact(integrator, bound):
    p, motion = fly(BROKEN, START, integrator=integrator)
    assert error(of_state(motion), broken_by_reference(p)) < bound


def test_fault_on_tick_takes_effect_there():
    """25 ticks of 4 ms are 0.1 s only up to rounding, and so is 3 * 0.1."""
    on_tick = {**BROKEN, "rotor_damage": {**BROKEN["rotor_damage"], "time": 12 * TICK}}
    just_before = {**BROKEN, "rotor_damage": {**BROKEN["rotor_damage"], "time": 12 * TICK * (1.0 + 1e-13)}}
    assert of_state(fly(on_tick, START)[1]) == pytest.approx(of_state(fly(just_before, START)[1]), abs=1e-12)


@pytest.mark.parametrize(
    ("start", "duration"), [(0.0123, 0.0007), (0.0507, 0.0301), (0.0, 0.02)], ids=["short", "long", "on ticks"]
)
def test_gust_between_ticks_is_exact(start, duration):
    """The reference for an upright fall without rotors is SciPy with two states, split at the gust's edges."""
    peak = np.array([40.0, 0.0, -15.0])
    tables = {"body_drag": {"linear": [1.5, 0.5, 0.8]}, "gravity": {}, "rotor_thrust": {}}
    tables["wind_gust"] = {"peak": peak.tolist(), "start": start, "duration": duration}
    still = START._replace(
        attitude=NO_ROTATION, velocity_world=(1.0, 8.0, -0.3), omega_body=(0.0,) * 3, rotor_speed=(0.0,) * 4
    )
    _, motion = fly(tables, still, (0.0,) * 4)
    half_area = 0.5 * np.array(DRONE.drag.area)

    def rate(t, y, blows):
        part = 0.5 * (1.0 - np.cos(2.0 * np.pi * (t - start) / duration)) if blows else 0.0
        past = y[3:] - part * peak
        drag = -(np.array([1.5, 0.5, 0.8]) + STANDARD_DENSITY * np.linalg.norm(past) * half_area) * past
        return np.concatenate([y[3:], drag / DRONE.mass.total - [0.0, 0.0, 9.80665]])

    y = np.concatenate([still.position_world, still.velocity_world])
    for blows, (a, b) in zip((False, True, False), pairwise((0.0, start, start + duration, END)), strict=True):
        if b > a:
            y = solve_ivp(rate, (a, b), y, "DOP853", args=(blows,), rtol=1e-13, atol=1e-14).y[:, -1]
    assert np.concatenate([motion.position_world, motion.velocity_world]) == pytest.approx(y, abs=1e-8)
