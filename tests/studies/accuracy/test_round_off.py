"""Round-off error of the study against arithmetic with 50 digits."""

from typing import NamedTuple

import mpmath
import numpy as np
import pytest

from lapwing.dynamics import integrators
from lapwing.dynamics.effects.ground_contact import _feet_wrench
from lapwing.dynamics.integrators import RATES, rk4
from lapwing.dynamics.lie.quaternion import rotation_matrix
from lapwing.dynamics.vehicles import multirotor
from lapwing.dynamics.vehicles.multirotor_equations import STANDARD_DENSITY, motion_of
from lapwing.kernels import always_inline, math
from lapwing.studies.accuracy import plant, round_off
from lapwing.studies.accuracy.extended_numbers import Number
from lapwing.studies.accuracy.integrate import fixed_step_methods
from lapwing.studies.accuracy.problem import Problem
from lapwing.studies.accuracy.round_off import end_in_extended_precision, extend, in_extended_precision
from lapwing.studies.accuracy.systems import problems
from lapwing.studies.accuracy.targets import scene_of

STEPS, DURATION = 1000, 10.0


class LinearOscillator(NamedTuple):
    stiffness: float
    damping: float


@always_inline
def oscillator_rate(p, t, x):
    return (x[1], -p.stiffness * x[0] - p.damping * x[1])


RATES[LinearOscillator] = oscillator_rate
P, START = LinearOscillator(7.3, 0.11), (0.7, -0.3)


def end_in_digits(steps: int, h: float) -> list[mpmath.mpf]:
    """Return the final state of RK4 with a round-off error below 1e-45."""
    with mpmath.workdps(50):
        A = mpmath.matrix([[0, 1], [-mpmath.mpf(P.stiffness), -mpmath.mpf(P.damping)]]) * mpmath.mpf(h)
        one_step = mpmath.eye(2) + A + A**2 / 2 + A**3 / 6 + A**4 / 24  # RK4 of a linear system
        return list(one_step**steps * mpmath.matrix(START))


def test_end_of_linear_system_has_digits_of_extended_precision() -> None:
    h = DURATION / STEPS
    exact = end_in_digits(STEPS, h)
    end = end_in_extended_precision(rk4, P, START, h, STEPS)
    for value, digits in zip(end, exact, strict=True):
        with mpmath.workdps(50):
            assert abs(mpmath.mpf(value) - digits) < 1e-28


def test_round_off_of_linear_system_equals_error_in_digits() -> None:
    methods = fixed_step_methods(P, START, DURATION, 8)
    result = round_off.measure(Problem("oscillator", DURATION, methods, lambda: np.zeros(2), ""))
    (method,) = (method for method in methods if method.name == round_off.METHOD)
    h = DURATION / result.steps
    double = method.read(h, method.prepare(h)()).samples[-1]
    with mpmath.workdps(50):
        digits = end_in_digits(result.steps, h)
        expected = max(abs(mpmath.mpf(float(a)) - b) / (1 + abs(b)) for a, b in zip(double, digits, strict=True))
    assert result.steps >= round_off.STEPS
    assert 1e-17 < expected < 1e-13
    assert result.error == pytest.approx(float(expected), rel=0.05)


@always_inline
def elementary(x):
    sine, cosine = math.sincos(x)
    return sine * math.exp(x) + math.sqrt(cosine) + math.hypot(x, 2.0) + math.atan2(x, 3.0)


def test_elementary_functions_have_extended_precision() -> None:
    value = extend(elementary)(Number(0.3))
    with mpmath.workdps(50):
        x = mpmath.mpf(0.3)
        exact = mpmath.sin(x) * mpmath.exp(x) + mpmath.sqrt(mpmath.cos(x)) + mpmath.hypot(x, 2) + mpmath.atan2(x, 3)
        assert abs(mpmath.mpf(value) - exact) < 1e-30


@always_inline
def count(x):
    n = 0
    for _ in range(math.floor(x), math.ceil(x) + 1):
        n += 1
    return n


def test_rounded_numbers_count_as_in_kernels() -> None:
    assert extend(count)(Number(1.25)) == 2


@pytest.mark.long
@pytest.mark.parametrize("name", ["free_rigid_body", "multirotor", "os4_experiment_4"])
def test_round_off_of_flight_is_above_that_of_one_step_and_small(name: str) -> None:
    result = round_off.measure(problems()[name])
    assert result is not None
    assert 2.0**-54 < result.error < 1e-11


def climb_in_digits(p, volts: float, height: float, speed: float, h: float, steps: int) -> list[mpmath.mpf]:
    """Return (height, climb rate, rotor speed) after the steps of RK4 of a level multirotor, in 50 digits."""
    gravity, rotor = (next(e for e in p.effects if type(e).__name__ == name) for name in ("Gravity", "RotorThrust"))
    with mpmath.workdps(50):
        h, lag, target = mpmath.mpf(h), mpmath.mpf(p.layout.lag_rate), mpmath.mpf(volts) * p.layout.speed_per_volt
        lift = 4 * mpmath.mpf(rotor.thrust_constant) * STANDARD_DENSITY * p.body.inverse_mass  # 1/m is a double
        weight = mpmath.mpf(gravity.acceleration) * p.body.mass * p.body.inverse_mass

        def rates(x):
            return mpmath.matrix([x[1], lift * x[2] ** 2 - weight, lag * (target - x[2])])

        x = mpmath.matrix([height, 0, speed])
        for _ in range(steps):
            a = rates(x)
            b = rates(x + h / 2 * a)
            c = rates(x + h / 2 * b)
            x += h / 6 * (a + 2 * b + 2 * c + rates(x + h * c))
        return list(x)


def test_multirotor_of_scene_has_digits_of_extended_precision() -> None:
    scene = scene_of("lapwing/scenes/hover.toml", [])
    _, p = plant.model(scene).describe(scene)
    volts, speed, h, steps = 12.3, 320.0, 0.004, 20
    state = in_extended_precision(multirotor.initial_state(p, (0.0, 0.0, 20.0), rotor_speed=speed))
    fly, method = extend(multirotor.advance), integrators.get(round_off.METHOD).Method()
    numbers, command = in_extended_precision(p), in_extended_precision((volts,) * 4)
    for tick in range(steps):
        state = fly(method, numbers, (0, 0), tick, state, command, Number(h), 1)
    motion = state.motion
    values = motion.position_world[2], motion.velocity_world[2], motion.rotor_speed[3]
    for value, digits in zip(values, climb_in_digits(p, volts, 20.0, speed, h, steps), strict=True):
        with mpmath.workdps(50):
            assert abs(mpmath.mpf(value) - digits) < 1e-29 * (1 + abs(digits))  # a double has 1.1e-16


def test_feet_in_lanes_have_extended_precision() -> None:
    """Four feet 1 mm in the ground, on two of which the tilted vehicle presses harder, and one in the air."""
    scene = scene_of("lapwing/scenes/hover.toml", [])
    _, p = plant.model(scene).describe(scene)
    contact = next(e for e in p.effects if type(e).__name__ == "GroundContact")
    sole = min(z for _, _, z in contact.feet)
    state = multirotor.initial_state(p, (0.0, 0.0, -sole - 0.001), (0.999, 0.02, -0.03, 0.0), rotor_speed=0.0)
    motion = motion_of(p.layout, state.motion)._replace(velocity_world=(0.1, -0.2, -0.05))
    arguments = contact, state.memory[p.effects.index(contact)], motion, rotation_matrix(motion.attitude)
    double = _feet_wrench(*arguments)
    result = extend(_feet_wrench)(*map(in_extended_precision, arguments))
    assert double[0][2] > 1.0
    for vector, digits in zip(double, result, strict=True):
        assert all(isinstance(number, Number) for number in digits)
        assert [float(number) for number in digits] == pytest.approx(vector, rel=1e-13)


@pytest.mark.long
@pytest.mark.parametrize("name", ["delivery_mission", "slung_load"])
def test_round_off_of_scene_is_above_that_of_one_step_and_small(name: str) -> None:
    result = round_off.measure(plant.problem(scene_of(f"lapwing/scenes/{name}.toml", [])))
    assert result is not None
    assert result.steps >= round_off.STEPS
    assert 2.0**-54 < result.error < 1e-10


def test_function_is_not_taken_for_a_freed_one() -> None:
    """Extended functions were found by the address of the original, which the next generated function can have."""

    def function(n):
        names = {"__name__": "lapwing.generated"}
        exec(f"def evaluate(): return {n}", names)
        return names.pop("evaluate")

    known: dict = {}
    freed = [function(n) for n in range(100)]
    for each in freed:
        round_off._extend(each, known)
    del freed, each
    others = [function(n) for n in range(100, 200)]  # at the same addresses
    assert [round_off._extend(other, known)() for other in others] == list(range(100, 200))
