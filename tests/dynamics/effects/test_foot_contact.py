"""Feet computed in vector lanes are bit-for-bit identical to single feet, for any number of feet."""

import math
from typing import Any, NamedTuple

import numpy as np
import pytest

from lapwing.dynamics import effects
from lapwing.dynamics.effects import ground_contact
from lapwing.dynamics.effects._types import Motion
from lapwing.dynamics.lie import quaternion
from lapwing.dynamics.lie.quaternion import Quaternion
from lapwing.dynamics.terrain import LEVEL, relief, touch
from lapwing.dynamics.vector import ZERO, add, apply, apply_transposed, cross, dot, norm, scale, subtract
from lapwing.kernels import kernel, python_function

add, apply, apply_transposed, cross, dot, norm, scale, subtract, rotation_matrix = map(
    python_function, (add, apply, apply_transposed, cross, dot, norm, scale, subtract, quaternion.rotation_matrix)
)
GROUNDS = {
    "level": LEVEL,
    "relief": relief((2e-4, -1e-4), bump_height=2e-5, bump_length=0.7),
    "corner": relief((2e-4, -1e-4), steps=[(0.2, 0.1)]),
}


class Seen(NamedTuple):
    motion: Any
    R_world_body: Any


@kernel
def anchored(e, memory, s):
    return (
        ground_contact.ground_contact(e, memory, s, 0.0),
        ground_contact.forces(e, memory, s.motion),
        ground_contact.touches(e, memory, s),
        ground_contact.loads_and_stretching(e, memory, s.motion),
    )


@kernel
def smooth(e, memory, s):
    return (
        ground_contact.ground_contact(e, memory, s, 0.0),
        ground_contact.forces(e, memory, s.motion),
        ground_contact.touches(e, memory, s),
    )


class Foot:
    """One foot by eqs. (2.12) to (2.17) of the theory."""

    def __init__(self, e, s, body):
        m = s.motion
        self.e, self.arm = e, apply(s.R_world_body, body)
        self.place = add(m.position_world, self.arm)
        self.depth, self.normal, wedge = touch(e.terrain, self.place)
        velocity = add(m.velocity_world, cross(apply(s.R_world_body, m.omega_body), self.arm))
        self.approach = -dot(velocity, self.normal)
        self.slip = add(velocity, scale(self.approach, self.normal))
        onset = min(self.depth * e.inverse_width, 1.0)
        push = e.stiffness * self.depth + e.damping * self.approach
        self.press = max(onset * onset * (3.0 - 2.0 * onset) * push, 0.0) if self.depth > 0.0 else 0.0
        self.load, self.wedge = wedge * self.press, wedge

    def element(self, deflection):
        """Return (friction force, rate of the deflection, "sticks" or "slides" or "flies")."""
        e, n = self.e, self.normal
        pull = scale(e.tangential_stiffness, deflection)
        if self.press <= 0.0:
            return ZERO, scale(-e.tangential_stiffness / e.tangential_damping, deflection), "flies"
        along = subtract(pull, scale(dot(pull, n), n))
        stretched = add(along, scale(e.tangential_damping, self.slip))
        y = min(math.sqrt(dot(self.slip, self.slip)) * e.inverse_stiction, 1.0)
        limit = (e.static + (e.dynamic - e.static) * y * y * (3.0 - 2.0 * y)) * self.load
        square = dot(stretched, stretched)
        slides = square > limit * limit
        held = scale(limit / math.sqrt(square), stretched) if slides else stretched
        rate = scale(1.0 / e.tangential_damping, subtract(held, pull))
        return scale(-1.0, held), rate, "slides" if slides else "sticks"

    def friction(self, memory):
        if memory:
            return self.element(memory)[0]
        e, speed = self.e, norm(self.slip)
        x = speed * e.inverse_critical
        if x < 1.0:
            return scale(-self.load * e.static * e.inverse_critical * (1.5 - 0.5 * x * x), self.slip)
        y = min(2.0 * (x - 1.0), 1.0)
        coefficient = e.static + (e.dynamic - e.static) * y * y * (3.0 - 2.0 * y)
        return scale(-coefficient * self.load / speed, self.slip)

    def force(self, memory):
        return add(scale(self.press, self.normal), self.friction(memory)) if self.press > 0.0 else ZERO


def drawn(rng, e):
    """Return a random vehicle whose feet are within about a tenth of a millimetre of the ground."""
    turn = rng.normal(scale=3e-4, size=3)
    attitude = Quaternion(*map(float, np.append(1.0, 0.5 * turn) / math.hypot(1.0, *0.5 * turn)))
    place = (*map(float, rng.uniform(-0.002, 0.002, 2)), 0.35 + float(rng.uniform(-2e-4, 5e-5)))
    velocity, omega = (tuple(map(float, rng.normal(scale=10.0 ** rng.uniform(-4, 0), size=3))) for _ in range(2))
    s = Seen(Motion(place, attitude, velocity, omega, (0.0,) * 4), rotation_matrix(attitude))
    memory = []
    for _ in e.feet:
        off = rng.normal(scale=10.0 ** rng.uniform(-6, -3), size=3)
        memory.append(tuple(map(float, off)) if hasattr(e, "tangential_stiffness") else ())
    return s, tuple(memory)


@pytest.mark.long
@pytest.mark.parametrize("ground", GROUNDS)
@pytest.mark.parametrize("law", ["stick_slip", "regularised"])
def test_feet_are_independent(drone, law, ground):
    (e,) = effects.from_scene({"ground_contact": {"friction": law}}, drone)
    e = e._replace(feet=(*e.feet[:4], (0.01, 0.0, -0.3501)), terrain=GROUNDS[ground])
    rng, kinds, cornered = np.random.default_rng(1), set(), 0
    for _ in range(300):
        s, memory = drawn(rng, e)
        (force, torque), points, touches, *settled = (anchored if law == "stick_slip" else smooth)(e, memory, s)
        feet = [Foot(e, s, foot) for foot in e.feet]
        cornered += any(foot.press > 0.0 and foot.wedge > 1.0 for foot in feet)
        alone = [foot.force(anchor) for foot, anchor in zip(feet, memory, strict=True)]
        total, moment = ZERO, ZERO
        for foot, push in zip(feet, alone, strict=True):
            total, moment = add(total, push), add(moment, cross(foot.arm, push))
        assert force == total
        assert torque == apply_transposed(s.R_world_body, moment)
        assert points == tuple((foot.place, push) for foot, push in zip(feet, alone, strict=True))
        assert touches == any(foot.press > 0.0 for foot in feet)
        if law == "stick_slip":
            each = [foot.element(deflection) for foot, deflection in zip(feet, memory, strict=True)]
            assert settled == [(force, torque, tuple(rate for _, rate, _ in each))]
            kinds |= {kind for *_, kind in each}
    assert (cornered > 20) == (ground == "corner")
    assert law == "regularised" or kinds == {"flies", "sticks", "slides"}
