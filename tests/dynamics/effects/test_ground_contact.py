"""Landing, resting, sliding, bouncing and tipping over on level ground, slopes and bumps."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from lapwing.dynamics import effects
from lapwing.dynamics.effects import _hooks as hooks
from lapwing.dynamics.effects import _stiff_effects as stiff_effects
from lapwing.dynamics.environment import Environment
from lapwing.dynamics.integrators import get
from lapwing.dynamics.lie.quaternion import Quaternion
from lapwing.dynamics.terrain import relief
from lapwing.dynamics.vehicles import multirotor

pytestmark = pytest.mark.long

RK4 = get("rk4_renormalised").Method()
G, HEIGHT = 9.80665, 0.35
OFF = (0.0,) * 4


def setting(drone, height=0.0, angle=0.0, velocity=(0.0, 0.0, 0.0), tilt=(0.0, 0.0, 0.0), bumps=None, **table):
    """Return the drone at `height` over ground that rises along y by `angle`, turned from the ground by `tilt`."""
    around = Environment(terrain=relief((0.0, math.tan(angle)), **(bumps or {})))
    p = multirotor.parameters(drone, effects.from_scene({"gravity": {}, "ground_contact": table}, drone, around))
    rotation = Rotation.from_rotvec((angle, 0.0, 0.0)) * Rotation.from_rotvec(tilt)
    normal = np.array([0.0, -math.sin(angle), math.cos(angle)])
    attitude = Quaternion(*map(float, rotation.as_quat(scalar_first=True)))
    state = multirotor.initial_state(p, tuple(map(float, (HEIGHT + height) * normal)), attitude)
    return p, state._replace(motion=state.motion._replace(velocity_world=tuple(map(float, velocity))))


def run(p, state, seconds, h=1e-3):
    return multirotor.advance(RK4, p, (0, 0), 0, state, OFF, h, round(seconds / h))


def energy(p, m):
    spin = np.dot(p.body.inertia, np.square(m.omega_body))
    return p.body.mass * (G * m.position_world[2] + np.dot(m.velocity_world, m.velocity_world) / 2) + spin / 2


def settled(drone, angle=0.0, **table):
    """Return the drone at rest, its feet so deep that they carry the weight: k d s(d / w) = m g cos a / 4."""
    load = drone.mass.total * G * math.cos(angle) / 4
    depth = brentq(lambda d: 1e6 * d * (d / 1e-4) ** 2 * (3 - 2 * d / 1e-4) - load, 0.0, 1e-4)
    p, state = setting(drone, -depth, angle, **table)
    return p, run(p, state, 3.0)


def test_stretched_elements_stay_awake_in_air(drone):
    p, state = setting(drone, 50.0)
    relaxed, motion = state.memory, state.motion
    stretched = tuple(((1e-6, 0.0, 0.0), *feet[1:]) if feet else feet for feet in relaxed)
    assert hooks.all_sleeping(p.effects, relaxed, motion, 1e-3)
    for memory, able in ((relaxed, True), (stretched, False)):
        assert hooks.all_can_sleep(p.effects, memory) == able
        assert stiff_effects.all_stiff_sleeping(p.effects, memory, motion, 1e-3) == able


def test_rests_for_hour_without_drift(drone):
    p, state = settled(drone)
    later = run(p, state, 3600.0).motion
    assert np.abs(np.subtract(later.position_world, state.motion.position_world)).max() < 1e-9
    assert np.abs(later.velocity_world + later.omega_body).max() < 1e-9
    force = multirotor.observe(p, 0, 0.004, state, OFF)
    assert force.in_contact
    assert force.acceleration_world == pytest.approx((0, 0, 0), abs=1e-6)


def test_sticks_on_slope_below_friction_angle(drone):
    p, state = settled(drone, angle=math.radians(20))
    later = run(p, state, 600.0).motion
    assert np.abs(np.subtract(later.position_world, state.motion.position_world)).max() < 1e-6  # target: 1 mm


def test_smooth_law_creeps_on_same_slope(drone):
    """tan 20 deg = mu_s (1.5 x - 0.5 x^3) at x = 0.54 critical velocities of 1 mm/s."""
    _, rest = settled(drone, math.radians(20))
    p, state = setting(drone, angle=math.radians(20), friction="regularised")
    state = run(p, state._replace(motion=rest.motion), 1.0)
    creep = -np.dot(
        run(p, state, 1.0).motion.velocity_world, (0, math.cos(math.radians(20)), math.sin(math.radians(20)))
    )
    x = np.roots([-0.5, 0.0, 1.5, -math.tan(math.radians(20)) / 0.5])
    assert creep == pytest.approx(1e-3 * min(root.real for root in x if root.real > 0), rel=0.02)
    assert creep == pytest.approx(0.5e-3, rel=0.1)


@pytest.mark.parametrize("friction", ["stick_slip", "regularised"])
def test_slides_above_friction_angle_by_closed_form(drone, friction):
    """Acceleration g (sin a - mu_d cos a) once it slides."""
    angle = math.radians(30)
    p, state = setting(drone, angle=angle, friction=friction)
    down = np.array([0.0, -math.cos(angle), -math.sin(angle)])
    early = run(p, state, 0.3)
    late = run(p, early, 0.5).motion
    expected = G * (math.sin(angle) - 0.3 * math.cos(angle))
    change = np.subtract(late.velocity_world, early.motion.velocity_world) @ down
    assert change / 0.5 == pytest.approx(expected, rel=1e-3)
    assert np.abs(late.omega_body).max() < 1e-2


def test_sliding_stops_where_friction_has_spent_energy(drone):
    """1 m/s on level ground: v^2 / (2 mu_d g), and then it sticks."""
    p, state = settled(drone)
    m = state.motion
    later = run(p, state._replace(motion=m._replace(velocity_world=(1.0, 0.0, 0.0))), 2.0).motion
    assert later.position_world[0] - m.position_world[0] == pytest.approx(1.0 / (2 * 0.3 * G), rel=0.02)
    assert np.abs(later.velocity_world).max() < 1e-6


def over_ground(m, angle):
    return m.position_world[2] * math.cos(angle) - m.position_world[1] * math.sin(angle)


@pytest.mark.parametrize("tilt", [(0.0, 0.0, 0.0), (0.15, -0.1, 0.3)], ids=["upright", "tilted"])
@pytest.mark.parametrize("speed", [0.1, 0.3, 1.0, 3.0])
def test_lands_on_level_ground_and_stays(drone, speed, tilt):
    p, state = setting(drone, height=0.08, velocity=(0.2, 0.0, -speed), tilt=tilt)
    m = run(p, state, 6.0).motion
    assert np.abs(m.velocity_world + m.omega_body).max() < 1e-5
    assert over_ground(m, 0.0) == pytest.approx(HEIGHT, abs=1e-4)  # on its feet


@pytest.mark.parametrize("tilt", [(0.0, 0.0, 0.0), (0.15, -0.1, 0.3)], ids=["upright", "tilted"])
@pytest.mark.parametrize("speed", [0.1, 0.3, 1.0, 3.0])
def test_lands_on_slope_and_stays_or_slides(drone, speed, tilt):
    """At 20 degrees, between the friction angles, a vehicle that the impact does not stop slides by the closed form."""
    angle = math.radians(20)
    p, state = setting(drone, height=0.08, angle=angle, velocity=(0.0, 0.0, -speed), tilt=tilt)
    state = run(p, state, 3.0)
    m, later = state.motion, run(p, state, 1.0).motion
    before, after = np.linalg.norm(m.velocity_world), np.linalg.norm(later.velocity_world)
    assert over_ground(later, angle) == pytest.approx(HEIGHT, abs=1e-4)
    assert np.abs(later.omega_body).max() < 1e-4
    if before < 1e-5:
        assert after < 1e-5
    else:
        assert after - before == pytest.approx(G * (math.sin(angle) - 0.3 * math.cos(angle)), rel=0.02)


# At 0.3 m/s it slips at 0.1 m/s down the slope, where the coefficient, 0.35, is below tan(20 deg) = 0.36: it slides on.
@pytest.mark.parametrize("speed", [0.1, 0.2])
def test_soft_touch_down_on_slope_sticks(drone, speed):
    p, state = setting(drone, height=0.0005, angle=math.radians(20), velocity=(0.0, 0.0, -speed))
    assert np.linalg.norm(run(p, state, 3.0).motion.velocity_world) < 1e-6


@pytest.mark.parametrize("h", [1e-3, 4e-3])
@pytest.mark.parametrize("tilt", [(0.0, 0.0, 0.0), (0.2, 0.1, 0.0)], ids=["upright", "tilted"])
def test_bounces_without_gaining_energy(drone, tilt, h):
    """The energy in the air never grows."""
    p, state = setting(drone, height=1.0, tilt=tilt, damping=50.0)
    energies, bounces, flying = [energy(p, state.motion)], 0, True
    for _ in range(round(4.0 / h)):
        state = run(p, state, h, h)
        touching = multirotor.observe(p, 0, 0.004, state, OFF).in_contact
        bounces += flying and touching
        flying = not touching
        if flying:
            energies.append(energy(p, state.motion))
    assert bounces >= 3
    assert np.diff(energies).max() < 1e-8 * energies[0]
    assert energies[-1] < energies[0]


@pytest.mark.parametrize(("roll", "over"), [(0.5, False), (0.8, True)])
def test_falls_back_on_its_feet_or_over(drone, roll, over):
    """On two feet the vehicle tips over when its centre of mass is beyond them: roll above atan(0.25 / 0.35) = 0.62."""
    edge = np.array([0.0, -0.25, -0.35])
    p, state = setting(drone, tilt=(roll, 0.0, 0.0))
    height = -(Rotation.from_rotvec((roll, 0, 0)).apply(edge))[2]
    state = state._replace(motion=state.motion._replace(position_world=(0.0, 0.0, float(height))))
    m = run(p, state, 6.0).motion
    up = Rotation.from_quat(m.attitude, scalar_first=True).as_matrix()[2, 2]
    assert bool(up < 0.3) is over
    assert over or up == pytest.approx(1.0, abs=1e-3)
    assert np.abs(m.velocity_world + m.omega_body).max() < 1e-2
    assert m.position_world[2] > -1e-3


def test_vehicle_rests_on_bumps(drone):
    p, state = setting(drone, height=0.1, bumps={"bump_height": 0.02, "bump_length": 0.7})
    state = run(p, state, 3.0)
    m = run(p, state, 60.0).motion
    assert np.abs(np.subtract(m.position_world, state.motion.position_world)).max() < 1e-6
    assert multirotor.observe(p, 0, 0.004, state, OFF).in_contact


@pytest.mark.parametrize("friction", ["stick_slip", "regularised"])
def test_split_step_equals_fine_steps(drone, friction):
    """A step of 4 ms, split while in contact, ends where steps of 0.25 ms do, after five bounces and a slide."""
    coarse, fine = (
        run(*setting(drone, height=0.05, velocity=(0.3, 0.0, -1.0), friction=friction), 1.0, h).motion
        for h in (4e-3, 2.5e-4)
    )
    assert coarse.position_world == pytest.approx(fine.position_world, abs=1e-4)


def bounced(drone, start, speed, seconds):
    """Return the velocity [m/s] `seconds` after a fall from `start` [m] above the ground, independently by SciPy."""
    mass = drone.mass.total

    def rate(t, y):
        depth, width = -y[0], 1e-4
        onset = min(max(depth, 0.0) / width, 1.0)
        force = max(onset**2 * (3 - 2 * onset) * (4e6 * depth - 4e3 * y[1]), 0.0)
        return [y[1], force / mass - G]

    options = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-14, "max_step": 1e-5}
    return solve_ivp(rate, (0.0, seconds), [start, -speed], **options).y[1, -1]


@pytest.mark.parametrize("phase", [0.0, 0.3, 0.5, 0.9])
def test_bounce_is_independent_of_phase_in_step(drone, phase):
    """The speed after an impact at 1 m/s with steps of 1 ms is the same to a ten-thousandth."""
    start = 2e-3 + phase * 1e-3
    p, state = setting(drone, height=start, velocity=(0.0, 0.0, -1.0))
    speed = run(p, state, 12e-3).motion.velocity_world[2]
    assert speed == pytest.approx(bounced(drone, start, 1.0, 12e-3), abs=1e-4)
    finer = run(p._replace(tolerance=1e-9), state, 12e-3).motion.velocity_world[2]
    assert finer == pytest.approx(bounced(drone, start, 1.0, 12e-3), abs=1e-7)


def test_friction_converges_with_tolerance(drone):
    """The end of a slide with turns, bounces and sticking converges as the tolerance falls."""
    p, state = setting(drone, height=0.03, velocity=(0.5, 0.0, -0.3), tilt=(0.0, 0.0, 0.1))
    ends = [run(p._replace(tolerance=tolerance), state, 1.0).motion for tolerance in (1e-4, 1e-8, 1e-9)]
    coarse, fine = (np.abs(np.subtract(m.position_world, ends[-1].position_world)).max() for m in ends[:-1])
    assert coarse < 1e-4
    assert fine < 0.1 * coarse


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ({"stiffness": -1.0}, "effects.ground_contact.stiffness: expected a number above 0 and at most 1e+09"),
        ({"friction": "glue"}, "effects.ground_contact.friction: expected 'stick_slip' or 'regularised', got 'glue'"),
        ({"friction_dynamic": 0.9}, "effects.ground_contact.friction_dynamic: expected at most friction_static = 0.5"),
        ({"stifness": 1e5}, "effects.ground_contact.stifness: unknown key 'stifness'; did you mean stiffness?"),
    ],
)
def test_invalid_options_are_rejected(drone, table, message):
    with pytest.raises(ValueError) as error:
        effects.from_scene({"ground_contact": table}, drone)
    assert message in str(error.value)


def test_vehicle_without_feet_is_rejected(drone):
    with pytest.raises(ValueError, match=r"effects.ground_contact: the vehicle has no feet"):
        effects.from_scene({"ground_contact": {}}, drone.model_copy(update={"contact": None}))
