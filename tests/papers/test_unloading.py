"""Unloading crate against closed forms: reaction, door, friction, rollers, bounces; convergence with half steps."""

import math
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from lapwing.dynamics.integrators import StepDoubling, get, integrate_fixed, integrate_step_doubling, rate
from lapwing.dynamics.lie.quaternion import Quaternion, exp
from lapwing.dynamics.vector import dot, multiply
from lapwing.kernels import kernel
from lapwing.kernels.state_tree import flatten, retract, scale, unflatten
from lapwing.papers.unloading.unloading import UnloadingParameters, initial_state
from lapwing.papers.unloading.unloading_contact_points import frames, roller_speed

pytestmark = pytest.mark.long

RK4 = get("rk4_renormalised").Method()
G, H = 9.81, 2.5e-4
SIZE, MASS = (0.2, 0.13, 0.23), 2.0
INERTIA = tuple(MASS / 12 * (sum(s * s for s in SIZE) - side * side) for side in SIZE)
HALF = tuple(0.5 * s for s in SIZE)
SURFACE = (2e4, 60.0)
P = UnloadingParameters(
    MASS, HALF, INERTIA, math.radians(5.0), 0.1, 0.23, 0.075, 0.02, 0.06, 2 * math.pi, 1.0, 1.0, 0.25, 0.15, 0.043,
    math.pi, 0.002, 50.0, 0.003, 5.0, G, (*SURFACE, 0.5, 0.3), (*SURFACE, 0.2, 0.1), (*SURFACE, 0.5, 0.3),
)  # fmt: skip
NEVER = 1e6
FORWARD = np.array((math.cos(P.tilt), 0.0, -math.sin(P.tilt)))


@kernel
def energy(p, t, x):
    """Return kinetic and potential energy [J] of pack, door, its spring and the springs of ground and rollers.

    Bristles, the door's stop and its edge on the ground are excluded: the sum is the energy while the door touches
    neither.
    """
    f = frames(p, t, x)
    o, v = x.omega_body, x.velocity_world
    inertia = p.door_mass * p.door_length * p.door_length / 3.0
    kinetic = 0.5 * (p.pack_mass * dot(v, v) + dot(o, multiply(p.pack_inertia, o)) + inertia * x.door[1] * x.door[1])
    height = f.hinge[2] + 0.5 * p.door_length * f.along_door[2]
    weight = p.gravity * (p.pack_mass * x.position_world[2] + p.door_mass * height)
    wound = x.door[0] + p.door_preload
    return kinetic + weight + 0.5 * p.door_spring * wound * wound


def run(p, x, seconds, start=0.0, h=H):
    return integrate_fixed(RK4, p, start, x, h, round(seconds / h))


def test_contact_of_equal_velocities_does_no_work():
    """Pack and door turn together about the hinge: their total energy is constant."""
    p = P._replace(floor_height=5.0, ramp_start=-1.0, door_damping=0.0, depth=9.0)
    angle, turning = 1.2, 0.7
    inward = np.array((-math.cos(angle + p.tilt), 0.0, math.sin(angle + p.tilt)))
    along = np.array((math.sin(angle + p.tilt), 0.0, math.cos(angle + p.tilt)))
    hinge = np.array((0.0, 0.0, 5.0))
    # upright on the door's inner face clear of the rollers, 1 mm deep
    place = hinge + 0.13 * along + (HALF[0] - 0.001) * inward
    half = 0.5 * (angle + p.tilt)
    x = initial_state(p)._replace(
        position_world=tuple(place),
        attitude=Quaternion(math.cos(half), 0.0, math.sin(half), 0.0),
        velocity_world=tuple(turning * np.cross((0, 1, 0), place - hinge)),
        omega_body=(0.0, turning, 0.0),
        door=(angle, turning),
    )
    tangent = rate(p, 0.0, x)
    assert np.linalg.norm(np.add(tangent.velocity_world, (0, 0, G))) > 1.0  # there is a force
    step = 1e-6
    ahead, behind = (energy(p, 0.0, retract(x, scale(s, tangent))) for s in (step, -step))
    assert (ahead - behind) / (2 * step) == pytest.approx(0.0, abs=1e-6)


def test_door_alone_swings_with_its_period():
    p = P._replace(gravity=0.0, floor_height=1.0, ramp_start=-1.0, pickup=0.0, door_damping=0.0, door_preload=-1.5)
    x = run(p, initial_state(p)._replace(position_world=(0.0, 0.0, 5.0), door=(1.0, 0.0)), 1.0)
    w = math.sqrt(3 * p.door_spring / (p.door_mass * p.door_length**2))
    assert x.door[0] == pytest.approx(1.5 - 0.5 * math.cos(w), abs=1e-9)
    assert x.door[1] == pytest.approx(0.5 * w * math.sin(w), abs=1e-9)


def test_pack_rests_below_friction_angle():
    p = P._replace(ramp_start=NEVER, pickup=NEVER)
    settled = run(p, initial_state(p), 1.0)
    later = run(p, settled, 4.0, start=1.0)
    assert later.position_world == pytest.approx(settled.position_world, abs=1e-7)


def test_sliding_above_friction_angle_follows_coulomb():
    p = P._replace(tilt=math.radians(35.0), ramp_start=NEVER, pickup=NEVER, depth=9.0)
    speeds = [np.linalg.norm(run(p, initial_state(p, gap=0.05), t).velocity_world) for t in (0.06, 0.12)]
    expected = G * (math.sin(p.tilt) - 0.3 * math.cos(p.tilt))
    assert (speeds[1] - speeds[0]) / 0.06 == pytest.approx(expected, rel=0.02)


def test_rollers_carry_pack_at_their_surface_speed():
    p = P._replace(roller_speed=2.5, ramp_start=0.0, ramp_duration=0.2, pickup=NEVER, depth=9.0)
    x = run(p, initial_state(p, gap=0.1), 0.8)
    assert np.dot(x.velocity_world, FORWARD) == pytest.approx(2.5 * p.roller_radius, rel=1e-3)


def test_rollers_ramp_up_linearly():
    assert [roller_speed(P, t) for t in (0.5, 1.5, 9.0)] == pytest.approx([0.0, math.pi, 2 * math.pi])


def test_fall_bounces_lower_every_time():
    p = P._replace(pickup=NEVER)
    x = initial_state(p)._replace(position_world=(1.0, 0.0, 0.2), attitude=exp((0.0, 0.05, 0.0)))
    at, total, t = [], [], 0.0
    for _ in range(400):
        x = run(p, x, 0.005, start=t)
        t += 0.005
        at.append(x.position_world[2])
        total.append(energy(p, t, x._replace(door=(0.0, 0.0))))
    # between two bounces the energy is that of a free body: it only falls
    free = [e for e, z in zip(total, at, strict=True) if z > 0.13]
    assert all(b <= a + 1e-6 for a, b in pairwise(free))
    assert at[-1] == pytest.approx(HALF[2], abs=1e-3)


TIMES = (0.0123, 0.0430, 0.0779)  # [s] the rollers start, reach their speed, the pack is taken up; between two ticks


def split_reference(x, end):
    """Return SciPy's DOP853 solution over pieces with constant parameters."""
    start, full, taken = TIMES
    pieces = (
        (0.0, start, P._replace(ramp_start=NEVER, pickup=NEVER)),
        (start, full, P._replace(ramp_start=start, ramp_duration=full - start, pickup=NEVER)),
        (full, taken, P._replace(ramp_start=-1.0, ramp_duration=0.5, pickup=NEVER)),
        (taken, end, P._replace(ramp_start=-1.0, ramp_duration=0.5, pickup=-1.0)),
    )
    y = np.array(flatten(x))
    for a, b, p in pieces:
        y = solve_ivp(
            lambda t, y, p=p: ambient(x, p, t, y), (a, b), y, "DOP853", rtol=1e-12, atol=1e-12, max_step=1e-3
        ).y[:, -1]
    return y


def ambient(x, p, t, y):
    """Return the rate of the flat state; quaternion rates are half the product with the body rates."""
    state = unflatten(x, tuple(map(float, y)))
    q, o = np.array(state.attitude), np.array(state.omega_body)
    turned = 0.5 * np.array([-q[1:] @ o, *(q[0] * o + np.cross(q[1:], o))])
    tangent = rate(p, t, state)
    return np.concatenate([tangent[0], turned, np.array(flatten(tangent))[6:]])


def test_ramp_and_pickup_between_ticks_are_exact():
    """The pack has settled on the rollers; 0.1 s in ticks of 4 ms and steps of 1 ms."""
    x = settled = run(P._replace(ramp_start=NEVER, pickup=NEVER), initial_state(P), 1.0)
    p = P._replace(ramp_start=TIMES[0], ramp_duration=TIMES[1] - TIMES[0], pickup=TIMES[2])
    for tick in range(25):
        x = integrate_step_doubling(StepDoubling(RK4, 1e-11), p, tick * 0.004, x, 1e-3, (tick + 1) * 0.004)
    assert np.array(flatten(x)) == pytest.approx(split_reference(settled, 0.1), abs=1e-8)


def test_event_on_tick_takes_effect_there():
    """12 ticks of 4 ms are 0.048 s only up to rounding; an event off by rounding is on the tick."""
    x = run(P._replace(ramp_start=NEVER, pickup=NEVER), initial_state(P), 1.0)
    ends = [
        integrate_step_doubling(StepDoubling(RK4, 1e-9), P._replace(pickup=pickup), start, x, 1e-3, start + 0.004)
        for start, pickup in (
            (0.048, 0.048),
            (0.048, 0.048 * (1 + 1e-13)),
            (0.044, 0.048),
            (0.044, 0.048 * (1 - 1e-13)),
        )
    ]
    assert flatten(ends[0]) == flatten(ends[1])
    assert flatten(ends[2]) == flatten(ends[3])
    assert ends[0].velocity_world[2] > 0.05 > abs(ends[2].velocity_world[2])


def test_unloading_converges_and_door_shuts():
    coarse, fine = (
        integrate_step_doubling(StepDoubling(RK4, tolerance), P, 0.0, initial_state(P), step, 4.5)
        for tolerance, step in ((1e-5, 1e-3), (1e-8, 2.5e-4))
    )
    assert coarse.position_world == pytest.approx(fine.position_world, abs=1e-5)
    x, _, z = coarse.position_world
    assert x > 0.2  # out of the crate
    assert z < 0.16  # and down
    assert abs(coarse.position_world[1]) < 1e-9  # planar motion as in the source
    assert math.degrees(coarse.door[0]) > 95.0
    shut = run(P, coarse, 4.5, start=4.5)
    assert abs(math.degrees(shut.door[0])) < 0.5
    assert shut.position_world[2] > 1.0  # the pack is removed
