"""Feet side by side in lanes do what each foot does for itself, to the bit, whatever number of them there is."""

import math
from typing import Any, NamedTuple

import numpy as np
import pytest

from lapwing.dynamics import effects
from lapwing.dynamics.effects import ground_contact
from lapwing.dynamics.effects._contact_parameters import FREE, NOWHERE, SLIDING, STICKING
from lapwing.dynamics.effects._types import Motion
from lapwing.dynamics.lie import quaternion
from lapwing.dynamics.lie.quaternion import Quaternion
from lapwing.dynamics.terrain import LEVEL, relief, touch
from lapwing.dynamics.vector import ZERO, add, apply, apply_transposed, cross, dot, norm, scale, subtract
from lapwing.kernels import kernel, python_function

add, apply, apply_transposed, cross, dot, norm, scale, subtract, rotation_matrix = map(
    python_function, (add, apply, apply_transposed, cross, dot, norm, scale, subtract, quaternion.rotation_matrix)
)
STEP = 1e-3
GROUNDS = {"level": LEVEL, "relief": relief((2e-4, -1e-4), bump_height=2e-5, bump_length=0.7)}


class Seen(NamedTuple):
    motion: Any
    R_world_body: Any


@kernel
def anchored(e, memory, s):
    return (
        ground_contact.ground_contact(e, memory, s, 0.0),
        ground_contact.forces(e, memory, s.motion),
        ground_contact.touches(e, memory, s),
        ground_contact.drag_anchors(e, memory, s.motion, STEP),
    )


@kernel
def smooth(e, memory, s):
    return (
        ground_contact.ground_contact_smooth(e, memory, s, 0.0),
        ground_contact.forces_smooth(e, memory, s.motion),
        ground_contact.touches_smooth(e, memory, s),
    )


class Foot:
    """One foot, by the equations (2.12) to (2.17) of theory.md."""

    def __init__(self, e, s, body):
        m = s.motion
        self.e, self.arm = e, apply(s.R_world_body, body)
        self.place = add(m.position_world, self.arm)
        self.depth, self.normal = touch(e.terrain, self.place)
        velocity = add(m.velocity_world, cross(apply(s.R_world_body, m.omega_body), self.arm))
        self.approach = -dot(velocity, self.normal)
        self.slip = add(velocity, scale(self.approach, self.normal))
        onset = min(self.depth * e.inverse_width, 1.0)
        push = e.stiffness * self.depth + e.damping * self.approach
        self.press = max(onset * onset * (3.0 - 2.0 * onset) * push, 0.0) if self.depth > 0.0 else 0.0

    def spring(self, anchor):
        k, n = 0.0 if anchor[3] == FREE else self.e.tangential_stiffness, self.normal
        pull = scale(k, subtract(anchor, self.place))
        return (pull[0], pull[1], -(n[0] * pull[0] + n[1] * pull[1]) / n[2])

    def trial(self, anchor):
        limit = (self.e.static if anchor[3] == STICKING else self.e.dynamic) * self.press
        return subtract(self.spring(anchor), scale(self.e.damping, self.slip)), limit

    def friction(self, memory):
        if memory:
            trial, limit = self.trial(memory)
            square = dot(trial, trial)
            return scale(limit / math.sqrt(square), trial) if square > limit * limit else trial
        e, speed = self.e, norm(self.slip)
        x = speed * e.inverse_critical
        if x < 1.0:
            return scale(-self.press * e.static * e.inverse_critical * (1.5 - 0.5 * x * x), self.slip)
        y = min(2.0 * (x - 1.0), 1.0)
        coefficient = e.static + (e.dynamic - e.static) * y * y * (3.0 - 2.0 * y)
        return scale(-coefficient * self.press / speed, self.slip)

    def force(self, memory):
        return add(scale(self.press, self.normal), self.friction(memory)) if self.press > 0.0 else ZERO

    def settled(self, anchor):
        if self.press <= 0.0:
            return NOWHERE
        e, square = self.e, dot(self.slip, self.slip)
        if anchor[3] == FREE:
            since = min(STEP, self.depth / self.approach) if self.approach > 0.0 else STEP
            anchor = (*subtract(self.place, scale(since, self.slip)), SLIDING, square)
        trial, limit = self.trial(anchor)
        if dot(trial, trial) <= limit * limit:
            return (anchor[0], anchor[1], 0.0, STICKING, square)
        caught = square < min(e.square_stiction_velocity, anchor[4])
        limit, pull = (e.static if caught else e.dynamic) * self.press, norm(self.spring(anchor))
        kept = limit / pull if pull > limit else 1.0
        dragged = add(self.place, scale(kept, subtract(anchor, self.place)))
        return (dragged[0], dragged[1], 0.0, STICKING if caught else SLIDING, square)


def drawn(rng, e):
    """A vehicle near the ground with its feet at all heights within a tenth of a millimetre or so of it."""
    turn = rng.normal(scale=3e-4, size=3)
    attitude = Quaternion(*map(float, np.append(1.0, 0.5 * turn) / math.hypot(1.0, *0.5 * turn)))
    place = (*map(float, rng.uniform(-0.002, 0.002, 2)), 0.35 + float(rng.uniform(-2e-4, 5e-5)))
    velocity, omega = (tuple(map(float, rng.normal(scale=10.0 ** rng.uniform(-4, 0), size=3))) for _ in range(2))
    s = Seen(Motion(place, attitude, velocity, omega, (0.0,) * 4), rotation_matrix(attitude))
    memory = []
    for foot in e.feet:
        at = Foot(e, s, foot).place if hasattr(e, "tangential_stiffness") else None
        off = rng.normal(scale=10.0 ** rng.uniform(-6, -3), size=2)
        how = float(rng.integers(3))
        square = float(10.0 ** rng.uniform(-8, 0))
        anchor = (at[0] + float(off[0]), at[1] + float(off[1]), 0.0, how, square) if at else ()
        memory.append(NOWHERE if at and how == FREE else anchor)
    return s, tuple(memory)


@pytest.mark.parametrize("ground", GROUNDS)
@pytest.mark.parametrize("law", ["stick_slip", "regularised"])
def test_each_foot_does_what_it_does_alone(drone, law, ground):
    (e,) = effects.from_scene({"ground_contact": {"friction": law}}, drone)
    e = e._replace(feet=(*e.feet[:4], (0.01, 0.0, -0.3501)), terrain=GROUNDS[ground])
    rng, kinds = np.random.default_rng(1), set()
    for _ in range(300):
        s, memory = drawn(rng, e)
        (force, torque), points, touches, *settled = (anchored if law == "stick_slip" else smooth)(e, memory, s)
        feet = [Foot(e, s, foot) for foot in e.feet]
        alone = [foot.force(anchor) for foot, anchor in zip(feet, memory, strict=True)]
        total, moment = ZERO, ZERO
        for foot, push in zip(feet, alone, strict=True):
            total, moment = add(total, push), add(moment, cross(foot.arm, push))
        assert force == total
        assert torque == apply_transposed(s.R_world_body, moment)
        assert points == tuple((foot.place, push) for foot, push in zip(feet, alone, strict=True))
        assert touches == any(foot.press > 0.0 for foot in feet)
        if law == "stick_slip":
            assert settled == [tuple(foot.settled(anchor) for foot, anchor in zip(feet, memory, strict=True))]
            kinds |= {(before[3], after[3]) for before, after in zip(memory, settled[0], strict=True)}
    assert law == "regularised" or len(kinds) == 9  # every change between free, sticking and sliding has been seen
